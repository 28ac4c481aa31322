"""Pictures on the timeline: every one where it belongs, in whichever batch it was sent."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from rerun.chunk import RrdReader

import dashboards.timeline.stills
from dashboards.timeline.columns import Frames
from dashboards.timeline.stills import StillEncoded, log_images

COUNT = 30


def rows_of(camera: str, lost: int) -> Any:
    index, time_ns = np.arange(10, 10 + COUNT), np.arange(COUNT) * 40_000_000
    table = pa.table({"frame_index": index, "decoded": [i != lost for i in index.tolist()]})
    return SimpleNamespace(name=camera, frames=Frames(index, time_ns, time_ns, 0, table))


@pytest.mark.parametrize("batch_bytes", [1, 500, 10_000])
def test_pictures_arrive_unchanged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch_bytes: int
) -> None:
    monkeypatch.setattr(dashboards.timeline.stills, "BATCH_BYTES", batch_bytes)
    cameras = {"a": rows_of("a", lost=12), "b": rows_of("b", lost=-1)}
    sent = {
        (name, index): b"\xff\xd8\xff" + bytes([index]) * (7 * index)
        for index in range(10, 10 + COUNT)
        for name in cameras
    }

    def stills():
        memory = bytearray(1000)  # is used for all: each is good until the next is asked for
        for (name, index), image in sent.items():
            memory[: len(image)] = image
            yield StillEncoded(name, index, memoryview(memory)[: len(image)])
        yield StillEncoded("a", 10 + COUNT, b"of no frame")
        yield StillEncoded("c", 10, b"of no camera")

    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "a.rrd")
    log_images(stream, stills(), cameras, None)
    stream.flush()
    stream.disconnect()
    found: dict[tuple[str, int], bytes] = {}
    for chunk in RrdReader(tmp_path / "a.rrd").stream().to_chunks():
        batch = chunk.to_record_batch()
        names = [n for n in batch.schema.names if n.endswith("EncodedImage:blob")]
        if not names:
            continue
        camera = str(chunk.entity_path).split("/")[2]
        for index, blobs in zip(batch["frame"], batch[names[0]], strict=True):
            if blobs.as_py():
                found[camera, index.as_py()] = bytes(blobs.as_py()[0])
    del sent["a", 12]  # which cannot be decoded
    assert found == sent
