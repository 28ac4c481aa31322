"""Truth that comes beside a recording, and how well detections and tracks agree with it.

files of truth -> rows -> database -> one assignment a frame -> counts, which views add up
"""
