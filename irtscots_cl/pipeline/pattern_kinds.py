"""The kinds of patterns that `irtscots patterns` writes: their frames from a few numbers, or from the scene's light.

One function for each kind gives its series by axis, which imaging.sequences puts into an order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from irtscots_cl.imaging.dots import DotGrid
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.gray_code import GraySet
from irtscots_cl.imaging.line_pictures import LineSet
from irtscots_cl.imaging.sequences import fringe_series
from irtscots_cl.imaging.shown_frames import PICTURE, ShownFrame
from irtscots_cl.pipeline.show import fringe_sets, usual_light
from irtscots_cl.scene.model import Scene

DOT_ROOM = 1.3  # least distance of dots over the widths of a dot and of a pixel's light together
LEAST_DOT = 2.0  # pixels, of a dot's diameter
DOT_SHARE = 0.4  # of the width of a pixel's light: a dot's diameter
SHIFTS = 3  # of the dots along an axis
SeriesByAxis = dict[str, list[list[ShownFrame]]]


def sinusoids(scene: Scene, periods: Sequence[float] | None, steps: int) -> tuple[SeriesByAxis, tuple[FringeSet, ...]]:
    """Series of fringes, and their sets. periods: None for those that suit the scene."""
    sets = fringe_sets(scene, periods, steps)
    return {one.axis: list(fringe_series(one)) for one in sets}, sets


def line_set(scene: Scene, width: float | None, step: float | None, first: float | None) -> LineSet:
    """Lines of these numbers of pixels; None: as the scene's [screen.lines], else 1, 1 and 0. Raises ValueError."""
    own = scene.screen.lines
    usual = (1.0, 1.0, 0.0) if own is None else (float(own.width_px), float(own.step_px), float(own.first_px))
    given = (width, step, first)
    return LineSet(*(other if value is None else value for value, other in zip(given, usual, strict=True)))


def line_series(scene: Scene, lines: LineSet) -> SeriesByAxis:
    return {axis: [lines.series(axis, scene.screen.pixels[k])] for k, axis in enumerate("xy")}


def gray_codes(scene: Scene, cell_px: float | None, inverted: bool) -> tuple[GraySet, ...]:
    """Codes of cells so many pixels wide; None: of half the width of a usual pixel's light, rounded."""
    sets = []
    for k, (axis, (half_width, own)) in enumerate(zip("xy", usual_light(scene) if cell_px is None else [(0, 0)] * 2,
                                                      strict=True)):  # fmt: skip
        suits = max(1.0, float(round(math.hypot(half_width, own / 2) / scene.screen.pitch_xy_mm[k])))
        sets.append(GraySet(axis, scene.screen.pixels[k] / (suits if cell_px is None else cell_px), inverted))
    return tuple(sets)


def gray_series(codes: Sequence[GraySet], fringes: Sequence[FringeSet] = ()) -> SeriesByAxis:
    """The planes of each axis, then its fringes."""
    found: SeriesByAxis = {code.axis: [code.series()] for code in codes}
    for one in fringes:
        found[one.axis] += fringe_series(one)
    return found


def gray_and_fringes(
    scene: Scene, periods: float | None, steps: int, inverted: bool
) -> tuple[tuple[GraySet, ...], tuple[FringeSet, ...]]:
    """One number of periods for each axis, None for the most precise one, and the code that tells their order.

    Raises ValueError where a single period is on the screen: there is no order to tell.
    """
    if periods is None:
        sets = tuple(FringeSet.equal(one.axis, [max(one.periods)], steps) for one in fringe_sets(scene, None, steps))
    else:
        sets = tuple(FringeSet.equal(axis, [periods], steps) for axis in "xy")
    for one in sets:
        if one.periods[0] <= 1:
            raise ValueError(
                f"{one.axis} fringes of {one.periods[0]:g} periods over the screen need no Gray code; use --kind "
                "sinusoid"
            )
    return tuple(GraySet(one.axis, one.periods[0], inverted) for one in sets), sets


def dot_grid(scene: Scene, pitch: float | None, diameter: float | None, shifts: int | None) -> DotGrid:
    """Dots that stay apart in the camera's image, unless other numbers are given, in pixels. Raises ValueError."""
    shapes = zip(usual_light(scene), scene.screen.pitch_xy_mm, strict=True)
    widest = max((2 * half_width + own) / pixel for (half_width, own), pixel in shapes)
    if diameter is None:
        diameter = max(LEAST_DOT, float(round(DOT_SHARE * widest)))
    if pitch is None:
        pitch = float(math.ceil(DOT_ROOM * (widest + diameter)))
    return DotGrid(pitch, diameter, SHIFTS if shifts is None else shifts)


def picture_series(count: int) -> SeriesByAxis:
    return {"": [[ShownFrame(PICTURE)] * count]}
