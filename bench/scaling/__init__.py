"""One recording and many on several cores: speed, and agreement of windows with the whole."""
