"""Table of the methods by which a depth comes about.

Whoever runs, fuses, draws, exports or lists methods reads it; a new method is a file in this folder and a
row here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pipeline.core.calibration import CalibratedMethod
from pipeline.core.config import Config
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.methods import aperture, defocus, ground, inverse, size
from pipeline.estimate.types import Estimated

GROUND, FUSED = "ground", "fused"


@dataclass(frozen=True, slots=True)
class Method:
    """One way to a depth.

    `name` is what tables and files call it. `estimate` is None for what is made of all the others.

    `reads` is what it reads of the picture: methods that read the same have its error in common, so
    fusion does not take them for independent.

    `order` says which estimate stands for an observation where one must: the lowest, which assumes the
    least. It is the order of legends and lists too.

    `calibration` is the kind of calibration that it needs; None if it can do without. `by_f_number` names
    the parameter of that calibration that is a table over f-numbers.

    `asks_others`: it is run after the methods without, and told what they made (`Geometry.earlier`).
    """

    name: str
    estimate: Callable[[Geometry, Config], Estimated] | None
    reads: str
    order: int
    text: str
    colour: str  # of the palette of Okabe and Ito (2008), without the vermilion that means an error
    calibration: CalibratedMethod | None = None
    by_f_number: str = ""
    asks_others: bool = False


METHODS = (
    Method(
        "aperture",
        aperture.estimate,
        reads="box",
        order=3,
        text="Eq. 16: size in the picture, focal length, aperture, and the constant k",
        colour="#009E73",  # bluish green
        calibration=CalibratedMethod.APERTURE,
        by_f_number="k",
    ),
    Method(
        "inverse",
        inverse.estimate,
        reads="box",
        order=4,
        text="Eq. 17: a line in the inverse of the size in the picture",
        colour="#F0E442",  # yellow
        calibration=CalibratedMethod.INVERSE,
    ),
    Method(
        "size",
        size.estimate,
        reads="box",
        order=5,
        text="the size in the picture against the usual size of such an object",
        colour="#CC79A7",  # reddish purple
    ),
    Method(
        GROUND,
        ground.estimate,
        reads="foot",
        order=1,
        text="the ray through the feet meets the ground",
        colour="#56B4E9",  # sky blue
    ),
    Method(
        "defocus",
        defocus.estimate,
        reads="blur",
        order=2,
        text="how far the edges are blurred",
        colour="#0072B2",  # blue
        asks_others=True,
    ),
    Method(
        FUSED,
        None,
        reads="",
        order=0,
        text="the methods that apply, weighted by their precision and smoothed along the track",
        colour="#E69F00",  # orange
    ),
)

_BY_NAME = {method.name: method for method in METHODS}
IN_ORDER = tuple(sorted(METHODS, key=lambda method: method.order))
NAMES = tuple(method.name for method in IN_ORDER)  # the one that stands for an observation first


def method_named(name: str) -> Method:
    """Return the row of a method; KeyError where there is none."""
    return _BY_NAME[name]


def in_order(names: set[str]) -> list[str]:
    """Return names of methods in the order of the table; those that it does not know come last."""
    return [name for name in NAMES if name in names] + sorted(names - set(NAMES))
