"""Tiny ONNX models, written byte by byte, so that tests need neither `onnx` nor a file of weights.

A model gives the boxes it was made with, whatever the picture, except that `scores_from_colour` lets
the scores be the means of the three input planes: that shows how the picture was handed over.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

FLOAT, UINT8, INT64 = 1, 2, 7
_TYPES = {np.dtype(np.float32): FLOAT, np.dtype(np.uint8): UINT8, np.dtype(np.int64): INT64}


def model(
    outputs: Mapping[str, np.ndarray],
    *,
    image_shape: Sequence[int | str] = (1, 3, 64, 64),
    image_type: int = FLOAT,
    sizes_input: bool = False,
    scores_from_colour: bool = False,
    metadata: Mapping[str, str] | None = None,
    declare_shapes: bool = True,
) -> bytes:
    """Return a model of one picture (and its size) that gives the outputs, float32 or int64.

    With `sizes_input`, outputs of floats that are four wide are multiplied by that input.
    With `scores_from_colour`, outputs of floats have the means of the planes added in their last
    three columns.
    """
    nodes, weights = [], [_tensor("zero", np.zeros(1, np.float32))]
    image = "images"
    if image_type != FLOAT:
        nodes.append(_node("Cast", ["images"], ["cast"], to=FLOAT))
        image = "cast"
    axes = (1, 2) if image_shape[-1] == 3 else (2, 3)
    nodes.append(_node("ReduceMean", [image], ["colour"], axes=axes, keepdims=0))  # (1, 3)
    nodes.append(_node("ReduceMean", ["colour"], ["mean"], axes=(1,), keepdims=0))  # (1,)
    nodes.append(_node("Mul", ["mean", "zero"], ["nothing"]))
    if sizes_input:
        nodes.append(_node("Cast", ["orig_target_sizes"], ["size"], to=FLOAT))
        nodes.append(_node("Concat", ["size", "size"], ["sides"], axis=1))
    for name, value in outputs.items():
        weights.append(_tensor(f"{name}_0", value))
        if value.dtype == np.int64:
            nodes.append(_node("Cast", [f"{name}_0"], [f"{name}_1"], to=FLOAT))
            nodes.append(_node("Add", [f"{name}_1", "nothing"], [f"{name}_2"]))
            nodes.append(_node("Cast", [f"{name}_2"], [name], to=INT64))
        elif sizes_input and value.shape[-1] == 4:
            nodes.append(_node("Mul", [f"{name}_0", "sides"], [name]))
        elif scores_from_colour:
            rest = np.zeros((1, value.shape[-1] - 3), np.float32)
            weights.append(_tensor(f"{name}_rest", rest))
            nodes.append(_node("Concat", [f"{name}_rest", "colour"], [f"{name}_row"], axis=1))
            nodes.append(_node("Add", [f"{name}_0", f"{name}_row"], [name]))
        else:
            nodes.append(_node("Add", [f"{name}_0", "nothing"], [name]))
    graph = b"".join(_field(1, n) for n in nodes) + _field(2, b"g")
    graph += b"".join(_field(5, w) for w in weights)
    graph += _field(11, _value_info("images", image_type, image_shape))
    if sizes_input:
        graph += _field(11, _value_info("orig_target_sizes", INT64, (1, 2)))
    for name, value in outputs.items():
        shape = value.shape if declare_shapes else ["any"] * value.ndim
        graph += _field(12, _value_info(name, _TYPES[value.dtype], shape))
    whole = _field(1, 8) + _field(7, graph) + _field(8, _field(1, b"") + _field(2, 13))
    for key, text in (metadata or {}).items():
        whole += _field(14, _field(1, key.encode()) + _field(2, text.encode()))
    return whole


def _varint(value: int) -> bytes:
    value &= (1 << 64) - 1
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def _field(number: int, value: int | bytes) -> bytes:
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    return _varint(number << 3 | 2) + _varint(len(value)) + value


def _node(kind: str, inputs: list[str], outputs: list[str], **attributes: object) -> bytes:
    data = b"".join(_field(1, i.encode()) for i in inputs)
    data += b"".join(_field(2, o.encode()) for o in outputs)
    data += _field(3, f"n_{outputs[0]}".encode()) + _field(4, kind.encode())
    for name, value in attributes.items():
        if isinstance(value, int):
            body = _field(3, value) + _field(20, 2)  # i, type INT
        else:
            body = b"".join(_field(8, v) for v in value) + _field(20, 7)  # ints, type INTS
        data += _field(5, _field(1, name.encode()) + body)
    return data


def _tensor(name: str, value: np.ndarray) -> bytes:
    data = b"".join(_field(1, side) for side in value.shape)
    data += _field(2, _TYPES[value.dtype]) + _field(8, name.encode())
    return data + _field(9, np.ascontiguousarray(value).tobytes())


def _value_info(name: str, kind: int, shape: Sequence[int | str]) -> bytes:
    sides = b"".join(
        _field(1, _field(1, s) if isinstance(s, int) else _field(2, s.encode())) for s in shape
    )
    tensor = _field(1, kind) + _field(2, sides)
    return _field(1, name.encode()) + _field(2, _field(1, tensor))
