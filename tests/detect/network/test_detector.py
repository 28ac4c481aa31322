"""The network detector on tiny models whose boxes are known, in the layout of every family."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.config import CameraConfig, DetectConfig, load_config
from pipeline.core.errors import StadimeterError, UnusableModel, UsageError
from pipeline.core.records import Boxes
from pipeline.detect import make_detector
from pipeline.detect.network.coco import COCO, COCO_WITH_GAPS
from pipeline.detect.network.detector import OnnxDetector
from pipeline.detect.network.families import FAMILIES
from pipeline.detect.network.input import Fit, fill, normalised, place
from pipeline.detect.network.onnx_file import read_onnx_file
from pipeline.detect.network.output import Candidates
from pipeline.detect.network.suppression import suppress
from pipeline.images.decode import Picture
from tests.support.footage import frame
from tests.support.onnx_models import UINT8, model

SIDE = 96  # of the networks' inputs: grids of 12 x 12, 6 x 6 and 3 x 3
CELLS = 12**2 + 6**2 + 3**2
WIDTH_PX, HEIGHT_PX = 640, 480
# Two people and a dog, in stored pixels.
PEOPLE = np.array([[100.0, 80.0, 160.0, 260.0], [400.5, 200.0, 470.0, 420.25]])
DOG = np.array([[300.0, 300.0, 360.0, 350.0]])
BOXES = np.concatenate([PEOPLE, DOG])
SCORES = np.array([0.9, 0.75, 0.8])
CLASSES = np.array([COCO.index("person"), COCO.index("person"), COCO.index("dog")])


def picture(width: int = WIDTH_PX, height: int = HEIGHT_PX, level: int = 90) -> Picture:
    return Picture(width, height, np.full((height, width, 3), level, np.uint8), 1, 0.1, 0.0)


def letterboxed(boxes: np.ndarray) -> np.ndarray:
    """640 x 480 in 96 x 96: 0.15 of the size, 72 rows in the middle; edges, not centres."""
    return (boxes + 0.5) * 0.15 + [0, 12, 0, 12]


def cornered(boxes: np.ndarray) -> np.ndarray:
    return (boxes + 0.5) * 0.15


def shares(boxes: np.ndarray) -> np.ndarray:
    return (boxes + 0.5) / [WIDTH_PX, HEIGHT_PX, WIDTH_PX, HEIGHT_PX]


def centred(corners: np.ndarray) -> np.ndarray:
    middle, size = (corners[:, :2] + corners[:, 2:]) / 2, corners[:, 2:] - corners[:, :2]
    return np.concatenate([middle, size], axis=1)


def rows_of(count: int, columns: int) -> np.ndarray:
    """Return rows of boxes without a score, somewhere."""
    rows = np.zeros((count, columns))
    rows[:, :4] = [20, 20, 5, 9]
    return rows


# The cells, in the order of the grids, into which the three objects are put.
SLOTS = np.array([40, 150, 185])


def yolov5(count: int = 3 * CELLS) -> dict[str, np.ndarray]:
    rows = rows_of(count, 85)
    rows[SLOTS, :4] = centred(letterboxed(BOXES))
    rows[SLOTS, 4] = 0.95
    rows[SLOTS, 5 + CLASSES] = SCORES / 0.95
    return {"output": rows[None]}


def yolov8() -> dict[str, np.ndarray]:
    rows = rows_of(CELLS, 84)
    rows[SLOTS, :4] = centred(letterboxed(BOXES))
    rows[SLOTS, 4 + CLASSES] = SCORES
    return {"output0": rows.T[None]}


def yolox() -> dict[str, np.ndarray]:
    """Cell 40 is column 4 of row 3 (stride 8); 150 is 0 of 1 (16); 185 is 2 of 1 (32)."""
    rows = rows_of(CELLS, 85)
    cell = np.array([[4, 3], [0, 1], [2, 1]])
    stride = np.array([[8.0], [16.0], [32.0]])
    boxes = centred(cornered(BOXES))
    rows[SLOTS, :2] = boxes[:, :2] / stride - cell
    rows[:, 2:4] = 0.0
    rows[SLOTS, 2:4] = np.log(boxes[:, 2:] / stride)
    rows[SLOTS, 4] = 1.0
    rows[SLOTS, 5 + CLASSES] = SCORES
    return {"output": rows[None]}


def end_to_end() -> dict[str, np.ndarray]:
    rows = np.zeros((300, 6))
    rows[:3] = np.column_stack([letterboxed(BOXES), SCORES, CLASSES])
    return {"output0": rows[None]}


def _logit(p: np.ndarray) -> np.ndarray:
    return np.log(p / (1 - p))


def rtdetr() -> dict[str, np.ndarray]:
    logits, boxes = np.full((300, 80), -9.0), np.full((300, 4), 0.5)
    logits[np.arange(3), CLASSES] = _logit(SCORES)
    boxes[:3] = centred(shares(BOXES))
    return {"logits": logits[None], "pred_boxes": boxes[None]}


def rtdetr_ultralytics() -> dict[str, np.ndarray]:
    rows = np.zeros((300, 84))
    rows[:3, :4] = centred(shares(BOXES))
    rows[np.arange(3), 4 + CLASSES] = SCORES
    return {"output0": rows[None]}


def rfdetr() -> dict[str, np.ndarray]:
    logits, boxes = np.full((200, 91), -9.0), np.full((200, 4), 0.5)
    with_gaps = [COCO_WITH_GAPS.index(COCO[c]) for c in CLASSES]
    logits[np.arange(3), with_gaps] = _logit(SCORES)
    boxes[:3] = centred(shares(BOXES))
    return {"dets": boxes[None], "labels": logits[None]}


def detr() -> dict[str, np.ndarray]:
    """Softmax: the score of a class against "nothing", all others far below."""
    logits, boxes = np.full((100, 92), -30.0), np.full((100, 4), 0.5)
    with_gaps = [COCO_WITH_GAPS.index(COCO[c]) for c in CLASSES]
    logits[:, -1] = 0.0
    logits[np.arange(3), with_gaps] = _logit(SCORES)
    boxes[:3] = centred(shares(BOXES))
    return {"logits": logits[None], "pred_boxes": boxes[None]}


def detections() -> dict[str, np.ndarray]:
    """Boxes as shares here; the model multiplies them by the size that it is given."""
    return {
        "labels": CLASSES[None].astype(np.int64),
        "boxes": shares(BOXES)[None],
        "scores": SCORES[None],
    }


def torchvision() -> dict[str, np.ndarray]:
    """No batch; boxes in pixels of the input, which is the picture stretched."""
    labels = np.array([COCO_WITH_GAPS.index(COCO[c]) for c in CLASSES], np.int64)
    return {"boxes": shares(BOXES) * SIDE, "labels": labels, "scores": SCORES}


def write(path: Path, outputs: dict[str, np.ndarray], **options: object) -> DetectConfig:
    narrow = {
        name: value if value.dtype == np.int64 else value.astype(np.float32)
        for name, value in outputs.items()
    }
    options = {"image_shape": (1, 3, SIDE, SIDE)} | options
    path.write_bytes(model(narrow, **options))  # type: ignore[arg-type]
    return DetectConfig(method="onnx", model=str(path), model_backend="opencv")


LAYOUTS: dict[str, tuple[Callable[[], dict[str, np.ndarray]], dict[str, object], dict]] = {
    "yolov5": (yolov5, {}, {}),
    "yolov8": (yolov8, {}, {}),
    "yolov8 transposed": (lambda: {"o": yolov8()["output0"].swapaxes(1, 2)}, {}, {}),
    "yolov6, named": (lambda: yolov5(CELLS), {}, {"model_family": "yolov5"}),
    "yolox, named": (yolox, {}, {"model_family": "yolox"}),
    "end to end": (end_to_end, {}, {}),
    "rtdetr": (rtdetr, {}, {}),
    "rtdetr, ultralytics": (rtdetr_ultralytics, {}, {}),
    "rfdetr": (rfdetr, {}, {}),
    "detr": (detr, {}, {}),
    "rtdetr, decoded": (detections, {"sizes_input": True}, {}),
    "torchvision, named": (torchvision, {}, {"model_classes": ("coco91",)}),
    "shapes left open": (yolov8, {"declare_shapes": False}, {}),
    "any size": (yolov8, {"image_shape": (1, 3, "h", "w")}, {"model_input_px": SIDE}),
    "size in metadata": (
        yolov8,
        {"image_shape": (1, 3, "h", "w"), "metadata": {"imgsz": f"[{SIDE}, {SIDE}]"}},
        {},
    ),
    "channels last": (yolov8, {"image_shape": (1, SIDE, SIDE, 3)}, {}),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_people_are_where_the_network_says_in_stored_pixels(layout: str, tmp_path: Path) -> None:
    outputs, options, settings = LAYOUTS[layout]
    config = replace(write(tmp_path / "x.onnx", outputs(), **options), **settings)
    found = OnnxDetector(config).detect(frame(0), picture())
    assert found.class_name == ("person", "person")
    assert found.bbox_xyxy_px == pytest.approx(PEOPLE, abs=0.01)
    assert found.score == pytest.approx(SCORES[:2], abs=1e-4)
    assert (found.std_px > 0.5).all()


def test_the_class_and_the_score_decide(tmp_path: Path) -> None:
    config = write(tmp_path / "x.onnx", yolov8())
    both = OnnxDetector(replace(config, classes=("person", "dog"))).detect(frame(0), picture())
    assert both.class_name == ("person", "dog", "person")  # the best first
    assert both.bbox_xyxy_px[1] == pytest.approx(DOG[0], abs=0.01)
    best = OnnxDetector(replace(config, min_score=0.85)).detect(frame(0), picture())
    assert best.score == pytest.approx([0.9], abs=1e-4)


def test_names_come_from_the_metadata(tmp_path: Path) -> None:
    rows = rows_of(CELLS, 6)
    rows[SLOTS, :4] = centred(letterboxed(BOXES))
    rows[SLOTS, 4 + np.array([1, 1, 0])] = SCORES
    config = write(
        tmp_path / "x.onnx",
        {"output0": rows.T[None]},
        metadata={"names": "{0: 'head', 1: 'person'}", "task": "detect"},
    )
    found = OnnxDetector(config).detect(frame(0), picture())
    assert found.bbox_xyxy_px == pytest.approx(PEOPLE, abs=0.01)
    with pytest.raises(UnusableModel, match=r"no class 'walker'.*'head', 'person'"):
        OnnxDetector(replace(config, classes=("walker",)))
    renamed = replace(config, model_classes=("bust", "walker"), classes=("walker",))
    assert OnnxDetector(renamed).detect(frame(0), picture()).class_name == ("walker", "walker")
    with pytest.raises(UnusableModel, match="tells 2 classes apart, but 3 are named"):
        OnnxDetector(replace(config, model_classes=("a", "person", "c")))


def test_masks_and_joints_that_follow_the_classes_are_no_classes(tmp_path: Path) -> None:
    boxes = yolov8()["output0"]
    masks = np.full((1, 32, CELLS), 7.0)
    segmentation = {
        "output0": np.concatenate([boxes, masks], axis=1),
        "output1": np.ones((1, 32, 24, 24)),
    }
    config = write(tmp_path / "x.onnx", segmentation)
    found = OnnxDetector(config).detect(frame(0), picture())
    assert found.bbox_xyxy_px == pytest.approx(PEOPLE, abs=0.01)
    joints = np.concatenate([boxes[:, :5], np.full((1, 51, CELLS), 30.0)], axis=1)
    config = write(tmp_path / "y.onnx", {"output0": joints})
    found = OnnxDetector(config).detect(frame(0), picture())
    assert found.bbox_xyxy_px == pytest.approx(PEOPLE, abs=0.01)


@pytest.mark.parametrize("options", [{}, {"image_shape": (1, SIDE, SIDE, 3)}])
def test_the_network_sees_red_first_and_levels_from_0_to_1(
    options: dict[str, object], tmp_path: Path
) -> None:
    """The model's three scores are the means of the planes that it is given."""
    rows = rows_of(CELLS, 7)[None]
    names = {"names": "{0: 'red', 1: 'green', 2: 'blue'}"}
    config = write(
        tmp_path / "x.onnx", {"o": rows}, scores_from_colour=True, metadata=names, **options
    )
    detector = OnnxDetector(replace(config, classes=("red", "green", "blue")))
    square = picture(SIDE, SIDE)
    for channel, name in enumerate(("blue", "green", "red")):
        square.bgr[:] = 10
        square.bgr[..., channel] = 200
        found = detector.detect(frame(0), square)
        assert found.class_name == (name,)
        assert found.score == pytest.approx([200 / 255], abs=1e-4)


