"""Remedy for a library that is not installed: the command that works, as there is no index to ask."""

from __future__ import annotations


def how_to_install(extra: str) -> str:
    """Return how to install an extra, in a checkout and from a wheel file."""
    return (
        f"Install the extra `{extra}`: pip install '.[{extra}]' in the folder of the source, or "
        f"pip install 'stadimeter-VERSION-py3-none-any.whl[{extra}]' with the path of the wheel"
    )
