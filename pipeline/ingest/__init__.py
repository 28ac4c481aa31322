"""Frames from the bytes of a recording, each with all that belongs to its time.

mcap_records:   bytes -> messages, past damage
decode/:        one message -> one record of `pipeline.core.records`, whatever its encoding
channels:       which decoder a channel needs
exposure:       lens and exposure values, each checked against physics
named_exposure: those that a camera file finds in other channels
lanes:          messages of one kind by time: nearest, or last known
videos:         video streams -> pictures; video_stream: one of them
pose:           transforms -> the camera above the ground
frames:         messages -> frames in order of time, cameras apart
lens:           what a recording and a camera file together say of a lens
survey:         what is in a recording, without decoding a picture
video, photos:  video files and photos -> a recording
"""
