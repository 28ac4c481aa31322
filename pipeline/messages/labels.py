"""Names of the classes of a detector: vision_msgs/LabelInfo (vision_msgs 4.1 and later)."""

from __future__ import annotations

from pipeline.messages.content import ClassLabels, Decoded
from pipeline.messages.tree import Tree, children, frame_id_of, text, time_of, whole

MOST_CLASSES = 65_536  # class_id is a uint16


def label_info(tree: Tree) -> Decoded:
    """Return the class names by number of a vision_msgs/LabelInfo."""
    rows = children(tree, "class_map")[:MOST_CLASSES]
    names = {str(whole(row, "class_id")): text(row, "class_name").strip() for row in rows}
    stated = {number: name for number, name in names.items() if name}
    return Decoded(time_of(tree), frame_id_of(tree), ClassLabels(stated) if stated else None)
