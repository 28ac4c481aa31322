import datetime

from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class CameraExposure(_message.Message):
    __slots__ = ("timestamp", "frame_id", "exposure_time_s", "f_number", "photographic_sensitivity", "exposure_bias_ev", "brightness_ev", "focal_length_mm", "focal_length_35mm_mm", "focus_distance_m", "digital_zoom_ratio", "gain_db", "pixel_pitch_x_um", "pixel_pitch_y_um", "sensor_width_px", "sensor_height_px")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    EXPOSURE_TIME_S_FIELD_NUMBER: _ClassVar[int]
    F_NUMBER_FIELD_NUMBER: _ClassVar[int]
    PHOTOGRAPHIC_SENSITIVITY_FIELD_NUMBER: _ClassVar[int]
    EXPOSURE_BIAS_EV_FIELD_NUMBER: _ClassVar[int]
    BRIGHTNESS_EV_FIELD_NUMBER: _ClassVar[int]
    FOCAL_LENGTH_MM_FIELD_NUMBER: _ClassVar[int]
    FOCAL_LENGTH_35MM_MM_FIELD_NUMBER: _ClassVar[int]
    FOCUS_DISTANCE_M_FIELD_NUMBER: _ClassVar[int]
    DIGITAL_ZOOM_RATIO_FIELD_NUMBER: _ClassVar[int]
    GAIN_DB_FIELD_NUMBER: _ClassVar[int]
    PIXEL_PITCH_X_UM_FIELD_NUMBER: _ClassVar[int]
    PIXEL_PITCH_Y_UM_FIELD_NUMBER: _ClassVar[int]
    SENSOR_WIDTH_PX_FIELD_NUMBER: _ClassVar[int]
    SENSOR_HEIGHT_PX_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    frame_id: str
    exposure_time_s: float
    f_number: float
    photographic_sensitivity: float
    exposure_bias_ev: float
    brightness_ev: float
    focal_length_mm: float
    focal_length_35mm_mm: float
    focus_distance_m: float
    digital_zoom_ratio: float
    gain_db: float
    pixel_pitch_x_um: float
    pixel_pitch_y_um: float
    sensor_width_px: int
    sensor_height_px: int
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., frame_id: _Optional[str] = ..., exposure_time_s: _Optional[float] = ..., f_number: _Optional[float] = ..., photographic_sensitivity: _Optional[float] = ..., exposure_bias_ev: _Optional[float] = ..., brightness_ev: _Optional[float] = ..., focal_length_mm: _Optional[float] = ..., focal_length_35mm_mm: _Optional[float] = ..., focus_distance_m: _Optional[float] = ..., digital_zoom_ratio: _Optional[float] = ..., gain_db: _Optional[float] = ..., pixel_pitch_x_um: _Optional[float] = ..., pixel_pitch_y_um: _Optional[float] = ..., sensor_width_px: _Optional[int] = ..., sensor_height_px: _Optional[int] = ...) -> None: ...

class BoundingBox(_message.Message):
    __slots__ = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
    X_MIN_PX_FIELD_NUMBER: _ClassVar[int]
    Y_MIN_PX_FIELD_NUMBER: _ClassVar[int]
    X_MAX_PX_FIELD_NUMBER: _ClassVar[int]
    Y_MAX_PX_FIELD_NUMBER: _ClassVar[int]
    x_min_px: float
    y_min_px: float
    x_max_px: float
    y_max_px: float
    def __init__(self, x_min_px: _Optional[float] = ..., y_min_px: _Optional[float] = ..., x_max_px: _Optional[float] = ..., y_max_px: _Optional[float] = ...) -> None: ...

class TrueObject(_message.Message):
    __slots__ = ("object_id", "class_name", "depth_m", "range_m", "height_m", "width_m", "x_m", "y_m", "box")
    OBJECT_ID_FIELD_NUMBER: _ClassVar[int]
    CLASS_NAME_FIELD_NUMBER: _ClassVar[int]
    DEPTH_M_FIELD_NUMBER: _ClassVar[int]
    RANGE_M_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    WIDTH_M_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    BOX_FIELD_NUMBER: _ClassVar[int]
    object_id: str
    class_name: str
    depth_m: float
    range_m: float
    height_m: float
    width_m: float
    x_m: float
    y_m: float
    box: BoundingBox
    def __init__(self, object_id: _Optional[str] = ..., class_name: _Optional[str] = ..., depth_m: _Optional[float] = ..., range_m: _Optional[float] = ..., height_m: _Optional[float] = ..., width_m: _Optional[float] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., box: _Optional[_Union[BoundingBox, _Mapping]] = ...) -> None: ...

