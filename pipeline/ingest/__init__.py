"""Frames from the messages of a recording, each with all that belongs to its time.

sources:        reader of each channel
named_exposure: exposure values that a camera file finds in other channels
class_labels:   names that a recording states for numbers of classes
cameras:        names of cameras by topic and frame_id
clocks, pairing, partners, lanes, waiting: values to pictures by time
logged_behind:  messages that stand far behind the pictures that they belong to
pose:           transforms -> the camera above the ground
plausibility:   values that nothing real can have
video/:         video streams -> pictures
frames:         messages -> frames in order of time, cameras apart
survey:         content of a recording, without decoding a picture
"""
