"""Tracks from observations."""