def test_a_network_of_whole_numbers_gets_the_levels_as_they_are(tmp_path: Path) -> None:
    rows = rows_of(CELLS, 7)[None]
    rows[..., 4:] = -199.25  # one level makes a difference of one
    config = write(
        tmp_path / "x.onnx",
        {"o": rows},
        scores_from_colour=True,
        image_type=UINT8,
        metadata={"names": "['a', 'person', 'c']"},
    )
    square = picture(SIDE, SIDE, level=10)
    square.bgr[..., 1] = 200
    found = OnnxDetector(config).detect(frame(0), square)
    assert found.score == pytest.approx([0.75], abs=1e-4)


@pytest.mark.parametrize(
    ("family", "expected"),
    [
        ("yolov5", [200 / 255, 100 / 255, 10 / 255]),
        ("rtdetr", [200 / 255, 100 / 255, 10 / 255]),
        # as in the papers' code: ImageNet's means and standard deviations
        ("detr", [1.3070, -0.2846, -1.6300]),
        ("yolox", [10.0, 100.0, 200.0]),
    ],
)
def test_levels_by_family(family: str, expected: list[float]) -> None:
    image = np.full((4, 6, 3), (10, 100, 200), np.uint8)
    planes = normalised(image, FAMILIES[family].normalisation, np.float32)
    assert planes.shape == (1, 3, 4, 6)
    assert planes[0, :, 2, 3] == pytest.approx(expected, abs=1e-3)


