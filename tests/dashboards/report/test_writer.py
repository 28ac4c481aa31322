"""The report: its contents, that it needs no other file, and that a browser draws it."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from dashboards.report.charts import errors_chart, heights_chart
from dashboards.report.data import read_report_data, rounded
from dashboards.report.writer import (
    embedded,
    interval,
    metres,
    number,
    percent,
    shown,
    write_report,
)
from pipeline.cli import main
from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError, StoreError
from pipeline.mcap_file.writer import RecordingWriter, image_message
from pipeline.run.recordings import run
from pipeline.store.database import Store
from tests.run.test_recordings import LEVEL, START_NS, jpeg, write_people

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
EVIL = '</script><img src=x onerror="document.title=1"> \u202e{{7*7}}'


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two people with truth, and a recording whose camera has a hostile name."""
    folder = tmp_path_factory.mktemp("report")
    write_people(folder / "people.mcap")
    with RecordingWriter(folder / "evil.mcap") as w:
        w.write("/i", image_message(jpeg(), "jpeg", START_NS, EVIL), START_NS)
    path = folder / "x.duckdb"
    run([folder / "people.mcap", folder / "evil.mcap"], path, LEVEL, label="a & b")
    return path


@pytest.fixture(scope="module")
def page(database: Path) -> str:
    target = database.with_name("report.html")
    write_report(database, target)
    assert not list(target.parent.glob("*.part"))
    return target.read_text(encoding="utf-8")


def own(page: str) -> str:
    """Return the page without the charting library."""
    start = page.index("<script>const") if "<script>const" in page else page.index("<script>")
    return page[:start] + page[page.index("</script>", start) :]


def test_the_headline_is_what_the_database_says(database: Path, page: str) -> None:
    with Store.open(database, read_only=True) as store:
        [ground] = store.query("FROM accuracy.by_method WHERE method = 'ground'").to_pylist()
    row = re.search(r"<tr><td>cam</td><td>ground</td>.*?</tr>", page, re.DOTALL)
    assert row is not None
    cells = re.findall(r"<td[^>]*>(.*?)</td>", row[0], re.DOTALL)
    assert cells[2] == str(ground["depth_count"])
    assert cells[4].startswith(metres(ground["depth_rmse_m"]))
    assert cells[-1] == metres(ground["height_mae_m"])


def test_the_command_writes_it(database: Path, tmp_path: Path) -> None:
    target = tmp_path / "new" / "r.html"
    assert main(["report", "--db", str(database), "-o", str(target)]) == 0
    assert "Distances and heights" in target.read_text(encoding="utf-8")


def test_every_part_is_there(page: str) -> None:
    ids = set(re.findall(r'<section id="(\w+)"', page))
    assert ids >= {
        "people",
        "accuracy",
        "errors",
        "conditions",
        "coverage",
        "worst",
        "heights",
        "ground",
    }
    assert ids >= {"exposure", "diagnostics", "provenance"}
    assert set(re.findall(r'href="#(\w+)"', page)) <= ids


def test_it_loads_nothing(page: str) -> None:
    assert "default-src 'none'" in page
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", own(page))


def test_text_from_files_stays_text(page: str) -> None:
    assert set(re.findall(r'<img src="?([^,]*)', own(page))) <= {"data:image/jpeg;base64"}
    assert "\u202e" not in page
    assert "&lt;/script&gt;&lt;img" in page
    assert "{{7*7}}" in page  # not 49
    assert "a &amp; b" in page


