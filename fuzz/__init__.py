"""Fuzzing: damaged and hostile bytes given to the readers, in search of crashes and endless work."""
