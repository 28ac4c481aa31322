"""Transforms between frames: foxglove.FrameTransform(s), tf2_msgs/TFMessage and tf/tfMessage."""

from __future__ import annotations

import math

from pipeline.messages.content import Decoded, Transform
from pipeline.messages.tree import Tree, child, children, number, text, time_of


def frame_transform(tree: Tree) -> Decoded:
    """Return a foxglove.FrameTransform."""
    return _decoded(time_of(tree), [_foxglove(tree)])


def frame_transforms(tree: Tree) -> Decoded:
    """Return a foxglove.FrameTransforms."""
    rows = children(tree, "transforms")
    return _decoded(_first_time(rows), [_foxglove(row) for row in rows])


def tf_message(tree: Tree) -> Decoded:
    """Return a tf2_msgs/TFMessage."""
    rows = children(tree, "transforms")
    return _decoded(_first_time(rows), [_ros(row) for row in rows])


def _foxglove(tree: Tree) -> Transform:
    return _transform(
        text(tree, "parent_frame_id"),
        text(tree, "child_frame_id"),
        child(tree, "translation"),
        child(tree, "rotation"),
    )


def _ros(tree: Tree) -> Transform:
    moved = child(tree, "transform")
    return _transform(
        text(child(tree, "header"), "frame_id"),
        text(tree, "child_frame_id"),
        child(moved, "translation"),
        child(moved, "rotation"),
    )


def _transform(parent: str, name: str, translation: Tree, rotation: Tree) -> Transform:
    x, y, z = (number(translation, axis, 0.0) for axis in "xyz")
    turn = [number(rotation, axis, 0.0) for axis in "xyzw"]
    if not any(turn):  # left out: not turned
        turn[3] = 1.0
    norm = math.hypot(*turn)
    qx, qy, qz, qw = (v / norm if norm > 0 else math.nan for v in turn)
    return Transform(parent.removeprefix("/"), name.removeprefix("/"), (x, y, z), (qx, qy, qz, qw))


def _decoded(time_ns: int | None, rows: list[Transform]) -> Decoded:
    kept, refused = [], []
    for row in rows:
        finite = all(map(math.isfinite, (*row.translation_m, *row.rotation_xyzw)))
        if finite and row.child and row.child != row.parent:
            kept.append(row)
        else:
            refused.append(f"the transform from {row.parent!r} to {row.child!r} is none")
    return Decoded(time_ns, "", tuple(kept), refused)


def _first_time(rows: list[Tree]) -> int | None:
    return next((t for t in map(time_of, rows) if t is not None), None)
