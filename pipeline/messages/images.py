"""Pictures: compressed, bare pixels, and frames of a video stream."""

from __future__ import annotations

from pipeline.core.records import RawLayout
from pipeline.images.raw import DEPTH_ENCODINGS
from pipeline.messages.content import Decoded, EncodedImage, Payload, VideoPacket
from pipeline.messages.tree import Tree, blob, frame_id_of, text, time_of, whole

# Foxglove's names, and what else is seen.
CODECS = {
    "h264": "h264",
    "avc": "h264",
    "h265": "hevc",
    "hevc": "hevc",
    "av1": "av1",
    "vp9": "vp9",
}
_NOT_LIGHT = (
    "the pictures hold distances ({}), not light; they are not read as pictures. Name a topic with "
    "pictures of light, if there is one"
)


def compressed_image(tree: Tree) -> Decoded:
    """Return a foxglove.CompressedImage or a sensor_msgs/CompressedImage.

    Some recorders put single frames of a video stream into it; the format says so.
    """
    stated = text(tree, "format")
    codec = codec_of(stated)
    # image_transport states the encoding before compression: "16UC1; png compressed"
    if "compressedDepth" in stated or stated.split(";")[0].strip().lower() in DEPTH_ENCODINGS:
        return _none(tree, _NOT_LIGHT.format(stated))
    data = blob(tree, "data")
    payload: Payload = VideoPacket(codec, data) if codec else EncodedImage(stated, data)
    return Decoded(time_of(tree), frame_id_of(tree), payload)


def raw_image(tree: Tree) -> Decoded:
    """Return a foxglove.RawImage or a sensor_msgs/Image."""
    encoding = text(tree, "encoding").strip()
    if encoding.lower() in DEPTH_ENCODINGS:
        return _none(tree, _NOT_LIGHT.format(encoding))
    layout = RawLayout(
        encoding,
        whole(tree, "width"),
        whole(tree, "height"),
        whole(tree, "step"),
        big_endian=bool(tree.get("is_bigendian", False)),
    )
    payload = EncodedImage(encoding, blob(tree, "data"), layout)
    return Decoded(time_of(tree), frame_id_of(tree), payload)


def compressed_video(tree: Tree) -> Decoded:
    """Return a foxglove.CompressedVideo."""
    stated = text(tree, "format")
    payload = VideoPacket(codec_of(stated) or stated, blob(tree, "data"))
    return Decoded(time_of(tree), frame_id_of(tree), payload)


def codec_of(stated: str) -> str | None:
    """Return FFmpeg's name of a video format, or None if it is none."""
    return CODECS.get(stated.strip().lower().replace(".", ""))


def _none(tree: Tree, sentence: str) -> Decoded:
    return Decoded(time_of(tree), frame_id_of(tree), None, [sentence], "depth_image")
