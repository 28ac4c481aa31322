"""A long recording cut into windows of time that are measured side by side and stitched."""
