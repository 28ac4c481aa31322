"""Recordings made of videos and photos."""
