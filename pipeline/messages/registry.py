"""Readers of channels, found by encoding and name of the schema, never by topic.

A schema's name is normalised first: `sensor_msgs/msg/Image`, `sensor_msgs/Image` and
`sensor_msgs::msg::Image` are one, and so are `foxglove.RawImage` and `foxglove_msgs/msg/RawImage`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pipeline.mcap_file.reader import ChannelInfo
from pipeline.messages import json_text, protobuf, ros_schema, ros_wire
from pipeline.messages.boxes import detection_2d_array, detections, image_annotations
from pipeline.messages.calibration import camera_calibration
from pipeline.messages.content import Decoded, Family, Kind
from pipeline.messages.exposure import camera_exposure, names_exposure
from pipeline.messages.images import compressed_image, compressed_video, raw_image
from pipeline.messages.labels import label_info
from pipeline.messages.ros_builtin import DEFINITIONS
from pipeline.messages.transforms import frame_transform, frame_transforms, tf_message
from pipeline.messages.tree import Tree, UndecodableMessage
from pipeline.messages.truth import ground_truth

Reader = Callable[[bytes], Tree]

FAMILIES: dict[str, tuple[Kind, Family]] = {
    "foxglove/CompressedImage": (Kind.IMAGE, compressed_image),
    "foxglove/RawImage": (Kind.IMAGE, raw_image),
    "foxglove/CompressedVideo": (Kind.VIDEO, compressed_video),
    "foxglove/CameraCalibration": (Kind.CALIBRATION, camera_calibration),
    "foxglove/ImageAnnotations": (Kind.DETECTIONS, image_annotations),
    "foxglove/FrameTransform": (Kind.TRANSFORMS, frame_transform),
    "foxglove/FrameTransforms": (Kind.TRANSFORMS, frame_transforms),
    "sensor_msgs/CompressedImage": (Kind.IMAGE, compressed_image),
    "sensor_msgs/Image": (Kind.IMAGE, raw_image),
    "sensor_msgs/CameraInfo": (Kind.CALIBRATION, camera_calibration),
    "vision_msgs/Detection2DArray": (Kind.DETECTIONS, detection_2d_array),
    "vision_msgs/LabelInfo": (Kind.LABELS, label_info),
    "tf2_msgs/TFMessage": (Kind.TRANSFORMS, tf_message),
    "tf/tfMessage": (Kind.TRANSFORMS, tf_message),
    "stadimeter/CameraExposure": (Kind.EXPOSURE, camera_exposure),
    "stadimeter/GroundTruth": (Kind.TRUTH, ground_truth),
    "stadimeter/Detections": (Kind.DETECTIONS, detections),
}


@dataclass(frozen=True, slots=True)
class Decoder:
    """Decoder of the messages of one channel into records."""

    kind: Kind
    read: Reader
    family: Family

    def __call__(self, data: bytes) -> Decoded:
        """Return the content of a message.

        Raises:
            UndecodableMessage: the bytes are no such message.
        """
        return self.family(self.read(data))


def normalised(schema_name: str) -> str:
    """Return a schema's name as `package/Name`."""
    name = ros_schema.short_name(schema_name)
    if "/" not in name and "." in name:
        package, _, last = name.rpartition(".")
        name = f"{package}/{last}"
    return name.replace("foxglove_msgs/", "foxglove/").replace("stadimeter_msgs/", "stadimeter/")


def decoder_of(channel: ChannelInfo, max_bytes: int) -> Decoder | None:
    """Return the decoder of a channel; None if it brings nothing of use, or cannot be read.

    Args:
        channel: topic, encoding and schema.
        max_bytes: what a message that is compressed by itself may expand to.

    Raises:
        UndecodableMessage: the channel's schema cannot be used.
    """
    found = FAMILIES.get(normalised(channel.schema_name))
    if found is None and is_json_exposure(channel):
        found = (Kind.EXPOSURE, camera_exposure)
    reader = reader_of(channel, max_bytes) if found is not None else None
    return Decoder(found[0], reader, found[1]) if found is not None and reader is not None else None


def kind_of(channel: ChannelInfo) -> Kind | None:
    """Return what a channel brings, or None if it is of no use here."""
    try:
        decoder = decoder_of(channel, 0)
    except UndecodableMessage:
        return None
    return decoder.kind if decoder else None


def is_unread(channel: ChannelInfo) -> bool:
    """Return whether a channel holds something of use in an encoding that is not read."""
    return normalised(channel.schema_name) in FAMILIES and kind_of(channel) is None


def reader_of(channel: ChannelInfo, max_bytes: int) -> Reader | None:
    """Return what turns the messages of any channel into trees; None for an unknown encoding.

    Raises:
        UndecodableMessage: the channel's schema cannot be used.
    """
    encoding = channel.message_encoding
    if encoding == "json":
        return json_text.read
    if encoding == "protobuf":
        known = protobuf.known_class(channel.schema_name)
        return protobuf.reader(
            known or protobuf.class_in_schema(channel.schema_name, channel.schema_data)
        )
    if encoding in ("cdr", "ros1"):
        schema = _ros_schema(channel, ros1=encoding == "ros1")
        if encoding == "ros1":
            return ros_wire.ros1_reader(schema)
        return ros_wire.cdr_reader(schema, max_bytes)
    return None


def is_json_exposure(channel: ChannelInfo) -> bool:
    """Return whether the schema of a JSON channel names exposure values as stadimeter.CameraExposure."""
    return channel.message_encoding == "json" and names_exposure(
        json_text.property_names(channel.schema_data)
    )


def may_be_json_exposure(channel: ChannelInfo) -> bool:
    """Return whether only the messages of a JSON channel can tell what they are: it has no schema."""
    return channel.message_encoding == "json" and not channel.schema_data.strip()


def _ros_schema(channel: ChannelInfo, *, ros1: bool) -> ros_schema.Schema:
    """Return the definition in the file; where it is in another language, the well-known one."""
    name = ros_schema.short_name(channel.schema_name)
    if channel.schema_encoding in ("ros1msg", "ros2msg") and channel.schema_data.strip():
        definition = channel.schema_data.decode("utf-8", "backslashreplace")
    elif name in DEFINITIONS and not ros1:
        definition = DEFINITIONS[name]
    else:
        raise UndecodableMessage(
            f"its schema {channel.schema_name!r} is {channel.schema_encoding or 'empty'!r}, "
            "where the definition of a ROS message is needed"
        )
    return ros_schema.parse(name, definition, ros1=ros1)
