"""Pictures of a timeline as a reviewer sees it, made without a screen.

    python -m dashboards.for_docs.screenshot out/demo/street.rrd docs/street.png --frame 100
    python -m dashboards.for_docs.screenshot out/demo/street.rrd a.png --frame 10 b.png --frame 90 \
        --tab About

Needs a Vulkan driver; Debian's `mesa-vulkan-drivers` renders in software. The viewer listens on the
loopback only, and is stopped at the end. Exit code 1 if a view complains.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dashboards.review.viewer import started
from dashboards.timeline.stream import FRAME
from pipeline.core.errors import StadimeterError

LOADING_S = 60.0
# The viewer's own notices lie over the panels for some seconds after its start.
NOTICES_S = 6.0
SETTLING_S = 15.0
QUALITIES = (88, 84, 80, 75, 70)  # below that letters have rings
BAR_PX = 37  # the window's own bar, which tells of this machine


class Viewer:
    """A headless viewer that shows one recording."""

    def __init__(self, client: object) -> None:
        self._client: object = client
        self._started = time.monotonic()

    def show_frame(self, frame_index: int) -> None:
        """Move the time to a frame, and wait until everything is drawn."""
        deadline = time.monotonic() + LOADING_S
        while True:
            try:
                self._client.set_time(FRAME, sequence=frame_index, play_state="paused")  # type: ignore[attr-defined]
                break
            except ConnectionError:  # nothing of the recording is there yet
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.3)
        self._wait()

    def _wait(self) -> None:
        deadline = time.monotonic() + LOADING_S
        calm = 0
        while calm < 3:  # a view may begin to load only after the next frame is drawn
            if time.monotonic() > deadline:
                raise StadimeterError("the viewer is still loading after a minute")
            time.sleep(0.3)
            calm = 0 if self._client.get_state().loading else calm + 1  # type: ignore[attr-defined]

    def show_tab(self, name: str) -> None:
        """Bring a tab to the front by its title.

        Raises:
            StadimeterError: there is no such tab.
        """
        client: Any = self._client
        layout = client.get_blueprint().blueprint
        parts = {
            key.lstrip("/"): value["ContainerBlueprint"]
            for key, value in layout.items()
            if "ContainerBlueprint" in value
        }
        named = {key for key, part in parts.items() if part.get("display_name") == name}
        named |= {f"view/{v.view_id}" for v in client.get_state().views if v.name == name}
        for part in parts.values():
            inside = named & set(part["contents"])
            if part["container_kind"] == "Tabs" and inside:
                part["active_tab"] = inside.pop()
                client.set_blueprint(layout, of="recording")
                self._wait()
                return
        raise StadimeterError(f"the timeline has no tab {name!r}")

    def reports(self) -> list[str]:
        """Return what the views complain of, hidden ones too, for longer than `SETTLING_S`.

        On a busy machine a view can come before the camera it needs, and complains until that is there.
        """
        until = time.monotonic() + SETTLING_S
        while True:
            views = self._client.get_state().views  # type: ignore[attr-defined]
            found = [f"{view.name}: {report}" for view in views for report in view.reports]
            if not found or time.monotonic() > until:
                return found
            time.sleep(0.3)

    def views(self) -> list[str]:
        """Return the names of the views that can be seen."""
        views = self._client.get_state().views  # type: ignore[attr-defined]
        return [view.name for view in views if view.visible]

    def picture(self, *, without_notices: bool = False) -> bytes:
        """Return a PNG of the whole window; waits for the viewer's notices to go if asked."""
        if without_notices:
            time.sleep(max(0.0, self._started + NOTICES_S - time.monotonic()))
        return bytes(self._client.take_screenshot())  # type: ignore[attr-defined]

    def panel(self, name: str) -> bytes | None:
        """Return a PNG of one view; none of one behind another tab."""
        client: Any = self._client
        view = next(v for v in client.get_state().views if v.name == name)
        try:
            return bytes(client.take_screenshot(view.view_id))
        except (ConnectionError, RuntimeError):
            return None

    def save(self, target: Path, *, largest_bytes: int | None = None) -> None:
        """Write a picture of the views, without the bar above them; PNG or JPEG by its name.

        A JPEG is as good as `largest_bytes` allows.
        """
        png = np.frombuffer(self.picture(without_notices=True), np.uint8)
        window = np.asarray(cv2.imdecode(png, cv2.IMREAD_COLOR))[BAR_PX:]
        for quality in QUALITIES:
            options = () if target.suffix == ".png" else (cv2.IMWRITE_JPEG_QUALITY, quality)
            encoded = cv2.imencode(target.suffix, window, options)[1]
            if largest_bytes is None or len(encoded) <= largest_bytes:
                break
        target.write_bytes(encoded.tobytes())


@contextmanager
def viewer(recording: Path, *, size: str = "1920x1080") -> Iterator[Viewer]:
    """Open a recording in a headless viewer on the loopback.

    Raises:
        StadimeterError: the viewer does not start, or does not answer.
    """
    options = ["--headless", "--window-size", size, "--hide-welcome-screen"]
    with started(recording, options) as running:
        yield Viewer(running.client())


def main() -> int:
    """Write PNGs of a recording, each at a frame."""
    parser = argparse.ArgumentParser(description="Render a timeline to PNGs.")
    parser.add_argument("recording", type=Path)
    parser.add_argument("pictures", type=Path, nargs="+")
    parser.add_argument("--frame", type=int, action="append", help="one for each picture, in order")
    parser.add_argument("--tab", action="append", default=[], help="bring it to the front")
    parser.add_argument("--size", default="1920x1080")
    arguments = parser.parse_intermixed_args()
    frames = arguments.frame or [0] * len(arguments.pictures)
    if len(frames) != len(arguments.pictures):
        parser.error("give --frame once for each picture")
    reports = []
    with viewer(arguments.recording, size=arguments.size) as shown:
        for tab in arguments.tab:
            shown.show_tab(tab)
        for picture, frame in zip(arguments.pictures, frames, strict=True):
            shown.show_frame(frame)
            shown.save(picture)
            reports += shown.reports()
    for report in dict.fromkeys(reports):
        print(report, file=sys.stderr)
    return 1 if reports else 0


if __name__ == "__main__":
    sys.exit(main())
