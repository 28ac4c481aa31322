"""Sensors by name, and the lens that a camera file gives by what a data sheet says."""
