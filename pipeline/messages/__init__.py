"""Records from the bytes of messages, of any encoding that is read.

tree:        what every encoding is turned into first: a dictionary, read with checked accessors
protobuf, json_text, ros_schema, ros_wire:     bytes -> tree, one file an encoding
images, calibration, lens, boxes, truth, transforms:   tree -> record, one file a kind of message
registry:    which of them a channel needs, by its encoding and the name of its schema
numbers:     one number of any channel, by its path: how `camera.toml` names exposure values
exif:        what a picture says of its own exposure
"""
