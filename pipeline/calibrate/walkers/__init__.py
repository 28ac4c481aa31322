"""Walkers."""
