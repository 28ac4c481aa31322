"""Fuzzing: bytes that nobody would write, in search of what only an attacker or a bad disk makes."""
