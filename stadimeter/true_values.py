"""Truth of files, beside stored recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from stadimeter.arguments import Camera, PathLike, config_of

if TYPE_CHECKING:
    from pipeline.truth.stored import AddedTruth


def truth(
    file: PathLike,
    db: PathLike,
    *,
    recording: str | None = None,
    camera_name: str | None = None,
    form: Literal["auto", "mot", "kitti", "cvml", "coco", "csv"] = "auto",
    first_frame: int | None = None,
    survey: Camera = None,
) -> AddedTruth:
    """Read true boxes, identities, depths and heights from a file, and judge the tracks by them.

    Truth that came from a file before, for the same camera, is replaced. It stays when the recording is
    measured again. The views `accuracy.tracking` and `accuracy.detection` tell the figures.

    Args:
        file: MOT Challenge, KITTI tracking, CVML (PETS), COCO, or a CSV table with the columns of the
            table `ground_truth`.
        db: DuckDB file that holds the recording.
        recording: file name or id of the recording; None if the database holds one.
        camera_name: the camera; None if the recording has one.
        form: form of the file; `auto` recognises it.
        first_frame: number of the recording's first frame in the file; None: 1 in MOT, else 0.
        survey: camera file, or a `Config`, with the surveyed pose of the camera: feet of true boxes tell
            their depth by it, where the file tells none.

    Returns:
        Numbers of objects, boxes and frames, and `notes` on what was refused or assumed.

    Raises:
        UsageError: the file is of no known form, or nothing in it belongs to the recording.
        StoreError: the database does not exist, or cannot be written.
    """
    from pipeline.run.truth import add_truth_of_file

    return add_truth_of_file(
        Path(file),
        Path(db),
        recording=recording,
        camera=camera_name,
        form=form,
        first_frame=first_frame,
        survey=None if survey is None else config_of(survey),
    )
