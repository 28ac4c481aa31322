"""Advice: what to do about each finding, by the code of its diagnostic.

A message says what was found in this recording; the advice is the same wherever it is found. Codes whose
messages say themselves what to do are not here.
"""

from __future__ import annotations

from collections.abc import Mapping

ADVICE: Mapping[str, str] = {
    "no_lens_data": "give the lens in a camera file (README, section camera.toml); `stadimeter "
    "inspect` shows what the recording says",
    "pose_undetermined": "give camera_height_m and tilt_deg in a camera file, or record longer, until "
    "enough people have walked through",
    "size_unknown": "add a [[size_prior]] for this class to the camera file, or calibrate with truth; if "
    "it is another name for a class that has one, say so in [[class_name]]",
    "method_not_applicable": "calibrate on these objects (`stadimeter calibrate`), or leave the method "
    "aside: the others do not need it",
    "doubtful_calibration": "check the calibration of this camera; what a camera file gives goes first",
    "focal_length_contradicted": "check the lens data; give fx_px in a camera file to settle it",
    "moving_camera": "split the recording where the camera moved; one pose holds for one view",
    "size_changed": "record one size a camera, or state a calibration of these pictures too",
    "no_images": "check the topics with `stadimeter inspect`; pictures are found by their schema",
    "missing_library": "install the extra that is named, then run again",
    "unsupported_channel": "convert the channel, or leave it: nothing of it was used",
    "undecodable_image": "the other pictures were used; record these again if they matter",
    "truncated_file": "what was before the cut was used; copy the file again if there is more of it",
    "damaged_chunk": "what is intact was used; copy the file again if there is a better copy",
    "timeline_failed": "the numbers are stored; `stadimeter review -o FILE.rrd` writes the timeline",
}


def advice_for(code: str) -> str:
    """Return what to do about a finding, empty where its message says it."""
    return ADVICE.get(code, "")
