"""Recordings through pass 1 and pass 2, and their calibration: the order of the work."""
