"""A picture of a timeline as a reviewer sees it, made without a screen.

    python -m dashboards.screenshot out/demo/street.rrd docs/street.png --frame 100

Needs a Vulkan driver; Debian's `mesa-vulkan-drivers` renders in software. The viewer listens on the
loopback only, and is stopped at the end.
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun_cli
from rerun.experimental import ViewerClient

from dashboards.scene import FRAME

START_S, LOADING_S = 60.0, 60.0
# The viewer's own notices lie over the panels for some seconds.
NOTICES_S = 6.0


class Viewer:
    """A headless viewer that shows one recording."""

    def __init__(self, client: ViewerClient) -> None:
        self._client = client

    def show_frame(self, frame_index: int) -> None:
        """Move the time to a frame, and wait until everything is drawn."""
        self._client.set_time(FRAME, sequence=frame_index, play_state="paused")
        self.wait()

    def wait(self) -> None:
        """Wait until no view is loading.

        Raises:
            TimeoutError: it takes more than a minute.
        """
        deadline = time.monotonic() + LOADING_S
        calm = 0
        while calm < 3:  # a view may begin to load only after the next frame is drawn
            if time.monotonic() > deadline:
                raise TimeoutError("the viewer is still loading")
            time.sleep(0.3)
            calm = 0 if self._client.get_state().loading else calm + 1

    def reports(self) -> list[str]:
        """Return what the views complain of."""
        views = self._client.get_state().views
        return [f"{view.name}: {report}" for view in views for report in view.reports]

    def picture(self) -> bytes:
        """Return a PNG of the whole window."""
        return bytes(self._client.take_screenshot())


@contextmanager
def viewer(recording: Path, *, size: str = "1920x1080") -> Iterator[Viewer]:
    """Open a recording in a headless viewer on the loopback.

    Raises:
        RuntimeError: the viewer does not start (most often there is no Vulkan driver).
    """
    binary = Path(rerun_cli.__file__).with_name("rerun")
    port = _free_port()
    command = [str(binary), "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--window-size", size, "--hide-welcome-screen", str(recording)]
    environment = os.environ | {"RERUN_ANALYTICS": "false", "RUST_LOG": "error"}
    process = subprocess.Popen(  # noqa: S603  (our own arguments)
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield Viewer(_connect(process, port))
    finally:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _connect(process: subprocess.Popen[bytes], port: int) -> ViewerClient:
    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise RuntimeError(
                "the Rerun viewer ended at once; is there a Vulkan driver "
                "(Debian: mesa-vulkan-drivers)?"
            )
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            if client.get_state().views:
                return client
        except Exception:  # noqa: S110  (the client's errors have no common type)
            pass
        time.sleep(0.3)
    raise RuntimeError("the Rerun viewer does not answer")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def main() -> None:
    """Write a PNG of a recording at a frame."""
    parser = argparse.ArgumentParser(description="Render a timeline to a PNG.")
    parser.add_argument("recording", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--frame", type=int, default=0)
    parser.add_argument("--size", default="1920x1080")
    arguments = parser.parse_args()
    with viewer(arguments.recording, size=arguments.size) as shown:
        shown.show_frame(arguments.frame)
        time.sleep(NOTICES_S)
        arguments.picture.write_bytes(shown.picture())
        for report in shown.reports():
            print(report)


if __name__ == "__main__":
    main()
