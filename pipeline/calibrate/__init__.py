"""Calibration, which turns pixels into metres: from truth, or from people who walk.

from_truth:   k by aperture, one object size, Eq. 17 and size priors, from observations with truth
regression:   linear fits with standard errors, robust fits, and their errors out of sample
truth_table:  what from_truth takes, from the tables of a stored recording
walkers:      the camera's pose above the ground, from tracks of people
camera_file:  the `camera.toml` that keeps what was found
"""