def test_a_database_without_truth_says_so(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "plain.mcap") as w:
        w.write("/i", image_message(jpeg(), "jpeg", START_NS, "cam"), START_NS)
    run([tmp_path / "plain.mcap"], tmp_path / "x.duckdb", Config())
    write_report(tmp_path / "x.duckdb", tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "does not show how accurate" in text
    assert 'id="errors"' not in text


def test_what_cannot_be_written_is_said(database: Path, tmp_path: Path) -> None:
    with pytest.raises(StoreError):
        write_report(tmp_path / "none.duckdb", tmp_path / "report.html")
    (tmp_path / "file").write_text("")
    with pytest.raises(StadimeterError, match="cannot be written"):
        write_report(database, tmp_path / "file" / "report.html")


def test_samples_are_bounded_and_repeat(database: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dashboards.report.data.POINTS_A_METHOD", 6)
    with Store.open(database, read_only=True) as store:
        one, other = read_report_data(store), read_report_data(store)
    assert one.errors == other.errors
    assert 0 < len(one.errors) < one.error_count == 24


def test_the_report_says_what_the_views_say(database: Path) -> None:
    views = {
        "by_method": "FROM accuracy.by_method",
        "by_range": "FROM accuracy.by_range WHERE depth_count > 0",
        "by_aperture": "FROM accuracy.by_aperture WHERE depth_count > 0",
        "heights_by_method": "FROM accuracy.height_by_method",
        "coverage": "FROM accuracy.coverage",
    }
    with Store.open(database, read_only=True) as store:
        data = read_report_data(store)
        for name, sql in views.items():
            expected = store.query(sql).to_pylist()
            if name == "by_method":
                expected.sort(key=lambda r: (r["depth_rmse_m"], r["method"]))
            assert expected
            found = [{c: r[c] for c in expected[0]} for r in getattr(data, name)]
            assert len(found) == len(expected)
            for row, other in zip(found, expected, strict=True):
                for column, value in other.items():
                    close = isinstance(value, float)
                    wanted = pytest.approx(value, rel=1e-9, abs=1e-12) if close else value
                    assert row[column] == wanted, (name, column)


def test_numbers_are_written_plainly() -> None:
    assert (metres(1.23456), metres(23.456), metres(None)) == ("1.235", "23.46", "")
    assert metres(float("nan")) == ""
    assert interval(0.1, 0.2) == "0.100 to 0.200"
    assert interval(None, 0.2) == ""
    assert (number(12345), number(0.012345), number(float("inf"))) == ("12,345", "0.0123", "")
    assert percent(0.954, 1) == "95.4 %"
    assert shown("a\x1b[31m\u202eb") == "a\\x1b[31m\\u202eb"
    assert rounded([{"a": 1.23456789, "b": float("nan"), "c": "x"}]) == [
        {"a": 1.2346, "b": None, "c": "x"}
    ]


def test_a_chart_cannot_end_its_script() -> None:
    text = embedded({"a": "</script><b>\u2028"})
    assert "<" not in text
    assert "\u2028" not in text
    assert json.loads(text) == {"a": "</script><b>\u2028"}


def test_an_interval_below_zero_does_not_empty_an_axis_of_logarithms() -> None:
    near = {"method": "fused", "true_depth_m": 1.0, "depth_m": 1.1, "depth_low_m": 0.9}
    far = {"method": "size", "true_depth_m": 40.0, "depth_m": 44.0, "depth_low_m": -20.0}
    chart = errors_chart([near, far], by_method=[]).to_dict()
    drawn = chart["vconcat"][0]["hconcat"][0]["layer"][1]["data"]["values"]
    assert [row["method"] for row in drawn] == ["size", "fused"]
    assert [row["depth_low_m"] for row in drawn] == [4.0, 0.9]


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium (Debian: chromium)")
def test_a_browser_draws_every_chart(database: Path, page: str, tmp_path: Path) -> None:
    assert CHROMIUM is not None
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
    flags += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    flags += ["--virtual-time-budget=10000", "--enable-logging=stderr", "--dump-dom"]
    done = subprocess.run(
        [
            CHROMIUM,
            *flags,
            f"--user-data-dir={tmp_path}",
            database.with_name("report.html").as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert "Uncaught" not in done.stderr
    charts = re.findall(
        r'<div id="(chart-[\w-]+)" class="chart[^>]*>(.*?)</div>', done.stdout, re.S
    )
    assert {name for name, _ in charts} == set(re.findall(r'<div id="(chart-[\w-]+)"', page))
    for name, drawn in charts:
        marks = len(re.findall(r"<path[^>]+d=\"[^\"]+\"", drawn))
        assert "<svg" in drawn, name
        assert marks > 5, name
    assert "<title>1</title>" not in done.stdout


def test_people_have_pictures_heights_and_distances(database: Path, page: str) -> None:
    with Store.open(database, read_only=True) as store:
        people = store.query("FROM people ORDER BY track_id").to_pylist()
    assert len(people) == 2
    rows = re.findall(r'<tr><td>(?:<img[^>]*>)?</td><td class="n">.*?</tr>', page, re.DOTALL)
    assert len(rows) == 2
    for row, person in zip(rows, people, strict=True):
        assert "data:image/jpeg" in row
        assert f"<b>{person['height_m']:.2f}</b>" in row
        assert f"{person['height_low_m']:.2f}-{person['height_high_m']:.2f}" in row


def test_cameras_are_never_mixed(tmp_path: Path) -> None:
    write_people(tmp_path / "a.mcap")
    run([tmp_path / "a.mcap"], tmp_path / "x.duckdb", LEVEL)
    with Store.open(tmp_path / "x.duckdb") as store:
        first = read_report_data(store)
        for table in ("cameras", "frames", "observations", "tracks", "matches", "ground_truth"):
            store.connection.execute(f"CREATE TEMP TABLE t AS FROM {table}")
            store.connection.execute("UPDATE t SET recording_id = 'other', camera = 'bench'")
            store.connection.execute(f"INSERT INTO {table} FROM t")
            store.connection.execute("DROP TABLE t")
        for table in ("estimates", "recordings"):
            store.connection.execute(f"CREATE TEMP TABLE t AS FROM {table}")
            store.connection.execute("UPDATE t SET recording_id = 'other'")
            store.connection.execute(f"INSERT INTO {table} FROM t")
            store.connection.execute("DROP TABLE t")
        store.connection.execute(
            "UPDATE estimates SET depth_m = depth_m + 5 WHERE recording_id = 'other'"
        )
    with Store.open(tmp_path / "x.duckdb", read_only=True) as store:
        both = read_report_data(store)
    of_first = {r["method"]: r["depth_rmse_m"] for r in first.by_method}
    kept = {r["method"]: r["depth_rmse_m"] for r in both.by_method if r["camera"] == "cam"}
    assert kept == pytest.approx(of_first)
    worse = {r["method"]: r["depth_rmse_m"] for r in both.by_method if r["camera"] == "bench"}
    assert all(worse[m] > of_first[m] + 4 for m in of_first)


def test_a_wild_interval_does_not_stretch_an_axis() -> None:
    rows = [
        {
            "track_id": i,
            "height_m": 1.7,
            "height_low_m": 1.6,
            "height_high_m": 1.8 if i else 1e6,
            "height_assumed": False,
            "height_plausible": True,
            "true_height_m": None,
            "class_name": "person",
            "method": "fused",
            "observation_count": 9,
            "depth_min_m": 5.0,
            "depth_max_m": 6.0,
        }
        for i in range(20)
    ]
    low, high = heights_chart(rows, "cam").to_dict()["layer"][0]["encoding"]["x"]["scale"]["domain"]
    assert 1.5 < low < 1.6
    assert 1.8 < high < 1.9


def test_what_is_said_often_is_one_row(database: Path) -> None:
    with Store.open(database, read_only=True) as store:
        rows = read_report_data(store).diagnostics
    said = [(r["severity"], r["code"], r["message"]) for r in rows]
    assert len(said) == len(set(said))


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium (Debian: chromium)")
@pytest.mark.parametrize("width", [390, 820, 1280])
def test_the_page_fits_every_width(page: str, tmp_path: Path, width: int) -> None:
    assert CHROMIUM is not None
    bare = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    outer = tmp_path / "outer.html"
    outer.write_text(
        f'<iframe id="f" width="{width}" height="900" srcdoc="{html.escape(bare)}"></iframe>'
        '<script>onload = () => { const d = document.getElementById("f").contentDocument;'
        " document.title = d.documentElement.scrollWidth; }</script>",
        encoding="utf-8",
    )
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--dump-dom"]
    done = subprocess.run(
        [CHROMIUM, *flags, f"--user-data-dir={tmp_path / 'p'}", outer.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    title = re.search(r"<title>(\d+)</title>", done.stdout)
    assert title is not None
    assert int(title[1]) <= width
