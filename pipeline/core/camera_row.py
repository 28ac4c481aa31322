"""Cameras of a recording as typed rows: the one place where the table `cameras` is read and written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace

import pyarrow as pa

from pipeline.core.records import Intrinsics
from pipeline.core.tables import CAMERAS


@dataclass(frozen=True, slots=True)
class CameraRow:
    """One camera of a recording, as a row of the table `cameras`; None is unknown."""

    camera: str
    topic: str | None = None
    frame_id: str | None = None
    width_px: int | None = None
    height_px: int | None = None
    fx_px: float | None = None
    fy_px: float | None = None
    cx_px: float | None = None
    cy_px: float | None = None
    distortion_model: str | None = None
    distortion: tuple[float, ...] | None = None
    intrinsics_source: str | None = None
    camera_height_m: float | None = None
    camera_height_std_m: float | None = None
    tilt_rad: float | None = None
    tilt_std_rad: float | None = None
    roll_rad: float | None = None
    roll_std_rad: float | None = None
    pose_source: str | None = None
    recorded_height_m: float | None = None
    recorded_tilt_rad: float | None = None
    recorded_roll_rad: float | None = None
    recorded_ground_frame: str | None = None
    focal_std_px: float | None = None
    centre_source: str | None = None
    distortion_source: str | None = None
    rectified_fx_px: float | None = None
    rectified_fy_px: float | None = None
    rectified_cx_px: float | None = None
    rectified_cy_px: float | None = None
    pose_loadings: tuple[float, ...] | None = None

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Width and height of the pictures; None if no picture could be decoded."""
        return (self.width_px, self.height_px) if self.width_px and self.height_px else None

    @property
    def pose(self) -> tuple[float, float, float] | None:
        """Height in metres, tilt and roll in radians; None if the pose is unknown."""
        if self.camera_height_m is None or self.tilt_rad is None or self.roll_rad is None:
            return None
        return self.camera_height_m, self.tilt_rad, self.roll_rad

    @property
    def intrinsics(self) -> Intrinsics | None:
        """The pinhole camera of the pictures; None if no lens is known."""
        if (
            self.fx_px is None
            or self.fy_px is None
            or self.cx_px is None
            or self.cy_px is None
            or self.width_px is None
            or self.height_px is None
        ):
            return None
        return Intrinsics(
            self.width_px,
            self.height_px,
            self.fx_px,
            self.fy_px,
            self.cx_px,
            self.cy_px,
            self.distortion_model or "",
            self.distortion or (),
        )

    @property
    def rectified(self) -> Intrinsics | None:
        """The lens if the pictures were rectified, where the recording leaves that open."""
        names = ("rectified_fx_px", "rectified_fy_px", "rectified_cx_px", "rectified_cy_px")
        values = [v for name in names if (v := getattr(self, name)) is not None]
        if len(values) < len(names) or self.width_px is None or self.height_px is None:
            return None
        return Intrinsics(self.width_px, self.height_px, *values)

    @property
    def moves(self) -> bool:
        """True if the camera moves by the transforms of the recording: then it has no one pose."""
        return self.recorded_ground_frame is not None and self.recorded_height_m is None

    def with_rectified(self, lens: Intrinsics | None) -> CameraRow:
        """Return the row with the lens that holds if the pictures were rectified."""
        return replace(
            self,
            rectified_fx_px=lens.fx_px if lens else None,
            rectified_fy_px=lens.fy_px if lens else None,
            rectified_cx_px=lens.cx_px if lens else None,
            rectified_cy_px=lens.cy_px if lens else None,
        )

    def with_lens(
        self,
        lens: Intrinsics | None,
        source: str | None,
        focal_std_px: float | None = None,
        sources: tuple[str | None, str | None] = (None, None),
    ) -> CameraRow:
        """Return the row with another lens, or with none; the size of the pictures stays.

        Args:
            lens: the lens.
            source: of its focal length.
            focal_std_px: standard error of the focal length where walkers told it.
            sources: of its centre and of its distortion; that of the focal length, if not stated.
        """
        sources = (sources[0] or source, sources[1] or source)
        return replace(
            self,
            fx_px=lens.fx_px if lens else None,
            fy_px=lens.fy_px if lens else None,
            cx_px=lens.cx_px if lens else None,
            cy_px=lens.cy_px if lens else None,
            distortion_model=lens.distortion_model if lens else None,
            distortion=lens.distortion if lens else None,
            intrinsics_source=source,
            focal_std_px=focal_std_px,
            centre_source=sources[0],
            distortion_source=sources[1],
        )


def camera_rows(table: pa.Table) -> list[CameraRow]:
    """Return the rows of a table that has the columns of `cameras`, in its order."""
    names = [f.name for f in fields(CameraRow)]
    rows = table.select(names).to_pylist()
    for row in rows:
        for name in ("distortion", "pose_loadings"):
            row[name] = None if row[name] is None else tuple(row[name])
    return [CameraRow(**row) for row in rows]


def camera_table(rows: Sequence[CameraRow]) -> pa.Table:
    """Return rows in the schema of the table `cameras`."""
    return pa.Table.from_pylist([asdict(row) for row in rows], schema=CAMERAS)
