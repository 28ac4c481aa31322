"""The statement: what it says, as numbers of the database, and that a browser shows it at every width."""

from __future__ import annotations

import html
import re
import shutil
import subprocess
from pathlib import Path

import pytest

import stadimeter
from pipeline.cli import main
from pipeline.core.config import CameraConfig, Config
from pipeline.core.errors import UsageError
from pipeline.statement.evidence import find_subject, read_evidence
from pipeline.statement.sensitivity import sensitivities
from pipeline.store.database import Store
from tests.run.test_recordings import CAMERA, write_people

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
POSE = CameraConfig(
    CAMERA,
    camera_height_m=1.5,
    camera_height_std_m=0.03,
    tilt_deg=0.0,
    tilt_std_deg=0.2,
)


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("statement")
    write_people(folder / "people.mcap")
    stadimeter.measure(
        folder / "people.mcap", folder / "x.duckdb", camera=Config(camera=(POSE,)), strict=False
    )
    return folder / "x.duckdb"


def page_of(database: Path, track: int, **asked: object) -> str:
    target = database.with_name("statement.html")
    stadimeter.statement(database, track, target, **asked)  # type: ignore[arg-type]
    return target.read_text(encoding="utf-8")


def text_of(page: str) -> str:
    body = page[page.index("<body>") :]
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]*>", " ", body)))


def row(database: Path, sql: str) -> dict[str, object]:
    with stadimeter.open(database) as results:
        found: dict[str, object] = results.query(sql).rows()[0]
    return found


def test_it_says_what_the_database_says(database: Path) -> None:
    text = text_of(page_of(database, 1))
    stored = row(database, "SELECT * FROM people WHERE track_id = 1")
    file = row(database, "FROM recordings")
    assert f"Height {stored['height_m']:.2f} m" in text
    assert f"between {stored['height_low_m']:.2f} and {stored['height_high_m']:.2f} m" in text
    assert str(file["content_sha256"]) in text
    assert str(file["tables_sha256"]) in text
    assert "hashed again now: unchanged" in text
    assert "12 frames" in text
    assert "stadimeter run people.mcap" in text
    for heading in ("Question", "Items examined", "Pictures", "Parts of the uncertainty", "Limits"):
        assert heading in text
    assert page_of(database, 1).count("data:image/jpeg") == 4


def test_the_pictures_may_be_gone_and_it_says_so(database: Path, tmp_path: Path) -> None:
    copy = tmp_path / "x.duckdb"
    shutil.copy(database, copy)
    source = database.with_name("people.mcap")
    source.rename(source.with_suffix(".away"))
    try:
        page = page_of(copy, 0)
    finally:
        source.with_suffix(".away").rename(source)
    assert "data:image" not in page
    assert "not there now" in page


def test_a_stated_stature_gets_its_weight(database: Path) -> None:
    near = text_of(page_of(database, 1, reference_height_m=1.8))
    far = text_of(page_of(database, 1, reference_height_m=1.5))
    assert "support for a person of this stature" in near
    assert "support for another person" in far
    assert "no probability that they are one person" in near


def test_marks_count_instead_of_boxes(database: Path, tmp_path: Path) -> None:
    marks = tmp_path / "marks.csv"
    bottom, top = 119.5 + 400 * 1.5 / 10, 119.5 - 400 * 0.3 / 10
    rows = [f"{i},170,{top + d},170,{bottom},A,{d}" for i in range(3) for d in (-1, 0, 1)]
    marks.write_text("frame,head_x,head_y,foot_x,foot_y,by,repeat\n" + "\n".join(rows) + "\n")
    text = text_of(page_of(database, 1, marks=marks))
    assert "Height 1.80 m" in text
    assert "by marks that A set" in text
    assert "9 times in 3 frames" in text


def test_sensitivities_are_what_another_estimate_gives(database: Path) -> None:
    with Store.open_current(database) as store:
        evidence = read_evidence(store, find_subject(store, 1))
        changes = {c.assumption: c for c in sensitivities(store, evidence)}
        height_m = evidence.height["height_m"] if evidence.height else 0.0
    higher = changes["height of the camera alone"]
    assert higher.height_change_m == pytest.approx(height_m * 0.03 / 1.5, rel=0.15)
    assert changes["heads (upper ends of boxes)"].height_change_m == pytest.approx(
        10 / 400, rel=0.15
    )
    # A level camera: lower feet are nearer, so the person is smaller by less than the pixel adds.
    feet = changes["feet (lower ends of boxes)"].height_change_m
    assert feet == pytest.approx(1.5 * 72 / 61 - 1.8 + 1.5 / 61, abs=0.02)


@pytest.mark.parametrize(
    ("track", "asked", "problem"),
    [
        (99, {}, "there is no track 99"),
        (0, {"against": 0}, "compared with itself"),
        (0, {"against": 98}, "no heights of one camera"),
        (0, {"reference_height_m": 17.0}, "at least 0.5"),
        (0, {"recording": "other.mcap"}, "there is no track 0 of other.mcap"),
        (0, {"camera": "other"}, "there is no track 0"),
    ],
)
def test_what_cannot_be_stated_is_refused(
    database: Path, track: int, asked: dict[str, object], problem: str
) -> None:
    with pytest.raises(UsageError, match=problem):
        page_of(database, track, **asked)


def test_the_command_writes_both_pages(database: Path, tmp_path: Path) -> None:
    sheet, marks = tmp_path / "s.html", tmp_path / "m.html"
    asked = ["statement", "--db", str(database), "--track", "1"]
    assert main([*asked, "-o", str(sheet)]) == 0
    assert main([*asked, "--marks-page", str(marks)]) == 0
    assert sheet.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert marks.read_text(encoding="utf-8").count("<canvas") == 5


@pytest.mark.browser
@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 820, 1280])
def test_it_fits_into_every_width(database: Path, tmp_path: Path, width: int) -> None:
    if CHROMIUM is None:
        pytest.skip("no Chromium")
    page = page_of(database, 1, reference_height_m=1.8)
    measuring = (
        f'<iframe id="f" width="{width}" height="900" srcdoc="{html.escape(page)}"></iframe>'
        '<script>onload = () => { const d = document.getElementById("f").contentDocument;'
        " document.title = d.documentElement.scrollWidth + ' ' + "
        'd.querySelectorAll("h2").length; document.body.append(document.title); }</script>'
    )
    outer = tmp_path / "outer.html"
    outer.write_text(f"<html><body>{measuring}</body></html>", encoding="utf-8")
    found = subprocess.run(
        [
            CHROMIUM,
            *("--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"),
            *(f"--user-data-dir={tmp_path / 'profile'}", f"--window-size={width + 40},1000"),
            outer.as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    ).stdout
    title = re.search(r"<title>(\d+) (\d+)</title>", found)
    assert title is not None
    assert int(title[1]) <= width
    assert int(title[2]) == 11


def test_a_distance_without_a_pose_is_stated_and_no_height(tmp_path: Path) -> None:
    write_people(tmp_path / "people.mcap")
    stadimeter.measure(tmp_path / "people.mcap", tmp_path / "x.duckdb", strict=False)
    text = text_of(page_of(tmp_path / "x.duckdb", 1))
    assert "No height was measured" in text
    assert "Distance along the camera's axis" in text
    assert "an assumption is no measurement" in text
    with pytest.raises(UsageError, match="no height was measured"):
        page_of(tmp_path / "x.duckdb", 1, reference_height_m=1.8)
