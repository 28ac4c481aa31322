"""People found by a network from an ONNX file, for users who have one.

picture -> input -> network -> boxes by family -> best of each -> stored pixels
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import FloatArray
from pipeline.core.config import CameraConfig, DetectConfig
from pipeline.core.errors import StadimeterError, UnusableModel, UsageError, Where
from pipeline.core.records import Boxes, Expected, Frame
from pipeline.detect.network.backends import Backend, dtype_of, make_backend
from pipeline.detect.network.coco import COCO, COCO_WITH_GAPS
from pipeline.detect.network.families import FAMILIES, class_count_of, recognise
from pipeline.detect.network.input import fill, normalised, place
from pipeline.detect.network.onnx_file import OnnxFile, Tensor, read_onnx_file
from pipeline.detect.network.output import Candidates, decode
from pipeline.detect.network.suppression import suppress
from pipeline.images.decode import Picture

Array = npt.NDArray[np.generic]

# How far a network's edge lies from the body's, one sigma, as a share of the box's height (head and
# feet) and width (sides). Detectors of today overlap with careful boxes by about 0.86 (intersection
# over union); 1 - 2 (0.8 * 0.025 + 0.8 * 0.06) is that, 0.8 sigma being the mean of |normal|.
HEIGHT_SHARE_STD = 0.025
WIDTH_SHARE_STD = 0.06
# The network cannot place an edge better than this in its own, shrunk, pixels.
NETWORK_STD_PX = 0.7
# More boxes than this are not compared with each other; a crowd has some hundred.
MAX_CANDIDATES = 1000
# Inputs that are not fixed by the file are as large as this at most.
MAX_INPUT_PX = 4096
CLASS_LISTS = {"coco": COCO, "coco91": COCO_WITH_GAPS}


class OnnxDetector:
    """Finds objects of the configured classes with a network.

    Raises:
        UsageError: the configuration names no model, or an unknown family or backend.
        UnusableModel: the file is no model, or its outputs are not understood.
    """

    learning_s = 0.0
    full_resolution = True

    def __init__(self, config: DetectConfig, *, every_class: bool = False) -> None:
        """Load a network; with `every_class`, what is not asked for is found beside it."""
        if not config.model:
            raise UsageError(
                "the detector onnx needs a model", remedy="Give an ONNX file with --model FILE"
            )
        if config.model_family not in ("auto", *FAMILIES):
            raise UsageError(
                f"unknown model family {config.model_family!r}",
                remedy=f"Known are auto, {', '.join(FAMILIES)}",
            )
        self._config = config
        self._every_class = every_class
        self._path = Path(config.model)
        try:
            self._load(read_onnx_file(self._path))
        except StadimeterError as error:
            if error.where.path is None:
                raise type(error)(
                    error.problem, where=Where(self._path), remedy=error.remedy
                ) from error
            raise

    def _load(self, file: OnnxFile) -> None:
        self.name = f"onnx:{file.sha256[:12]}"
        self._image, self._sizes, self._masks = _inputs(file)
        self._dtype = dtype_of(self._image, file.path)
        self._channels_last = self._image.shape[3] == 3 and self._image.shape[1] != 3
        self._size = _input_size(file, self._image, self._channels_last, self._config)
        self._backend: Backend = make_backend(self._config.model_backend, file)
        self.runs_on_opencv = self._backend.runs_on_opencv
        # The outputs' shapes, which files often leave open, are seen on a picture of nothing.
        width, height = self._size
        blank = np.zeros((1, 3, height, width), dtype=self._dtype)
        outputs = self._run(blank)
        shapes = [o.shape for o in outputs]
        names = self._config.model_classes or file.class_names()
        if len(names) == 1 and names[0] in CLASS_LISTS:
            names = CLASS_LISTS[names[0]]
        named = len(names) or None
        family = self._config.model_family
        if family == "auto":
            values = [np.asarray(o, dtype=np.float64) for o in outputs]
            family = recognise(shapes, self._size, named, file.metadata, values)
        self._family = FAMILIES[family]
        decode(family, [np.zeros(s) for s in shapes], self._size, named)  # the shapes fit, or not
        self._class_count = class_count_of(family, shapes, self._size, named, file.metadata)
        if not names:
            names = _published_names(family, self._class_count, self._sizes, self._config.classes)
        self._names = tuple(names)
        self._kept = _kept(self._names, self._config.classes)
        if self._every_class:
            self._kept = np.arange(len(self._names))

    def prepared(self, picture: Picture) -> Picture:
        """Return it as it is."""
        return picture

    def learn(self, pictures: Sequence[Picture]) -> None:
        """Learn nothing."""

    def detect(
        self, frame: Frame, picture: Picture | None, expected: Expected | None = None
    ) -> Boxes:
        """Return the objects of the configured classes."""
        if picture is None:
            return Boxes.empty()
        height_px, width_px = picture.bgr.shape[:2]
        placement = place(width_px, height_px, self._size, self._family.fit)
        image = fill(picture.bgr, self._size, placement)
        outputs = self._run(normalised(image, self._family.normalisation, self._dtype))
        found = decode(self._family.name, outputs, self._size, self._class_count)
        found = self._best(found)
        bbox = placement.to_stored(found.bbox)
        limit = np.array([width_px, height_px] * 2) - 0.5
        bbox = np.clip(bbox, -0.5, limit)
        size = bbox[:, 2:] - bbox[:, :2]
        large = (size[:, 1] >= self._config.min_height * height_px) & (size[:, 0] >= 2.0)
        bbox, found = bbox[large], found.take(large)
        return Boxes(
            _stored(bbox, picture),
            np.clip(found.score, 0.0, 1.0),
            tuple(self._names[i] for i in found.class_index),
            _edge_std(bbox, placement.scale) * picture.reduction,
            (None,) * len(bbox),
        )

    def _best(self, found: Candidates) -> Candidates:
        """Return the boxes of the classes that are wanted, each object once."""
        wanted = np.isin(found.class_index, self._kept) & (found.score >= self._config.min_score)
        found = found.take(wanted)
        best = np.argsort(-found.score, kind="stable")[:MAX_CANDIDATES]
        return suppress(found.take(best), self._config.max_overlap)

    def _run(self, planes: Array) -> list[Array]:
        """Run the network on an input (1, 3, h, w), and on whatever else it wants."""
        width, height = self._size
        inputs = {
            self._image.name: np.ascontiguousarray(planes.transpose(0, 2, 3, 1))
            if self._channels_last
            else planes
        }
        for tensor in self._sizes:  # boxes then come in pixels of the input
            inputs[tensor.name] = np.array([[width, height]], dtype_of(tensor, self._path))
        for tensor in self._masks:
            ones = np.ones((1, height, width), dtype_of(tensor, self._path))
            inputs[tensor.name] = ones
        return self._backend.run(inputs)


def _inputs(file: OnnxFile) -> tuple[Tensor, list[Tensor], list[Tensor]]:
    """Return the input for the picture, those for its size, and those for which pixels count."""
    images = [i for i in file.inputs if len(i.shape) == 4]
    sizes = [i for i in file.inputs if len(i.shape) == 2 and i.shape[1] in (2, -1)]
    masks = [i for i in file.inputs if len(i.shape) == 3 and "mask" in i.name]
    if len(images) != 1 or len(images) + len(sizes) + len(masks) != len(file.inputs):
        given = ", ".join(f"{i.name} {i.shape}" for i in file.inputs)
        raise UnusableModel(
            f"a detector takes one picture (1, 3, height, width); this model takes {given}",
            remedy="Give a person detector of a YOLO, RT-DETR or DETR family",
        )
    batch = images[0].shape[0]
    if batch > 1:
        raise UnusableModel(
            f"the model takes {batch} pictures at once",
            remedy="Export it with a batch of 1",
        )
    return images[0], sizes, masks


def _input_size(
    file: OnnxFile, image: Tensor, channels_last: bool, config: DetectConfig
) -> tuple[int, int]:
    """Return width and height of the input: fixed by the file, else asked for, else the usual."""
    height, width = image.shape[1:3] if channels_last else image.shape[2:]
    if config.model_input_px < 0 or config.model_input_px > MAX_INPUT_PX:
        raise UsageError(
            f"model_input_px is {config.model_input_px}",
            remedy=f"Give 32 to {MAX_INPUT_PX}, a multiple of 32, or 0 for the usual size",
        )
    asked = config.model_input_px
    usual = FAMILIES.get(config.model_family, FAMILIES["yolov8"]).input_px
    stated = file.image_size_px() or (usual, usual)
    height = height if height > 0 else asked or stated[0]
    width = width if width > 0 else asked or stated[1]
    if not (32 <= height <= MAX_INPUT_PX and 32 <= width <= MAX_INPUT_PX):
        raise UnusableModel(
            f"the model takes pictures of {width} x {height} pixels",
            remedy=f"Between 32 and {MAX_INPUT_PX} is a detector's",
        )
    return width, height


def _published_names(
    family: str, class_count: int | None, sizes: list[Tensor], wanted: Sequence[str]
) -> tuple[str, ...]:
    """Return the class names of a model that has none: COCO's, if it has as many classes."""
    if family == "end_to_end" or (family == "detections" and sizes):
        return COCO
    if class_count == len(COCO):
        return COCO
    if class_count == len(COCO_WITH_GAPS):
        return COCO_WITH_GAPS
    if class_count == 1 and len(wanted) == 1:
        return tuple(wanted)
    how_many = "an unknown number of" if class_count is None else str(class_count)
    raise UnusableModel(
        f"the model tells {how_many} classes apart, and does not name them",
        remedy="Name them, in order, as model_classes in the table [detect] of the camera file; "
        '["coco"] are the 80 of COCO, ["coco91"] those with their 91 original numbers',
    )


