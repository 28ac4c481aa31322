"""Photos become a recording: bytes kept, EXIF as exposure, times, cameras apart, turned upright."""

from __future__ import annotations

import io
import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from pipeline.core.config import CameraConfig, Config, Limits
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import StadimeterError, UsageError
from pipeline.core.records import Frame, Pairing
from pipeline.images.decode import decode
from pipeline.importing.photos import PhotoImport, are_photos, import_photos, zone_of
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile

NOON_NS = int(datetime(2026, 3, 1, 12, tzinfo=UTC).timestamp()) * 1_000_000_000


def save(
    path: Path,
    *,
    model: str = "X100",
    taken: str | None = "2026:03:01 12:00:00",
    orientation: int = 1,
    **tags: object,
) -> bytes:
    """Write a photo that is red above and blue below, as its sensor saw it."""
    pixels = np.zeros((40, 60, 3), np.uint8)
    pixels[:20, :, 0] = pixels[20:, :, 2] = 255
    exif = Image.Exif()
    exif[0x010F], exif[0x0110], exif[0x0112] = "Maker", model, orientation
    inner = exif.get_ifd(0x8769)
    inner[0x829D], inner[0x920A] = IFDRational(4, 1), IFDRational(35, 1)
    if taken is not None:
        inner[0x9003] = taken
    for name, value in tags.items():
        inner[{"subsec": 0x9291, "offset": 0x9011, "distance": 0x9206}[name]] = value
    stream = io.BytesIO()
    kind = "jpeg" if path.suffix.lower() == ".jpg" else path.suffix[1:]
    Image.fromarray(pixels).save(stream, kind, exif=exif, quality=95)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(stream.getvalue())
    return stream.getvalue()


def frames_of(path: Path) -> list[Frame]:
    notes = Notes()
    file = McapFile(path, Limits(), notes.add)
    frames = list(FrameAssembler(file, Config().ingest, notes))
    assert not list(notes)
    return frames


def test_photos_keep_their_bytes_and_bring_their_exif(tmp_path: Path) -> None:
    kept = save(tmp_path / "in" / "b.jpg", distance=IFDRational(0xFFFFFFFF, 1))
    later = save(tmp_path / "in" / "sub" / "a.PNG", taken="2026:03:01 12:00:05", subsec="25")
    (tmp_path / "in" / "notes.txt").write_text("no photo")
    out = tmp_path / "x.mcap"
    done = import_photos([tmp_path / "in"], out, PhotoImport(), Config())
    assert done.counts == {"maker_x100": 2}
    frames = frames_of(out)
    assert [f.image for f in frames] == [kept, later]
    assert [f.capture_time_ns - NOON_NS for f in frames] == [0, 5_250_000_000]
    assert [f.image_format for f in frames] == ["jpeg", "png"]
    assert [f.exposure.f_number for f in frames] == [4, 4]
    assert frames[0].exposure.focus_distance_m == np.inf
    assert np.isnan(frames[1].exposure.focus_distance_m)
    assert frames[0].exposure_pairing is Pairing.NEAREST
    assert any("time zone" in remark for remark in done.remarks)


def test_times_with_and_without_a_zone_and_without_any(tmp_path: Path) -> None:
    save(tmp_path / "zone.jpg", offset="+02:00")
    save(tmp_path / "assumed.jpg")
    save(tmp_path / "none.jpg", taken=None)
    os.utime(tmp_path / "none.jpg", ns=(NOON_NS, NOON_NS + 7))
    out = tmp_path / "x.mcap"
    options = PhotoImport(zone=zone_of("-01:30"))
    done = import_photos([tmp_path], out, options, Config())
    times = [f.capture_time_ns - NOON_NS for f in frames_of(out)]
    assert times == [-7_200 * 10**9, 7, 5_400 * 10**9]
    assert any("that of the file" in remark for remark in done.remarks)
    with pytest.raises(UsageError, match="offset"):
        zone_of("two hours")


def test_a_burst_in_one_second_keeps_its_order(tmp_path: Path) -> None:
    images = [save(tmp_path / f"{i}.jpg", subsec=None or "") for i in range(3)]
    out = tmp_path / "x.mcap"
    import_photos([tmp_path], out, PhotoImport(camera="c"), Config())
    frames = frames_of(out)
    assert [f.image for f in frames] == images
    assert [f.capture_time_ns - NOON_NS for f in frames] == [0, 1_000_000, 2_000_000]


@pytest.mark.parametrize(("orientation", "corner"), [(3, "blue"), (6, "blue"), (8, "red")])
def test_a_photo_is_turned_upright(tmp_path: Path, orientation: int, corner: str) -> None:
    save(tmp_path / "a.jpg", orientation=orientation)
    done = import_photos([tmp_path], tmp_path / "x.mcap", PhotoImport(), Config())
    (frame,) = frames_of(tmp_path / "x.mcap")
    picture = decode(frame.image, max_pixels=10**5)
    size = (60, 40) if orientation == 3 else (40, 60)
    assert (picture.width_px, picture.height_px) == size
    blue, _, red = picture.bgr[2, 2].astype(int)
    assert (blue > red) == (corner == "blue")
    assert any("turned" in remark for remark in done.remarks)


def test_cameras_stay_apart_and_a_camera_file_adds_what_exif_lacks(tmp_path: Path) -> None:
    save(tmp_path / "a.jpg", model="A")
    save(tmp_path / "b.jpg", model="B")
    camera = CameraConfig("maker_a", fx_px=70.0)
    import_photos([tmp_path], tmp_path / "x.mcap", PhotoImport(), Config(camera=(camera,)))
    focal = {f.camera: f.intrinsics and f.intrinsics.fx_px for f in frames_of(tmp_path / "x.mcap")}
    assert focal == {"maker_a": 70.0, "maker_b": None}


def test_what_is_no_photo_is_told_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"no photo")
    assert are_photos([tmp_path])
    assert not are_photos([tmp_path, tmp_path / "b.avi"])
    with pytest.raises(StadimeterError, match="no photos"):
        import_photos([tmp_path], tmp_path / "x.mcap", PhotoImport(), Config())
    save(tmp_path / "b.jpg")
    done = import_photos([tmp_path], tmp_path / "x.mcap", PhotoImport(), Config())
    assert sum(done.counts.values()) == 1
    assert any("a.jpg was left out" in remark for remark in done.remarks)
