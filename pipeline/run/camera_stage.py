"""State of one camera during pass 1: its detector, its tracks, its background, its lens."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline.core.arrays import NAN, FloatArray
from pipeline.core.camera_row import CameraRow
from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.core.lens import (
    Lens,
    fit_to_picture,
    intrinsics_of,
    lens_of,
    lens_sources,
    overridden,
)
from pipeline.core.records import Boxes, Diagnostic, Frame, Intrinsics, Severity
from pipeline.core.sensors.hints import assumption_of
from pipeline.core.tables import BACKGROUND_LINES
from pipeline.core.timing import StageTimes
from pipeline.detect import AS_GIVEN, Detector, make_detector
from pipeline.detect.pose_verify import PoseVerifier
from pipeline.detect.verify import Verifier, make_verifier
from pipeline.images.decode import Picture, decode
from pipeline.images.raw import compressed
from pipeline.ingest.plausibility import inside_picture
from pipeline.ingest.pose import CameraPose
from pipeline.measure.appearance import colours as colours_of
from pipeline.measure.background_lines import Backdrop
from pipeline.measure.camera_motion import CameraMotion
from pipeline.measure.class_names import ClassNames
from pipeline.measure.lens_stretches import LensStretch, LensStretches
from pipeline.measure.observations import Seen, luminance_inside, seen_whole
from pipeline.track.tracker import Tracker

# The detector learns from this many pictures, spread over its learning time, during which frames
# wait, still encoded, in at most this much memory: fifteen seconds of 1080p at 25 frames/s and 400 KB.
LEARNING_PICTURES = 25
LEARNING_BYTES = 160 * 1024**2
# A tracklet of half a second has a colour, and no frame rate makes it cost more.
COLOURED_EVERY_S = 0.3
# Stands for the size of pictures as long as none could be decoded.
NO_SIZE = (0, 0)


class Decoded(NamedTuple):
    """A frame and its picture, None if it could not be decoded."""

    frame: Frame
    picture: Picture | None


# A detector's box may slip out of the picture now and then; of another size of picture many do.
FEW_OUTSIDE, SHARE_OUTSIDE = 10, 0.05
OTHER_SIZE = (
    "boxes in these pictures are taken to the lens that most pictures have, by the calibration "
    "of these "
    "or by their size; those in pictures of another shape without a calibration give no distance"
)
OTHER_LENS = (
    "each picture is measured with its own, on the word of the recording; look at what is "
    "measured in "
    "these pictures, and give fx_px in a camera file if the lens never changed"
)


class CameraStage:
    """The steps that one camera's frames go through, and the state that lives between them."""

    def __init__(
        self, config: Config, camera: str, topic: str, notes: Notes, *, recorded: bool
    ) -> None:
        config = config.naming(camera, topic)
        self.camera = camera
        self.topic = topic
        self.detector: Detector = make_detector(
            config.detect, config.camera_named(camera), recorded
        )
        self.verifier = _verifier(config, self.detector)
        self.tracker = Tracker(config.track, camera)
        self.backdrop = Backdrop()
        self._motion = CameraMotion(camera)
        self._lenses = LensStretches()
        self.stretch: LensStretch | None = None  # of the last picture
        self.config = config
        self._settings = config.camera_named(camera)
        self._names = ClassNames(config)
        self._notes = notes
        self._size_px = NO_SIZE
        self._boxes, self._boxes_outside = 0, 0  # recorded ones
        self._learning = self.detector.learning_s > 0
        self._waiting: list[Frame] = []
        self._held_bytes = 0
        self._coloured_ns = -(1 << 62)

    def ready(self, frame: Frame) -> list[Frame]:
        """Return the frames that can go on: none while the detector's learning time lasts.

        Frames that wait are encoded, so they are small; pictures for learning are decoded from them.
        """
        frame = self._with_known_classes(frame)
        if not self._learning:
            return [frame]
        self._waiting.append(compressed(frame))
        waited_s = (frame.capture_time_ns - self._waiting[0].capture_time_ns) / 1e9
        self._held_bytes += len(self._waiting[-1].image)
        if waited_s < self.detector.learning_s and self._held_bytes < LEARNING_BYTES:
            return []
        return self.release()

    def _with_known_classes(self, frame: Frame) -> Frame:
        """Return a frame whose classes have the names that sizes go by, and say what was renamed."""
        frame = self._names.in_frame(frame)
        for stated, used in self._names.told():
            text = f"the class {stated!r} of the recording is taken for {used!r}"
            note = self._diagnostic(frame, "class_renamed", text)
            self._notes.add(replace(note, severity=Severity.INFO))
        return frame

    def release(self) -> list[Frame]:
        """End the learning time and return the frames that waited, in order."""
        self._learning = False
        waiting, self._waiting = self._waiting, []
        return waiting

    def decode(self, frame: Frame) -> Picture:
        """Decode a picture as the detector wants it; called from several threads.

        Raises:
            UndecodableImage: the bytes are no picture, or one beyond the limits.
        """
        return self.detector.prepared(self._decode(frame, self.detector.full_resolution))

    def decode_whole(self, frame: Frame) -> Picture:
        """Decode a picture at its full resolution; called from several threads."""
        return self._decode(frame, full_resolution=True)

    def _decode(self, frame: Frame, full_resolution: bool) -> Picture:
        limits = self.config.limits
        return decode(
            frame.image,
            max_pixels=limits.image_pixels,
            max_scans=limits.image_scans,
            full_resolution=full_resolution,
            min_side_px=self.config.detect.min_side_px,
            layout=frame.layout,
        )

    def follow(self, item: Decoded, times: StageTimes) -> Seen:
        """Detect and track in one frame; frames must come in order."""
        frame, picture = self._without_boxes_outside(item)
        with times.stage("detect"):
            self.backdrop.add(picture)
            self._watch(frame, picture)
            expected = self.tracker.expected(frame.capture_time_ns)
            boxes = self._bounded(frame, self.detector.detect(frame, picture, expected))
        with times.stage("track"):
            ids = self.tracker.update(frame.capture_time_ns, frame.frame_index, boxes)
        with times.stage("measure"):
            light = luminance_inside(picture, boxes)
            colours = self._colours(frame, picture, boxes)
        confirmed = None
        if self.verifier is not None and picture is not None:
            with times.stage("verify"):
                whole = seen_whole(picture, boxes)
                confirmed = self.verifier.confirmed(frame, boxes, ids, whole, self.decode_whole)
        return Seen(frame, picture, boxes, ids, light, colours, confirmed)

    def _watch(self, frame: Frame, picture: Picture | None) -> None:
        """Say when the camera moves, or the pictures show another place."""
        note = self._motion.add(picture, frame.capture_time_ns, frame.log_time_ns)
        if note is not None:
            self._notes.add(replace(note, topic=frame.topic))

    def _colours(self, frame: Frame, picture: Picture | None, boxes: Boxes) -> FloatArray | None:
        """Return the colours of boxes, now and then: people keep their clothes."""
        since_s = (frame.capture_time_ns - self._coloured_ns) / 1e9
        if picture is None or not len(boxes) or 0 <= since_s < COLOURED_EVERY_S:
            return None
        if not self.config.track.offline or self.detector.name in AS_GIVEN:
            return None
        self._coloured_ns = frame.capture_time_ns
        return colours_of(picture, boxes.bbox_xyxy_px)

    def _bounded(self, frame: Frame, boxes: Boxes) -> Boxes:
        """Return no more boxes than may be followed, those of the best scores, and say so."""
        limit = self.config.limits.tracked_objects
        if len(boxes) <= limit:
            return boxes
        text = f"more than {limit:,} boxes in a picture (limits.tracked_objects); the others are left out"
        self._note(frame, "too_many_objects", text)
        best = np.argsort(-np.nan_to_num(boxes.score), kind="stable")[:limit]
        return boxes.take(np.sort(best))

    def _without_boxes_outside(self, item: Decoded) -> Decoded:
        """Leave out recorded boxes that lie outside of their picture, and say so."""
        frame, picture = item
        if picture is None or frame.detections is None or not len(frame.detections):
            return item
        inside, outside = inside_picture(frame.detections, picture.width_px, picture.height_px)
        self._boxes += len(frame.detections)
        self._boxes_outside += len(outside)
        for edges in outside:
            size = f"{picture.width_px} x {picture.height_px}"
            self._note(frame, "invalid_value", f"box {edges} lies outside of the picture of {size}")
        return Decoded(replace(frame, detections=inside), picture) if outside else item

    def note_boxes_outside(self) -> None:
        """Say so if recorded boxes seem to be of pictures of another size."""
        share = self._boxes_outside / max(self._boxes, 1)
        if self._boxes_outside < FEW_OUTSIDE or share < SHARE_OUTSIDE:
            return
        width_px, height_px = self._size_px
        text = (
            f"{share:.0%} of {self._boxes:,} recorded boxes lie outside of the pictures of "
            f"{width_px} x "
            f"{height_px}: the boxes are of pictures of another size, and all distances by "
            f"them are wrong; "
            "let the detector state its boxes in pixels of the stored pictures"
        )
        self._notes.add(
            Diagnostic(
                Severity.WARNING,
                "boxes_of_another_size",
                text,
                camera=self.camera,
                topic=self.topic,
            )
        )

    def lens(self, frame: Frame, picture: Picture | None) -> Lens:
        """Return the lens of a frame, and learn from it how the camera sees."""
        size_px = (picture.width_px, picture.height_px) if picture else self._size_px
        lens = lens_of(frame.exposure, self._settings, frame.intrinsics, *size_px)
        if picture is not None:
            self._learn_intrinsics(frame, lens, size_px)
        text = overridden(frame.exposure, self._settings)
        if text is not None:
            self._note(frame, "camera_file_overrides", text)
        return lens

    def background_lines(self) -> pa.Table:
        """Return the straight edges of the background; none where the lens changes."""
        if self._lenses.several:
            return BACKGROUND_LINES.empty_table()
        return self.backdrop.lines(self.camera)

    @property
    def intrinsics(self) -> Intrinsics | None:
        """The lens that most pictures have, None where none is known."""
        return self._lenses.usual.intrinsics

    def _learn_intrinsics(self, frame: Frame, lens: Lens, size_px: tuple[int, int]) -> None:
        """Count the frame for its size and calibration; say when a picture differs from those before."""
        focal_px = lens.focal_length_mm * 1e3 / lens.pixel_pitch_x_um
        before = self.stretch
        stretch, is_new = self._lenses.of_frame(size_px, frame.intrinsics, focal_px)
        self.stretch = stretch
        if is_new and self._size_px != NO_SIZE:
            if size_px != self._size_px:
                text = f"the pictures change their size to {size_px}"
                self._note(frame, "size_changed", f"{text}; {OTHER_SIZE}")
            elif (change := _change(before, stretch)) is not None:
                self._note(frame, "lens_changed", f"{change}; {OTHER_LENS}")
        self._size_px = size_px
        if stretch.intrinsics is not None:
            return
        found, source, complaint = intrinsics_of(frame.intrinsics, self._settings, lens, *size_px)
        if complaint:
            self._note(frame, "doubtful_calibration", complaint)
        if found is not None:
            self._note_rounding(frame, source, lens)
            other = frame.rectified
            stretch.intrinsics, stretch.source = found, source
            stretch.rectified = fit_to_picture(other, *size_px) if other else None

    def _note_rounding(self, frame: Frame, source: str | None, lens: Lens) -> None:
        """Say that angles come from a data sheet, or from a focal length that cameras round."""
        assumed = assumption_of(self._settings, self._size_px[0]) if source != "recording" else None
        if assumed is not None:
            self._note(frame, *assumed)
            return
        if source == "lens_data" and lens.by_equivalent:
            share = 0.5 / lens.focal_length_35mm_mm
            self._note(
                frame,
                "rounded_focal_length",
                f"no pixel pitch is stated: the focal length for 35 mm film, "
                f"{lens.focal_length_35mm_mm:g} mm, stands for it; it is rounded to a millimetre, "
                f"so distances are unsure by up to {share:.1%} more than their intervals say; give "
                "fx_px or pixel_pitch_x_um in a camera file",
            )

    def row(
        self, frame_id: str | None, pose: CameraPose | None, *, moves: bool = False
    ) -> CameraRow:
        """Return the camera as it is known after pass 1; `moves` says that it has no one pose."""
        usual = self._lenses.usual
        row = CameraRow(
            self.camera,
            topic=self.topic,
            frame_id=frame_id,
            width_px=usual.size_px[0] or None,
            height_px=usual.size_px[1] or None,
        )
        if pose is not None:
            row = replace(
                row,
                recorded_height_m=pose.height_m,
                recorded_tilt_rad=pose.tilt_rad,
                recorded_roll_rad=pose.roll_rad,
                recorded_ground_frame=pose.ground_frame,
            )
            if moves:
                row = replace(
                    row, recorded_height_m=None, recorded_tilt_rad=None, recorded_roll_rad=None
                )
        k = usual.intrinsics
        if k is None:
            return row
        row = replace(row, width_px=k.width_px, height_px=k.height_px)
        sources = lens_sources(k, self._settings, usual.source)
        row = row.with_lens(k, usual.source, sources=sources)
        return row.with_rectified(usual.rectified if row.intrinsics_source == "recording" else None)

    def _note(self, frame: Frame, code: str, message: str) -> None:
        self._notes.add(self._diagnostic(frame, code, message))

    def _diagnostic(self, frame: Frame, code: str, message: str) -> Diagnostic:
        return Diagnostic(
            Severity.WARNING,
            code,
            message,
            camera=self.camera,
            topic=frame.topic,
            log_time_ns=frame.log_time_ns,
        )


def _change(before: LensStretch | None, now: LensStretch) -> str | None:
    """Return how the lens of a picture differs from that of the one before, if both are known."""
    focal_px = [
        s.stated.fx_px if s and s.stated else s.focal_px if s else NAN for s in (before, now)
    ]
    if all(map(math.isfinite, focal_px)):
        return f"the focal length changes from {focal_px[0]:.0f} to {focal_px[1]:.0f} px"
    return None


def _verifier(config: Config, detector: Detector) -> Verifier | PoseVerifier | None:
    """Return the network that confirms what motion finds, if there is one."""
    if not config.detect.model or detector.name != "motion":
        return None
    return make_verifier(config.detect)
