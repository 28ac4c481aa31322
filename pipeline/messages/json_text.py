"""JSON: one object for each message."""

from __future__ import annotations

import json
import re

from pipeline.messages.tree import Tree, UndecodableMessage

_SURROGATE = re.compile(rb"\\u[dD][89a-fA-F]|\xed[\xa0-\xbf]")


def read(data: bytes) -> Tree:
    """Return a message.

    Raises:
        UndecodableMessage: it is no JSON object, or a text in it is no Unicode.
    """
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError) as error:  # bad bytes and bad JSON are both ValueErrors
        raise UndecodableMessage(f"not JSON: {error}") from error
    if not isinstance(tree, dict):
        raise UndecodableMessage("not a JSON object")
    if _SURROGATE.search(data):
        _refuse_half_characters(tree)
    return tree


def _refuse_half_characters(tree: Tree) -> None:
    """Refuse lone surrogates, which JSON's escapes can write and no UTF-8 writer takes."""
    try:
        json.dumps(tree, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        problem = f"a text holds half a character ({error.object[error.start]!a})"
        raise UndecodableMessage(problem) from error


def property_names(schema: bytes) -> frozenset[str]:
    """Return the names of the properties that a JSON schema declares at its top."""
    try:
        declared = read(schema).get("properties")
    except UndecodableMessage:
        return frozenset()
    return frozenset(declared) if isinstance(declared, dict) else frozenset()
