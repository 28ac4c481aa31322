"""Dashboards: the Rerun timeline of a recording, the accuracy report, and the review of recordings."""
