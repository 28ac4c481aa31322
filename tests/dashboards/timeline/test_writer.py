"""The timeline: contents of the file, and the views that a viewer shows."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from rerun.chunk import RrdReader

from dashboards.for_docs.pictures import SHOTS, Shot
from dashboards.for_docs.screenshot import viewer
from dashboards.review.review import Review, write_review
from dashboards.review.viewer import no_driver
from dashboards.timeline.names import entity_part, markdown, path, visible
from dashboards.timeline.scene import Pose
from dashboards.timeline.split import write_timelines
from pipeline.core.config import Config, TimelineConfig, load_config
from pipeline.images.decode import image_size
from pipeline.mcap_file.writer import RecordingWriter, image_message
from pipeline.optics.ground_plane import project_person
from pipeline.run.recording import Timelines
from pipeline.run.recordings import run
from pipeline.store.database import Store
from tests.run.test_recordings import LEVEL, START_NS, jpeg, write_people

# A panel of each tab.
PANELS = {
    "Errors": "^Depth error, %",
    "Exposure": "^Sensitivity, ISO",
    "Worst errors": "^Worst errors$",
    "About": "^About$",
}
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def timeline(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("timeline")
    recording = folder / "people.mcap"
    write_people(recording)
    result = run(
        [recording], folder / "x.duckdb", LEVEL, timelines=Timelines(folder, write_timelines)
    )
    assert result.outcomes[0].timelines == [folder / "people.rrd"]
    return folder / "people.rrd"


def entities(recording: Path) -> dict[str, list]:
    """Return the chunks of a `.rrd` by entity."""
    found: dict[str, list] = {}
    for chunk in RrdReader(recording).stream().to_chunks():
        found.setdefault(str(chunk.entity_path), []).append(chunk.to_record_batch())
    return found


def column(batches: list, ending: str) -> list:
    values = []
    for batch in batches:
        for name in batch.schema.names:
            if name.endswith(ending):
                values += batch.column(name).to_pylist()
    return values


def test_the_pictures_pass_through_as_they_are(timeline: Path) -> None:
    blobs = column(entities(timeline)["/cameras/cam/camera/image"], "EncodedImage:blob")
    assert len(blobs) == 12
    assert all(bytes(blob[0]) == jpeg() for blob in blobs)


def test_boxes_and_curves_are_there_for_every_frame(timeline: Path) -> None:
    found = entities(timeline)
    centres = column(found["/cameras/cam/camera/tracks"], "Boxes2D:centers")
    assert [len(c) for c in centres] == [2] * 12
    labels = column(found["/cameras/cam/camera/labels"], "Boxes2D:labels")
    assert re.match("#0\u00a010\\.\\d+\u00a0±\u00a0", labels[0][0])
    curves = found["/cameras/cam/depth/ground"]
    assert column(curves, "Measurements:names") == [["#0", "#1"]]
    values = [row for row in column(curves, "Measurements:values") if row]
    with Store.open(timeline.with_name("x.duckdb"), read_only=True) as store:
        stored = store.query(
            "SELECT depth_m FROM current_estimates WHERE method = 'ground' "
            "ORDER BY frame_index, track_id"
        )["depth_m"].to_numpy()
    np.testing.assert_allclose(values, stored.reshape(12, 2))


def test_truth_and_text_are_there(timeline: Path) -> None:
    found = entities(timeline)
    assert "/cameras/cam/depth/truth" in found
    text = column(found["/about"], "TextDocument:text")[0][0]
    assert "people" in text
    assert "1.50" in text
    assert timeline.with_suffix(".rbl").stat().st_size > 0
    assert not list(timeline.parent.glob("*.part"))


def test_names_from_files_cannot_reach_other_entities(tmp_path: Path) -> None:
    recording = tmp_path / "evil.mcap"
    name = "../a/b [x](javascript:alert(1)) \x1b[31m"
    with RecordingWriter(recording) as w:
        w.write("/i", image_message(jpeg(), "jpeg", START_NS, name), START_NS)
    run(
        [recording], tmp_path / "x.duckdb", Config(), timelines=Timelines(tmp_path, write_timelines)
    )
    found = entities(tmp_path / "evil.rrd")
    pictures = [e for e in found if e.endswith("/camera/image")]
    assert len(pictures) == 1
    assert pictures[0].count("/") - pictures[0].count(r"\/") == 4
    text = column(found["/about"], "TextDocument:text")[0][0]
    assert "\x1b" not in text
    assert "[x](" not in text


def test_text_from_files_is_no_markdown() -> None:
    assert markdown("a*b_[c](d)") == r"a\*b\_\[c\]\(d\)"
    assert "\n" not in markdown("a\nb")


def test_names_stay_apart_and_can_be_seen() -> None:
    names = ["", "(unnamed)", "a/b", "a\\b", "a\u202eb", "a\nb", "\U0001f600", "a b", "é", "Ω"]
    assert len({entity_part(name) for name in names}) == len(names)
    assert all(visible(name).isprintable() for name in names)
    assert path("a/b", "c").count("/") == 3  # a leading one, an escaped one, a separator


def test_the_scene_agrees_with_the_optics() -> None:
    """A point on the ground, taken into the camera's axes, falls where the optics project it."""
    pose = Pose(5.0, 0.3, 0.05, True)
    foot, _ = project_person(2.0, 15.0, 1.7, 5.0, 0.3, 0.05)
    in_camera = pose.world_from_camera().T @ (np.array([2.0, 15.0, 0.0]) - [0, 0, 5.0])
    np.testing.assert_allclose(in_camera[:2] / in_camera[2], foot, atol=1e-12)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if no_driver():
        pytest.skip(no_driver())
    folder = tmp_path_factory.mktemp("demo")
    config = load_config(ROOT / "recordings" / "cameras.toml")
    recordings = [ROOT / "recordings" / f"{name}.mcap" for name in ("staff", "street", "walkers")]
    run(
        recordings,
        folder / "x.duckdb",
        config,
        timelines=Timelines(folder, write_timelines),
        workers=2,
    )
    return folder