SIDES = st.integers(40, 3000)


@given(SIDES, SIDES, st.sampled_from(list(Fit)), st.sampled_from([(640, 640), (416, 256)]))
def test_boxes_go_to_the_network_and_back(
    width: int, height: int, fit: Fit, size: tuple[int, int]
) -> None:
    placement = place(width, height, size, fit)
    boxes = np.array([[-0.5, -0.5, width - 0.5, height - 0.5], [3.25, 5.0, 30.0, 33.3]])
    there = placement.to_network(boxes)
    assert placement.to_stored(there) == pytest.approx(boxes, abs=1e-6)
    # The whole picture lies inside the input, and fills one of its sides at least.
    assert (there[0] >= -1e-6).all()
    assert (there[0] <= np.array([*size, *size]) + 1e-6).all()
    assert np.isclose(there[0, 2:] - there[0, :2], size).any()
    shape = (there[0, 2:] - there[0, :2]) / [width, height]
    if fit is not Fit.STRETCH:
        assert np.abs(shape[0] / shape[1] - 1) < 1 / min(there[0, 2:] - there[0, :2])


@pytest.mark.parametrize("fit", list(Fit))
@pytest.mark.parametrize("shape", [(480, 640), (720, 333), (96, 96), (50, 70)])
def test_what_is_painted_lands_where_the_placement_says(fit: Fit, shape: tuple[int, int]) -> None:
    """Compared with the picture itself: a white block's edges, at half of its level."""
    height, width = shape
    image = np.zeros((height, width, 3), np.uint8)
    block = np.array([[0.3 * width, 0.25 * height, 0.6 * width, 0.7 * height]]).round() - 0.5
    x0, y0, x1, y1 = (block[0] + 0.5).astype(int)
    image[y0:y1, x0:x1] = 255
    placement = place(width, height, (160, 128), fit)
    filled = fill(image, (160, 128), placement)
    assert filled.shape == (128, 160, 3)
    white = filled[..., 0] / 255.0
    found = placement.to_network(block)[0]
    middle_row, middle_column = int((found[1] + found[3]) / 2), int((found[0] + found[2]) / 2)
    across = np.flatnonzero(white[middle_row] > 0.5)
    along = np.flatnonzero(white[:, middle_column] > 0.5)
    seen = [across[0], along[0], across[-1] + 1, along[-1] + 1]
    assert found == pytest.approx(seen, abs=0.75)


