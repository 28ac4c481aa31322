"""Fixtures that all tests share."""

from __future__ import annotations

from hypothesis import settings

# The same examples every time, and no time limit an example: the machine may be busy.
settings.register_profile("ci", derandomize=True, deadline=None)
settings.load_profile("ci")
