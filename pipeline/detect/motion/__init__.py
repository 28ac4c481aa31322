"""Objects that move before a fixed camera."""