@pytest.mark.viewer
@pytest.mark.slow
@pytest.mark.parametrize("shot", SHOTS, ids=lambda shot: shot.name)
def test_the_viewer_shows_the_demo_recordings(shot: Shot, demo: Path) -> None:
    """No view complains, those behind other tabs included, and none that is in front is empty."""
    with viewer(demo / f"{shot.recording}.rrd") as shown:
        shown.show_frame(shot.frame)
        for tab in shot.tabs:
            shown.show_tab(tab)
        assert shown.reports() == []
        png = shown.picture(without_notices=True)
        panels = {name: shown.panel(name) for name in shown.views()}
    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (1080, 1920, 3)
    in_front = {name: panel for name, panel in panels.items() if panel is not None}
    expected = ["track, depth", "^Scene|^On the ground", "^(Tracks: )?.*When: "]
    expected += [PANELS[tab] for tab in shot.tabs] or ["^Depth, m", "^Height", "^Tracks$"]
    for pattern in expected:
        assert any(re.search(pattern, name) for name in in_front), pattern
    for name, panel in in_front.items():
        image = cv2.imdecode(np.frombuffer(panel, np.uint8), cv2.IMREAD_COLOR)
        below = image[40:]  # the title bar is never empty
        assert below.std() > 4, name


@pytest.mark.viewer
@pytest.mark.slow
def test_the_camera_and_its_picture_lie_on_each_other(demo: Path) -> None:
    """A preview is shrunk together with all that lies over it."""
    with Store.open(demo / "x.duckdb", read_only=True) as store:
        review = Review(["street"], at="#132")
        small = Config(timeline=TimelineConfig(preview_px=384))
        written = write_review(store, review, demo / "small.rrd", small)
    found = entities(written.path)
    blob = column(found["/cameras/street_mast/camera/image"], "EncodedImage:blob")[132][0]
    assert image_size(bytes(blob)) == (384, 288)
    boxes, whole = (
        column(entities(path)["/cameras/street_mast/camera/tracks"], "Boxes2D:centers")
        for path in (written.path, demo / "street.rrd")
    )
    np.testing.assert_allclose(np.array(boxes[130]), np.array(whole[130]) / 2, rtol=1e-6)
