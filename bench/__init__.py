"""Benchmarks: the code that measures each claim about speed, memory and accuracy (`make bench`)."""
