"""Runs of stored recordings: those that count, those that are kept aside."""