@given(st.integers(0, 10_000), st.floats(0.2, 0.9))
def test_suppression_agrees_with_opencvs(seed: int, limit: float) -> None:
    random = np.random.default_rng(seed)
    low = random.uniform(0, 60, (40, 2))
    boxes = np.concatenate([low, low + random.uniform(5, 40, (40, 2))], axis=1)
    scores = random.permutation(40) / 40 + 0.01
    found = suppress(Candidates(boxes, scores, np.zeros(40, np.intp)), limit)
    sides = np.concatenate([boxes[:, :2], boxes[:, 2:] - boxes[:, :2]], axis=1)
    kept = cv2.dnn.NMSBoxes(sides.tolist(), scores.tolist(), 0.0, limit)
    assert sorted(found.score) == pytest.approx(sorted(scores[np.array(kept).ravel()]))
    apart = suppress(Candidates(boxes, scores, np.arange(40)), limit)
    assert len(apart.score) == 40


def test_a_person_found_twice_is_one_person(tmp_path: Path) -> None:
    outputs = yolov8()
    again = np.repeat(outputs["output0"][:, :, SLOTS[:1]], 2, axis=2)
    again[:, :4] += 0.8  # of 33 pixels
    again[:, 4] = [0.6, 0.5]
    outputs["output0"][:, :, [7, 60]] = again
    found = OnnxDetector(write(tmp_path / "x.onnx", outputs)).detect(frame(0), picture())
    assert found.score == pytest.approx(SCORES[:2], abs=1e-4)


