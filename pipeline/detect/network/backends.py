"""A network read from an ONNX file and run: by onnxruntime where it is installed, else by OpenCV."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.errors import UnusableModel, UsageError, Where
from pipeline.core.extras import how_to_install
from pipeline.detect.network.onnx_file import OnnxFile, Tensor

Array = npt.NDArray[np.generic]

# Element types of onnx.proto3 that inputs of detectors have.
DTYPES: dict[int, type[np.generic]] = {
    1: np.float32,
    2: np.uint8,
    6: np.int32,
    7: np.int64,
    9: np.bool_,
    10: np.float16,
    11: np.float64,
}
BACKENDS = ("auto", "onnxruntime", "opencv")


class Backend(Protocol):
    """Runs a network."""

    runs_on_opencv: bool  # with OpenCV's own threads, see `pipeline.parallel.opencv_threads`

    def run(self, inputs: Mapping[str, Array]) -> list[Array]:
        """Return the outputs in the file's order."""


def make_backend(name: str, file: OnnxFile) -> Backend:
    """Load a network.

    Raises:
        UsageError: the backend is unknown or not installed.
        UnusableModel: the backend cannot load the file.
    """
    if name not in BACKENDS:
        raise UsageError(f"unknown backend {name!r}", remedy=f"Known are {', '.join(BACKENDS)}")
    installed = importlib.util.find_spec("onnxruntime") is not None
    if name == "onnxruntime" and not installed:
        raise UsageError(
            "onnxruntime is not installed",
            remedy=how_to_install("onnx"),
        )
    if name == "onnxruntime" or (name == "auto" and installed):
        return OnnxRuntime(file)
    return OpenCv(file)


class OpenCv:
    """OpenCV's own engine, which is always there."""

    runs_on_opencv = True

    def __init__(self, file: OnnxFile) -> None:
        self._path = file.path
        self._outputs = [o.name for o in file.outputs]
        try:
            self._net = cv2.dnn.readNetFromONNX(str(file.path))
        except (cv2.error, MemoryError) as error:
            raise _unloadable(self._path, "OpenCV", error) from error

    def run(self, inputs: Mapping[str, Array]) -> list[Array]:
        """Return the outputs in the file's order."""
        try:
            for name, value in inputs.items():
                self._net.setInput(value, name)
            return [np.asarray(o) for o in self._net.forward(self._outputs)]
        except cv2.error as error:
            raise _failed(self._path, "OpenCV", error) from error


class OnnxRuntime:
    """onnxruntime, which is faster, and uses a graphics card if it was built for one."""

    runs_on_opencv = False

    PREFERRED = ("CUDAExecutionProvider", "CPUExecutionProvider")

    def __init__(self, file: OnnxFile) -> None:
        import onnxruntime

        self._path = file.path
        self._outputs = [o.name for o in file.outputs]
        options = onnxruntime.SessionOptions()
        options.log_severity_level = 3  # errors are raised; warnings tell its developers something
        available = onnxruntime.get_available_providers()
        try:
            self._session: Any = onnxruntime.InferenceSession(
                str(file.path), options, [p for p in self.PREFERRED if p in available]
            )
        except Exception as error:  # its exceptions have no common base
            raise _unloadable(self._path, "onnxruntime", error) from error

    def run(self, inputs: Mapping[str, Array]) -> list[Array]:
        """Return the outputs in the file's order."""
        try:
            return [np.asarray(o) for o in self._session.run(self._outputs, dict(inputs))]
        except Exception as error:  # its exceptions have no common base
            raise _failed(self._path, "onnxruntime", error) from error


def dtype_of(tensor: Tensor, path: Path) -> type[np.generic]:
    """Return what numpy calls an input's elements.

    Raises:
        UnusableModel: pictures and sizes do not come in such elements.
    """
    if tensor.element_type not in DTYPES:
        raise UnusableModel(
            f"its input {tensor.name!r} has elements of ONNX type {tensor.element_type}",
            where=Where(path),
            remedy="Export the model with inputs of 32-bit floats",
        )
    return DTYPES[tensor.element_type]


def _unloadable(path: Path, backend: str, error: BaseException) -> UnusableModel:
    return UnusableModel(
        f"{backend} cannot load the model: {_first_line(error)}",
        where=Where(path),
        remedy="Export it again with opset 17 or older and without quantisation, or use the other "
        "backend (model_backend in the table [detect])",
    )


def _failed(path: Path, backend: str, error: BaseException) -> UnusableModel:
    return UnusableModel(
        f"{backend} cannot run the model: {_first_line(error)}",
        where=Where(path),
        remedy="Check model_input_px in the table [detect], or use the other backend "
        "(model_backend)",
    )


def _first_line(error: BaseException) -> str:
    text = str(getattr(error, "err", "") or error).strip()
    return (text.splitlines() or [type(error).__name__])[0][:200]
