"""Text that any UTF-8 writer takes: file names and messages may hold what is no text."""

from __future__ import annotations


def storable(text: str) -> str:
    r"""Return a text with what is no Unicode written out: a byte as `\xff`, a surrogate as `\ud800`.

    File names of bytes that are no UTF-8 come as lone surrogates (PEP 383), which neither Arrow nor
    DuckDB takes.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        pass
    else:
        return text
    try:
        return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    except UnicodeEncodeError:
        return text.encode("utf-8", "backslashreplace").decode()