def _kept(names: Sequence[str], wanted: Sequence[str]) -> npt.NDArray[np.intp]:
    """Return the numbers of the classes that are wanted."""
    kept = [i for i, name in enumerate(names) if name in wanted]
    absent = [name for name in wanted if name not in names]
    if absent or not wanted:
        known = ", ".join(repr(n) for n in names if n)
        raise UnusableModel(
            f"the model has no class {absent[0]!r}" if absent else "no class is wanted",
            remedy=f"Set classes in the table [detect] to some of {known[:400]}; or call them by "
            "other names with model_classes",
        )
    return np.array(kept, dtype=np.intp)


def _edge_std(bbox: FloatArray, scale: tuple[float, float]) -> FloatArray:
    """Return one sigma of each edge of boxes (n, 4), in their own pixels."""
    size = bbox[:, 2:] - bbox[:, :2]
    share = np.array([WIDTH_SHARE_STD, HEIGHT_SHARE_STD])
    return np.tile(np.hypot(size * share, NETWORK_STD_PX / np.array(scale)), 2)


def _stored(bbox: FloatArray, picture: Picture) -> FloatArray:
    """Return boxes of the decoded picture in pixels of the stored one."""
    return np.asarray((bbox + 0.5) * picture.reduction - 0.5)


def make(config: DetectConfig, camera: CameraConfig) -> OnnxDetector:
    """Return the detector, for the table `DETECTORS`.

    Raises:
        UsageError: the configuration names no model, or an unknown family or backend.
        UnusableModel: the file is no model, or its outputs are not understood.
    """
    return OnnxDetector(config)
