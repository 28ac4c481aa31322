"""Truth in trees: CVML (XML, as of PETS) and COCO (JSON).

CVML   List and Fisher (2004), CVML - An XML-based Computer Vision Markup Language, ICPR: frames that
       list objects, whose box has a centre (xc, yc), a width and a height. Frames count from 0.
COCO   Lin et al. (2014), Microsoft COCO, ECCV, and cocodataset.org: images, annotations with
       [left, top, width, height] from the outer edge of the first pixel, categories. Videos (as of
       CocoVID) have `frame_id` from 0, and `instance_id` or `track_id` of the object.
"""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.core.errors import UsageError
from pipeline.truth.rows import TruthFile, TruthRow

_IDENTITIES = ("track_id", "instance_id", "object_id")
_FRAMES = ("frame_id", "frame_index", "frame_number")
_LAST_NUMBER = re.compile(r"(\d+)(?!.*\d)")


def read_cvml(text: str) -> TruthFile:
    """Return the truth of a CVML file.

    Raises:
        UsageError: it is no XML, or declares entities.
    """
    if re.search(r"<!(DOCTYPE|ENTITY)", text):
        raise UsageError("an XML file of truth declares no types or entities of its own")
    try:
        root = ET.fromstring(text)  # noqa: S314
    except ET.ParseError as error:
        raise UsageError(f"not valid XML: {error}") from error
    truth = TruthFile("cvml", first_frame=0)
    for frame in root.iter("frame"):
        try:
            number = int(frame.get("number", ""))
        except ValueError:
            truth.refused.append(f"a frame has the number {frame.get('number')!r}")
            continue
        truth.frames.add(number)
        for item in frame.iter("object"):
            box = item.find("box")
            found = {} if box is None else box.attrib
            try:
                sides = [float(found.get(k, "")) for k in ("xc", "yc", "w", "h")]
            except ValueError:
                truth.refused.append(f"object {item.get('id')} in frame {number} has no box")
                continue
            x, y, wide, tall = sides
            edges = (x - wide / 2, y - tall / 2, x + wide / 2, y + tall / 2)
            truth.add(TruthRow(number, item.get("id", ""), "person", edges))
    return truth


def read_coco(text: str) -> TruthFile:
    """Return the truth of a COCO file.

    Raises:
        UsageError: it is no JSON, or lacks images or annotations.
    """
    try:
        tree = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise UsageError(f"not valid JSON: {error}") from error
    if not isinstance(tree, dict) or not {"images", "annotations"} <= tree.keys():
        raise UsageError("a COCO file has `images` and `annotations`")
    truth = TruthFile("coco", first_frame=0)
    frames = _frames(_dicts(tree["images"]), truth)
    names = {c.get("id"): str(c.get("name")) for c in _dicts(tree.get("categories", []))}
    truth.frames.update(frames.values())
    unnamed = 0
    for item in _dicts(tree["annotations"]):
        frame = frames.get(item.get("image_id"))
        identity = next((item[k] for k in _IDENTITIES if item.get(k) is not None), None)
        if identity is None and isinstance(item.get("attributes"), dict):
            identity = item["attributes"].get("track_id")
        try:
            left, top, wide, tall = (float(v) for v in item["bbox"])
        except (KeyError, TypeError, ValueError):
            truth.refused.append(f"annotation {item.get('id')} has no box")
            continue
        if frame is None:
            truth.refused.append(f"annotation {item.get('id')} is of no image of the file")
            continue
        ignored = bool(item.get("iscrowd") or item.get("ignore"))
        unnamed += identity is None and not ignored
        name = str(identity) if identity is not None else f"annotation {item.get('id')}"
        edges = (left - 0.5, top - 0.5, left - 0.5 + wide, top - 0.5 + tall)
        truth.add(TruthRow(frame, name, names.get(item.get("category_id")), edges), ignored=ignored)
    if unnamed:
        truth.doubts.append(
            f"{unnamed} annotations have no track_id or instance_id: they tell what is found, and "
            "nothing of identities (IDF1, HOTA, switches)"
        )
    return truth


def _dicts(values: Any) -> list[Mapping[str, Any]]:
    return [v for v in values if isinstance(v, dict)] if isinstance(values, Sequence) else []


def _frames(images: list[Mapping[str, Any]], truth: TruthFile) -> dict[Any, int]:
    """Return the frame number of each image: as stated, else the last number in its file's name."""
    frames: dict[Any, int] = {}
    named = 0
    for image in images:
        stated = next((image[k] for k in _FRAMES if isinstance(image.get(k), int)), None)
        if stated is None:
            number = _LAST_NUMBER.search(str(image.get("file_name", "")).rsplit(".", 1)[0])
            if number is None:
                truth.refused.append(f"image {image.get('id')} has no frame number")
                continue
            stated, named = int(number[1]), named + 1
        frames[image.get("id")] = stated
    if named and frames:
        truth.first_frame = min(frames.values())
        truth.doubts.append(
            f"frame numbers are those of the images' names; {truth.first_frame}, the smallest, is "
            "taken for the recording's first frame (--first-frame says otherwise)"
        )
    return frames
