"""From the bytes of a recording to frames with all that belongs to their time.

mcap_records: bytes -> messages, past damage
messages:     one message -> one record of `pipeline.records`
exposure:     lens and exposure values, each checked against physics
lanes:        messages of one kind by time: nearest, or last known
frames:       messages -> frames in order of time, cameras apart
lens:         what a recording and a camera file together say of a lens
survey:       what is in a recording, without decoding a picture
video:        a video file -> a recording
"""
