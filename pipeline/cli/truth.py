"""`stadimeter truth`: true boxes, identities, depths and heights from a file, beside a recording."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.console import err, out, print_rows, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands, add_database

if TYPE_CHECKING:
    from stadimeter import AddedTruth

_FIGURES = """
SELECT grouping, class_name, true_depth_from_m, true_depth_to_m, recall, precision, hota, deta, assa,
    idf1, mota, switch_count, fragment_count
FROM (
    SELECT 'all' AS grouping, NULL AS class_name, NULL AS true_depth_from_m, NULL AS true_depth_to_m, *
    EXCLUDE (recording_id, file_name, camera) FROM accuracy.tracking
    WHERE recording_id = ? AND camera = ?
)
"""


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "truth",
        help="read true boxes, identities, depths and heights, and judge the tracks by them",
    )
    parser.add_argument("file", type=Path, metavar="FILE")
    add_database(parser)
    parser.add_argument(
        "--recording", metavar="NAME", help="the recording, if the database holds several"
    )
    parser.add_argument(
        "--camera-name", metavar="NAME", help="the camera, if the recording has several"
    )
    parser.add_argument(
        "--format",
        choices=("auto", "mot", "kitti", "cvml", "coco", "csv"),
        default="auto",
        help="MOT Challenge, KITTI tracking, CVML (PETS), COCO, or a table with a header "
        "(frame_index, object_id, x_min_px ... depth_m, height_m, ignored)",
    )
    parser.add_argument(
        "--first-frame",
        type=int,
        metavar="N",
        help="number of the recording's first frame in the file (default: MOT 1, others 0)",
    )
    parser.add_argument(
        "--survey",
        type=Path,
        metavar="TOML",
        help="camera file with the surveyed pose, by which the feet of true boxes tell their depth",
    )
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    added = stadimeter.truth(
        arguments.file,
        arguments.db,
        recording=arguments.recording,
        camera_name=arguments.camera_name,
        form=arguments.format,
        first_frame=arguments.first_frame,
        survey=arguments.survey,
    )
    print_added(added, arguments.file, arguments.db)
    return DONE


def print_added(added: AddedTruth, file: Path, database: Path) -> None:
    """Print what was read, and how well the tracks agree with it."""
    import stadimeter

    for note in added.notes:
        err.print(f"{note.severity}: {safe(note.message)}", soft_wrap=True)
    out.print(
        f"{safe(file.name)}: {added.boxes:,} boxes of {added.objects:,} objects in {added.frames:,} "
        f"frames of {safe(added.camera)}, {added.ignored:,} regions ignored",
        soft_wrap=True,
    )
    with stadimeter.open(database) as results:
        rows = results.query(_FIGURES, [added.recording_id, added.camera]).arrow().to_pylist()
    if rows:
        shown = [k for k, v in rows[0].items() if v is not None and k != "grouping"]
        print_rows(
            "Tracks against the truth, at an overlap of 0.5",
            shown,
            [[_short(rows[0][k]) for k in shown]],
        )


def _short(value: object) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)
