"""The ground floor: optics as pure functions on numpy arrays. No I/O, nothing of the project above.

thin_lens:      Eqs. 1-10 of the paper, for any focus distance: image distance, blur, depth of field
defocus:        the blurred edge: a disc and a floor, its form, diffraction, what can be resolved
aperture_size:  Eq. 16, the paper's method: depth from aperture, k and the size on the sensor
object_size:    depth from a known size, Eq. 17, heights by Eq. 14 and by the exact magnification
exposure:       Eq. 15, exposure values, luminance
distortion:     what the lens does to directions, and back, as far as it is one to one
pinhole:        the camera: an ideal pinhole behind a lens with distortion
ground_plane:   a camera above flat ground: depth, height and position of what stands on it
silhouette:     from the outline of an upright person to the axis of the body
arrays:         what they share: float64, and no warnings about the unknown

The paper is SN Applied Sciences (2021) 3:595. Every name carries its unit; unknown is NaN, and NaN
in gives NaN out. Depth is the distance along the optical axis.
"""
