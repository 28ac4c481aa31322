"""The Rerun timeline of recordings."""
