"""Text from files, made safe to show and to use in entity paths."""

from __future__ import annotations

import unicodedata

import rerun as rr

# The viewer's font is Inter. At a character that it lacks the viewer shows a blank box, and without
# a screen it stops; these blocks are whole in Inter.
_LAST_LATIN, _FIRST_GREEK, _LAST_CYRILLIC = 0x17F, 0x391, 0x44F
_SYMBOLS = frozenset("–—‘’“”•…€™±×°")
MAX_SHOWN = 60


def visible(text: object) -> str:
    r"""Return text of which every character can be seen; the others become `\u{...}`.

    Different texts stay different: a backslash is doubled.
    """
    return "".join(c if _in_font(c) else "\\\\" if c == "\\" else _escaped(c) for c in str(text))


def _escaped(character: str) -> str:
    return f"\\u{{{ord(character):X}}}"


def _in_font(character: str) -> bool:
    if character in _SYMBOLS:
        return True
    code = ord(character)
    known = code <= _LAST_LATIN or _FIRST_GREEK <= code <= _LAST_CYRILLIC
    if not known or character == "\\" or character == "\u00ad":
        return False
    if unicodedata.category(character)[0] not in "LNPS" and character != " ":
        return False
    # Between Greek and Cyrillic there are Coptic and archaic letters.
    return not 0x3CF <= code <= 0x400


def title(text: object) -> str:
    """Return a name for a view: visible, and not longer than a title bar."""
    shown = visible(text) or "(unnamed)"
    return shown if len(shown) <= MAX_SHOWN else f"{shown[: MAX_SHOWN - 1]}…"


def entity_part(text: object) -> str:
    """Return one part of an entity path, not yet escaped; different texts give different parts."""
    shown = visible(text)
    # An empty part would vanish from the path, and the camera with it.
    return f"(unnamed){shown}" if not shown or shown.startswith("(unnamed)") else shown


def path(*parts: object) -> str:
    """Return an entity path; a name from a file is one part of it, with any characters."""
    return rr.new_entity_path([entity_part(part) for part in parts])


def markdown(text: object) -> str:
    """Return text from a file that Markdown shows as it is."""
    return "".join("\\" + c if c in "\\`*_{}[]()<>#+-.!|~&" else c for c in visible(text))
