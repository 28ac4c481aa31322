"""Records, configuration and errors that every stage shares."""
