"""A process with everything imported that forks a real run for each line on its input.

    python -m tests.support.crash_server DATABASE RECORDING...

It prints the run's process id when it starts, and how it ended. Starting Python and importing would
take most of the time of a test that kills a run again and again.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import dashboards.timeline.writer  # noqa: F401
import pipeline.run.pass_two
import pipeline.run.recordings
from pipeline.core.config import CameraConfig, Config

CONFIG = Config(camera=(CameraConfig("cam", camera_height_m=1.5, tilt_deg=0.0),))


def main() -> None:
    database, *recordings = map(Path, sys.argv[1:])
    for _ in sys.stdin:
        child = os.fork()
        if child == 0:
            code = 1
            try:
                result = pipeline.run.recordings.run(recordings, database, CONFIG)
                code = len(result.failed)
            finally:
                os._exit(code)
        print(child, flush=True)
        print(os.waitpid(child, 0)[1], flush=True)


if __name__ == "__main__":
    main()