class GroundTruth(_message.Message):
    __slots__ = ("timestamp", "frame_id", "objects")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    OBJECTS_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    frame_id: str
    objects: _containers.RepeatedCompositeFieldContainer[TrueObject]
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., frame_id: _Optional[str] = ..., objects: _Optional[_Iterable[_Union[TrueObject, _Mapping]]] = ...) -> None: ...

class Detection(_message.Message):
    __slots__ = ("box", "class_name", "score", "object_id", "box_std_px")
    BOX_FIELD_NUMBER: _ClassVar[int]
    CLASS_NAME_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    OBJECT_ID_FIELD_NUMBER: _ClassVar[int]
    BOX_STD_PX_FIELD_NUMBER: _ClassVar[int]
    box: BoundingBox
    class_name: str
    score: float
    object_id: str
    box_std_px: float
    def __init__(self, box: _Optional[_Union[BoundingBox, _Mapping]] = ..., class_name: _Optional[str] = ..., score: _Optional[float] = ..., object_id: _Optional[str] = ..., box_std_px: _Optional[float] = ...) -> None: ...

class Detections(_message.Message):
    __slots__ = ("timestamp", "frame_id", "detector", "objects")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    DETECTOR_FIELD_NUMBER: _ClassVar[int]
    OBJECTS_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    frame_id: str
    detector: str
    objects: _containers.RepeatedCompositeFieldContainer[Detection]
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., frame_id: _Optional[str] = ..., detector: _Optional[str] = ..., objects: _Optional[_Iterable[_Union[Detection, _Mapping]]] = ...) -> None: ...

class Estimate(_message.Message):
    __slots__ = ("track_id", "class_name", "box", "score", "method", "depth_m", "depth_std_m", "height_m", "height_std_m", "height_assumed", "range_m", "x_m", "y_m", "quality")
    TRACK_ID_FIELD_NUMBER: _ClassVar[int]
    CLASS_NAME_FIELD_NUMBER: _ClassVar[int]
    BOX_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    METHOD_FIELD_NUMBER: _ClassVar[int]
    DEPTH_M_FIELD_NUMBER: _ClassVar[int]
    DEPTH_STD_M_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_STD_M_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_ASSUMED_FIELD_NUMBER: _ClassVar[int]
    RANGE_M_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    QUALITY_FIELD_NUMBER: _ClassVar[int]
    track_id: int
    class_name: str
    box: BoundingBox
    score: float
    method: str
    depth_m: float
    depth_std_m: float
    height_m: float
    height_std_m: float
    height_assumed: bool
    range_m: float
    x_m: float
    y_m: float
    quality: float
    def __init__(self, track_id: _Optional[int] = ..., class_name: _Optional[str] = ..., box: _Optional[_Union[BoundingBox, _Mapping]] = ..., score: _Optional[float] = ..., method: _Optional[str] = ..., depth_m: _Optional[float] = ..., depth_std_m: _Optional[float] = ..., height_m: _Optional[float] = ..., height_std_m: _Optional[float] = ..., height_assumed: _Optional[bool] = ..., range_m: _Optional[float] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., quality: _Optional[float] = ...) -> None: ...

class Estimates(_message.Message):
    __slots__ = ("timestamp", "frame_id", "frame_index", "run_id", "objects")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    FRAME_INDEX_FIELD_NUMBER: _ClassVar[int]
    RUN_ID_FIELD_NUMBER: _ClassVar[int]
    OBJECTS_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    frame_id: str
    frame_index: int
    run_id: str
    objects: _containers.RepeatedCompositeFieldContainer[Estimate]
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., frame_id: _Optional[str] = ..., frame_index: _Optional[int] = ..., run_id: _Optional[str] = ..., objects: _Optional[_Iterable[_Union[Estimate, _Mapping]]] = ...) -> None: ...
