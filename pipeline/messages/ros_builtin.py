"""ROS' own definitions of the messages that are read, for files that hold none that can be used.

rosbag2 stores some definitions as IDL, and some writers leave them out. What is written here are
the fields in their order, as the packages common_interfaces and geometry2 define them.
"""

from __future__ import annotations

_LINE = "=" * 80
_HEADER = f"""
{_LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""

DEFINITIONS = {
    "sensor_msgs/CompressedImage": f"""
std_msgs/Header header
string format
uint8[] data
{_HEADER}""",
    "sensor_msgs/Image": f"""
std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
{_HEADER}""",
    "sensor_msgs/CameraInfo": f"""
std_msgs/Header header
uint32 height
uint32 width
string distortion_model
float64[] d
float64[9] k
float64[9] r
float64[12] p
uint32 binning_x
uint32 binning_y
RegionOfInterest roi
{_HEADER}{_LINE}
MSG: sensor_msgs/RegionOfInterest
uint32 x_offset
uint32 y_offset
uint32 height
uint32 width
bool do_rectify
""",
    "vision_msgs/LabelInfo": f"""
std_msgs/Header header
vision_msgs/VisionClass[] class_map
float32 threshold
{_LINE}
MSG: vision_msgs/VisionClass
uint16 class_id
string class_name
{_HEADER}""",
    "tf2_msgs/TFMessage": f"""
geometry_msgs/TransformStamped[] transforms
{_LINE}
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
{_LINE}
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{_LINE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{_LINE}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
{_HEADER}""",
}
