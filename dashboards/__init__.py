"""What people look at: the Rerun timeline of a recording."""
