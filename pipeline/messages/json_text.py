"""JSON: one object for each message."""

from __future__ import annotations

import json

from pipeline.messages.tree import Tree, UndecodableMessage


def read(data: bytes) -> Tree:
    """Return a message.

    Raises:
        UndecodableMessage: it is no JSON object.
    """
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError) as error:  # bad bytes and bad JSON are both ValueErrors
        raise UndecodableMessage(f"not JSON: {error}") from error
    if not isinstance(tree, dict):
        raise UndecodableMessage("not a JSON object")
    return tree


def property_names(schema: bytes) -> frozenset[str]:
    """Return the names of the properties that a JSON schema declares at its top."""
    try:
        declared = read(schema).get("properties")
    except UndecodableMessage:
        return frozenset()
    return frozenset(declared) if isinstance(declared, dict) else frozenset()
