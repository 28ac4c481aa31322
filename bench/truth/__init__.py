"""Accuracy on recordings with truth that are not in the repository."""
