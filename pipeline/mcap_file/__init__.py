"""Mcap_file."""
