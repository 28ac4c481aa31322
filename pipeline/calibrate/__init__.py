"""Finding what turns pixels into metres: from truth, or from people who walk.

walkers:   the camera's pose above the ground, from tracks of people
"""
