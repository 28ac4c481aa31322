"""A recording with its results: the original messages, byte for byte, and ours.

results:      the rows of a recording's current run, frame by frame
annotations:  rows -> messages: boxes, objects, estimates, the ground
recording:    the file: copied as a stream, ours in between by time
"""