def test_what_is_no_box_is_left_out(tmp_path: Path) -> None:
    """Numbers that are none, boxes inside out, and boxes that leave the picture."""
    outputs = end_to_end()
    rows = outputs["output0"][0]
    rows[3] = [np.nan, 20, 30, 40, 0.9, 0]
    rows[4] = [40, 60, 30, 20, 0.9, 0]
    rows[5] = [5, 20, 12, 40, np.inf, 0]
    rows[6] = [5, 20, 12, 40, 0.9, 99]
    rows[7] = [70, 30, 200, 90, 0.8, 0]
    found = OnnxDetector(write(tmp_path / "x.onnx", outputs)).detect(frame(0), picture())
    assert len(found) == 3
    assert found.bbox_xyxy_px.max() == WIDTH_PX - 0.5
    assert found.bbox_xyxy_px[:, 3].max() == HEIGHT_PX - 0.5
    assert len(OnnxDetector(write(tmp_path / "x.onnx", outputs)).detect(frame(0), None)) == 0


def torn(path: Path, share: float = 0.5) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"PK\x03\x04" + bytes(100), "PyTorch checkpoint.*Export it"),
        (b"version https://git-lfs.github.com/spec/v1\noid", "git lfs pull"),
        (b"<!DOCTYPE html><html></html>", "web page"),
        (b"\x89MCAP0\r\n", "a recording"),
        (bytes(range(256)) * 4, "no ONNX model"),
    ],
)
def test_a_file_that_is_no_model_is_named_for_what_it_is(
    content: bytes, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "x.onnx"
    path.write_bytes(content)
    with pytest.raises(UnusableModel, match=words) as caught:
        OnnxDetector(DetectConfig(method="onnx", model=str(path)))
    assert str(path) in str(caught.value)


@given(st.binary(max_size=200), st.integers(0, 1500))
def test_no_file_breaks_the_reading(
    tmp_path_factory: pytest.TempPathFactory, noise: bytes, at: int
) -> None:
    good = model({"o": np.zeros((1, 2, 6), np.float32)}, metadata={"names": "{0: 'person'}"})
    path = tmp_path_factory.mktemp("noise") / "x.onnx"
    for content in (noise, good[:at], good[:at] + noise + good[at + len(noise) :]):
        path.write_bytes(content)
        try:
            read_onnx_file(path).class_names()
        except UnusableModel as error:
            assert error.remedy  # noqa: PT017


@pytest.mark.parametrize(
    ("outputs", "options", "settings", "words"),
    [
        # YOLOX and YOLOv6 look the same, and want different pictures
        (yolox(), {}, {}, "yolox or yolox_decoded or yolov5.*--model-family"),
        (yolov8(), {}, {"model_family": "yolov9000"}, "unknown model family"),
        (end_to_end(), {}, {"model_family": "detr"}, "not those of the family 'detr'"),
        ({"o": np.zeros((1, 1000))}, {}, {}, "outputs are"),
        ({"o": np.zeros((1, 77, 9))}, {}, {}, "outputs are"),
        (torchvision(), {}, {}, "does not name them.*model_classes"),
        (yolov8(), {"metadata": {"names": "open('x')"}}, {}, "class names"),
        (yolov8(), {"metadata": {"names": "[" * 5000}}, {}, "class names"),
        (yolov8(), {"metadata": {"task": "obb"}}, {}, "another task"),
        (yolov8(), {"image_shape": (4, 3, SIDE, SIDE)}, {}, "batch"),
        (yolov8(), {"image_shape": (1, 3, 99999, 99999)}, {}, "99999"),
        (yolov8(), {"image_shape": (1, 3, "h", "w")}, {"model_input_px": 10**9}, "model_input_px"),
        (yolov8(), {}, {"classes": ()}, "no class is wanted"),
        (yolov8(), {}, {"classes": ("persn",)}, "no class 'persn'.*'person'"),
        (yolov8(), {}, {"model_backend": "tensorrt"}, "unknown backend"),
    ],
)
def test_a_model_that_is_not_understood_is_refused_with_a_remedy(
    outputs: dict[str, np.ndarray],
    options: dict[str, object],
    settings: dict[str, object],
    words: str,
    tmp_path: Path,
) -> None:
    config = replace(write(tmp_path / "x.onnx", outputs, **options), **settings)
    with pytest.raises(UsageError, match=f"(?s){words}") as caught:
        OnnxDetector(config)
    assert caught.value.remedy


def test_a_model_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    config = write(tmp_path / "x.onnx", yolov8())
    for share in (0.999, 0.5, 0.01):
        torn(Path(config.model), share)
        with pytest.raises(UnusableModel):
            OnnxDetector(config)
    with pytest.raises(UnusableModel, match="cannot read the model"):
        OnnxDetector(replace(config, model=str(tmp_path / "absent.onnx")))
    with pytest.raises(UsageError, match="--model FILE"):
        make_detector(DetectConfig(method="onnx"), CameraConfig("c"), recorded=False)


def test_the_detector_is_named_after_the_models_content(tmp_path: Path) -> None:
    first = OnnxDetector(write(tmp_path / "a.onnx", yolov8())).name
    assert first.startswith("onnx:")
    assert OnnxDetector(write(tmp_path / "b.onnx", yolov8())).name == first
    assert OnnxDetector(write(tmp_path / "c.onnx", end_to_end())).name != first


def test_the_camera_file_names_the_model_relative_to_itself(tmp_path: Path) -> None:
    write(tmp_path / "x.onnx", yolov8())
    (tmp_path / "camera.toml").write_text('[detect]\nmethod = "onnx"\nmodel = "x.onnx"\n')
    config = load_config(tmp_path / "camera.toml")
    detector = make_detector(config.detect, CameraConfig("c"), recorded=True)
    assert len(detector.detect(frame(0), picture())) == 2


def test_onnxruntime_gives_the_same_or_says_that_it_is_missing(tmp_path: Path) -> None:
    for layout in (yolov8, detections):
        config = write(tmp_path / "x.onnx", layout(), sizes_input=layout is detections)
        wanted = replace(config, model_backend="onnxruntime")
        if importlib.util.find_spec("onnxruntime") is None:
            with pytest.raises(StadimeterError, match="extra `onnx`"):
                OnnxDetector(wanted)
            continue
        found: list[Boxes] = [OnnxDetector(c).detect(frame(0), picture()) for c in (config, wanted)]
        assert found[0].bbox_xyxy_px == pytest.approx(found[1].bbox_xyxy_px, abs=1e-3)
        assert found[0].score == pytest.approx(found[1].score, abs=1e-5)
