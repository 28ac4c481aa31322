"""Header of an ONNX file: inputs and outputs with their shapes, and metadata.

OpenCV runs a model without showing its metadata, and `onnx` is not worth a dependency for a dozen
fields. The file is a protobuf message; its wire format (protobuf.dev/programming-guides/encoding) is
walked and what is not asked for, the weights above all, is skipped. Nothing in the file is trusted:
every length is checked before it is used.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.core.errors import UnusableModel, Where

# A protobuf message cannot be larger.
MAX_BYTES = 2**31
# Class names of the largest vocabularies are some hundred kilobytes.
MAX_METADATA_BYTES = 1_000_000
# Field numbers of onnx.proto3.
_GRAPH, _METADATA = 7, 14
_INITIALIZER, _INPUT, _OUTPUT = 5, 11, 12
# What people hand over in the place of a model, by its first bytes.
_OTHER_KINDS = (
    (b"PK\x03\x04", "a PyTorch checkpoint or another ZIP archive", "Export it to ONNX first"),
    (b"version https://git-lfs", "a Git LFS pointer", "Fetch the file itself with `git lfs pull`"),
    (b"\x80", "a pickle (a PyTorch checkpoint)", "Export it to ONNX first"),
    (b"ftrt", "a TensorRT engine", "Give the ONNX file that it was made of"),
    (b"<", "a web page or XML", "Download the file itself"),
    (b"\x89MCAP", "a recording", "Give the model with --model, recordings without a flag"),
)
_EXPORT = "Give a file that was exported to ONNX"


@dataclass(frozen=True, slots=True)
class Tensor:
    """An input or output: its name, ONNX element type, and shape, -1 where it is not fixed."""

    name: str
    element_type: int
    shape: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class OnnxFile:
    """Facts that a model file states about itself."""

    path: Path
    sha256: str
    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]
    metadata: dict[str, str]

    def class_names(self) -> tuple[str, ...]:
        """Return the class names by index that Ultralytics and others write; none is empty.

        Raises:
            UnusableModel: there are names, but not in a form that can be read.
        """
        text = self.metadata.get("names", "")
        if not text:
            return ()
        try:
            value = ast.literal_eval(text)
        except (ValueError, SyntaxError, RecursionError, MemoryError):
            value = None
        if isinstance(value, dict) and set(value) == set(range(len(value))):
            value = [value[i] for i in range(len(value))]
        if isinstance(value, list) and all(isinstance(name, str) for name in value):
            return tuple(value)
        raise UnusableModel(
            f"the class names in the model's metadata cannot be read: {text[:60]!r}",
            where=Where(self.path),
            remedy="Give them as model_classes in the table [detect] of the camera file",
        )

    def image_size_px(self) -> tuple[int, int] | None:
        """Return height and width that the metadata state as the size of training, if any."""
        try:
            value = ast.literal_eval(self.metadata.get("imgsz", ""))
        except (ValueError, SyntaxError, RecursionError, MemoryError):
            return None
        sides = value if isinstance(value, list | tuple) else [value, value]
        if len(sides) == 2 and all(isinstance(s, int) and 32 <= s <= 8192 for s in sides):
            return sides[0], sides[1]
        return None


def read_onnx_file(path: Path) -> OnnxFile:
    """Read a model's description, without its weights.

    Raises:
        UnusableModel: the file cannot be read, or is no ONNX model.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise UnusableModel("the model is larger than 2 GiB", where=Where(path))
        data = path.read_bytes()
    except OSError as error:
        raise UnusableModel(
            f"cannot read the model: {error.strerror or error}",
            where=Where(path),
            remedy="Give the path of an ONNX file with --model",
        ) from error
    try:
        inputs, outputs, metadata = _model(memoryview(data))
    except _NotProtobufError:
        inputs, outputs, metadata = (), (), {}
    if not inputs or not outputs:
        raise _no_model(path, data)
    return OnnxFile(path, hashlib.sha256(data).hexdigest(), inputs, outputs, metadata)


def _no_model(path: Path, data: bytes) -> UnusableModel:
    for start, kind, remedy in _OTHER_KINDS:
        if data.startswith(start):
            return UnusableModel(
                f"this is {kind}, not an ONNX model", where=Where(path), remedy=remedy
            )
    problem = "the file is empty" if not data else "this is no ONNX model, or a damaged one"
    return UnusableModel(problem, where=Where(path), remedy=_EXPORT)


class _NotProtobufError(Exception):
    """The bytes are no protobuf message."""


Field = tuple[int, int, memoryview]  # number, value of a varint (else 0), bytes (else empty)


def _fields(data: memoryview) -> Iterator[Field]:
    """Yield the fields of a message in order."""
    at, empty = 0, memoryview(b"")
    while at < len(data):
        key, at = _varint(data, at)
        number, wire = key >> 3, key & 7
        if number == 0:
            raise _NotProtobufError
        if wire == 0:
            value, at = _varint(data, at)
            yield number, value, empty
            continue
        if wire == 2:
            length, at = _varint(data, at)
        elif wire in (1, 5):
            length = 8 if wire == 1 else 4
        else:
            raise _NotProtobufError
        if length > len(data) - at:
            raise _NotProtobufError
        yield number, 0, data[at : at + length]
        at += length


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(data):
            break
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise _NotProtobufError


def _model(data: memoryview) -> tuple[tuple[Tensor, ...], tuple[Tensor, ...], dict[str, str]]:
    inputs: list[Tensor] = []
    outputs: list[Tensor] = []
    weights: set[str] = set()
    metadata: dict[str, str] = {}
    for number, _, value in _fields(data):
        if number == _METADATA and len(value) <= MAX_METADATA_BYTES:
            pair = {n: _text(v) for n, _, v in _fields(value)}
            metadata[pair.get(1, "")] = pair.get(2, "")
        if number != _GRAPH:
            continue
        for part, _, inner in _fields(value):
            if part == _INPUT:
                inputs.append(_tensor(inner))
            elif part == _OUTPUT:
                outputs.append(_tensor(inner))
            elif part == _INITIALIZER:
                weights.update(_text(v) for n, _, v in _fields(inner) if n == 8)
    # Old files list the weights among the inputs.
    return tuple(i for i in inputs if i.name not in weights), tuple(outputs), metadata


def _tensor(data: memoryview) -> Tensor:
    """Read a ValueInfoProto: name = 1, type = 2 {tensor_type = 1 {elem_type = 1, shape = 2}}."""
    name, element_type, shape = "", 0, []
    for number, _, value in _fields(data):
        if number == 1:
            name = _text(value)
        elif number == 2:
            for kind, _, tensor in _fields(value):
                if kind != 1:
                    continue
                for n, element, inner in _fields(tensor):
                    if n == 1:
                        element_type = element
                    elif n == 2:
                        shape = [_side(v) for m, _, v in _fields(inner) if m == 1]
    return Tensor(name, element_type, tuple(shape))


def _side(data: memoryview) -> int:
    """Read a dimension: dim_value = 1; a name, or nothing, means that it is not fixed."""
    return next((value for number, value, _ in _fields(data) if number == 1 and value > 0), -1)


def _text(data: memoryview) -> str:
    return bytes(data).decode("utf-8", errors="replace")
