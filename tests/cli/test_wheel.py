"""The wheel outside the checkout: it holds what the demo needs, and the demo runs from it."""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

from pipeline.core.extras import how_to_install

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("stadimeter", "pipeline", "schemas", "dashboards", "recordings")
MOST_MB = 10.0


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    for name in PACKAGES:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-q"]
    subprocess.run([*command, "-w", str(folder), str(source)], check=True, timeout=200)
    (made,) = folder.glob("*.whl")
    return made


@pytest.mark.slow
def test_the_demo_runs_from_a_wheel_in_an_empty_folder(wheel: Path, tmp_path: Path) -> None:
    assert wheel.stat().st_size < MOST_MB * 1e6
    installed, empty = tmp_path / "installed", tmp_path / "empty"
    empty.mkdir()
    with zipfile.ZipFile(wheel) as file:
        file.extractall(installed)
    for name in PACKAGES[:-1]:
        assert (installed / name / "__init__.py").is_file()
    assert (installed / "stadimeter" / "py.typed").is_file()
    # `walkers` and the sweep take their time: the demo is run on the staff alone.
    for other in ("walkers", "aperture_sweep"):
        (installed / "recordings" / f"{other}.mcap").unlink()
    paths = f"{installed}:{sysconfig.get_path('purelib')}"
    code = (
        "import pipeline, sys; from pipeline.cli import main; "
        "print(pipeline.__file__); sys.exit(main(['demo']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=empty,
        env={"PYTHONPATH": paths, "HOME": str(tmp_path), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(str(installed))
    assert "paper, printed" in done.stdout
    assert "street" in done.stdout  # what the wheel lacks is named
    assert "stadimeter demo --recordings DIR" in done.stdout
    assert (empty / "out" / "demo" / "stadimeter.duckdb").is_file()


def test_extras_are_named_as_they_can_be_installed() -> None:
    text = how_to_install("video")
    assert "'.[video]'" in text
    assert ".whl[video]'" in text
