"""The Rerun viewer as a child process: on the loopback only, with usage reports off."""

from __future__ import annotations

import importlib.util
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from pipeline.core.errors import StadimeterError, Where

LOOPBACK = "127.0.0.1"
START_S = 60.0
WEB_PORT = 9090
DRIVERS = ("/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d")


@dataclass(slots=True)
class Running:
    """A viewer that has been started."""

    process: subprocess.Popen[bytes]
    port: int
    said: IO[bytes]
    recording: Path

    def client(self, *, with_views: bool = True) -> Any:
        """Return a client once the viewer answers; `with_views`: once it shows something.

        Raises:
            StadimeterError: it ended, or does not answer.
        """
        from rerun.experimental import ViewerClient

        deadline = time.monotonic() + START_S
        while time.monotonic() < deadline:
            if self.process.poll() is not None:
                raise StadimeterError(
                    f"the Rerun viewer ended at once: {_last_words(self.said)}",
                    where=Where(self.recording),
                    remedy="Install a Vulkan driver (Debian: mesa-vulkan-drivers)",
                )
            try:
                client = ViewerClient.connect(f"rerun+http://{LOOPBACK}:{self.port}/proxy")
                if client.get_state().views or not with_views:
                    return client
            except Exception:  # noqa: S110  (the client's errors have no common type)
                pass
            time.sleep(0.3)
        raise StadimeterError("the Rerun viewer does not answer", where=Where(self.recording))


def no_viewer() -> str:
    """Return why there is no viewer, as a sentence; empty if there is one."""
    if importlib.util.find_spec("rerun_cli") is None:
        return "there is no Rerun viewer (pip install rerun-sdk)"
    return ""


def no_driver() -> str:
    """Return why nothing can be rendered without a screen, as a sentence; empty if it can."""
    if no_viewer():
        return no_viewer()
    if not any(Path(folder).is_dir() and any(Path(folder).iterdir()) for folder in DRIVERS):
        return "there is no Vulkan driver (Debian: apt install mesa-vulkan-drivers)"
    return ""


def no_display() -> str:
    """Return why no window can be opened, as a sentence; empty if one can."""
    if no_viewer():
        return no_viewer()
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        return "there is no display"
    return ""


@contextmanager
def started(recording: Path, options: Sequence[str] = ()) -> Iterator[Running]:
    """Start a viewer on a file, and stop it at the end if it still runs.

    The binary is that inside the package: the Python wrapper would leave the viewer behind.
    """
    import rerun_cli  # not in every installation

    binary = Path(rerun_cli.__file__).with_name("rerun")
    port = free_port()
    command = [str(binary), "--bind", LOOPBACK, "--port", str(port), *options, str(recording)]
    with tempfile.TemporaryDirectory(prefix="stadimeter-viewer-") as folder:
        environment = os.environ | _silence(Path(folder))
        with tempfile.TemporaryFile() as said:
            process = subprocess.Popen(  # noqa: S603  (our own arguments)
                command, env=environment, stdout=subprocess.DEVNULL, stderr=said
            )
            try:
                yield Running(process, port, said, recording)
            finally:
                process.terminate()
                try:
                    process.wait(10)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def _silence(folder: Path) -> dict[str, str]:
    """Return an environment in which the viewer reports nothing to its makers.

    There is no switch for one start; it reads `analytics.json` of the user's configuration, which is
    not ours to change, so it gets another. Where that is not looked for, `CI` does the same.
    """
    settings = folder / "rerun" / "analytics.json"
    settings.parent.mkdir()
    data = folder / "data"
    settings.write_text(
        json.dumps(
            {
                "analytics_enabled": False,
                "analytics_id": "none",
                "metadata": {},
                "config_file_path": str(settings),
                "data_dir_path": str(data),
            }
        ),
        encoding="utf-8",
    )
    return {"XDG_CONFIG_HOME": str(folder), "CI": "1", "RUST_LOG": "error"}


def _last_words(said: IO[bytes]) -> str:
    said.seek(0)
    lines = said.read().decode("utf-8", "replace").splitlines()
    panic = next((i for i, line in enumerate(lines) if "panicked at" in line), None)
    if panic is not None:
        return lines[panic].strip()
    spoken = [line.strip() for line in lines if "rror" in line]
    return spoken[-1] if spoken else "it said nothing"


def free_port(preferred: int = 0) -> int:
    """Return a port of the loopback that is free now: the preferred one if it is."""
    with socket.socket() as probe:
        try:
            probe.bind((LOOPBACK, preferred))
        except OSError:
            probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port
