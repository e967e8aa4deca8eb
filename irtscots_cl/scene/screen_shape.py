"""A screen that is not a bare plane: the tables [screen.shape], [screen.cover_glass] and [screen.lines].

Only scenes with one of these tables import this module.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, Strict, model_validator

from irtscots_cl.scene.validation import MAX_PIXELS_PER_AXIS, PositiveMm, array_of, bounded, checked, refuse

MAX_ORDER = 10  # of the sag's polynomial: that of a spline through eleven points along an axis
MAX_POINTS = 4096
MIN_POINTS = 4  # to span an area and its twist
_Power = Annotated[int, Strict(), Field(ge=0, le=MAX_ORDER)]
_Length = Annotated[float, Strict(), Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
_Share = Annotated[float, Strict(), Field(ge=-1.0, le=2.0, allow_inf_nan=False)]
_Step = Annotated[int, Strict(), Field(ge=1, lt=MAX_PIXELS_PER_AXIS)]
_First = Annotated[int, Strict(), Field(ge=0, lt=MAX_PIXELS_PER_AXIS)]
Terms = Annotated[
    tuple[tuple[_Power, _Power, _Length], ...],
    *array_of(f"an array of [i, j, mm]: powers whose sum is at most {MAX_ORDER}, and a finite number within 1e6"),
]
Fractions = Annotated[
    tuple[tuple[_Share, _Share], ...],
    *array_of("an array of [x, y]: 0 to 1 across the pixel grid, numbers from -1 to 2"),
]
Points = Annotated[
    tuple[tuple[_Length, _Length] | tuple[_Length, _Length, _Length], ...],
    *array_of("an array of [x, y] or of [x, y, z] in the screen's frame, finite numbers within 1e6"),
]


@checked("shape")
class ScreenShape:
    """Where the pixels of a screen are, in the screen's frame.

    sag_mm: terms (i, j, c) of the height c (u/U)^i (v/V)^j of the pixel at (u, v) of the grid, U and V half the grid's
    width and height; or measured points: points_mm are where the places `fractions` (0 to 1 across the grid) are.
    interpolation: between the points, "smooth" (a cubic spline through a rectangular grid of them, a thin plate through
    others) or "linear".

    Raises SceneError for a value that is not allowed.
    """

    sag_mm: Terms = ()
    fractions: Fractions = ()
    points_mm: Points = ()
    interpolation: Annotated[str, Field(pattern="^(smooth|linear)$", description="smooth or linear")] = "smooth"

    @model_validator(mode="after")
    def _check(self) -> ScreenShape:
        if bool(self.sag_mm) == bool(self.points_mm):
            refuse(("sag_mm",), self.sag_mm, "be given, or points_mm, and not both")
        for i, j, _ in self.sag_mm:
            if i + j > MAX_ORDER:
                refuse(("sag_mm",), [i, j], f"have powers whose sum is at most {MAX_ORDER}")
        if len(self.fractions) != len(self.points_mm):
            must = f"be as many as points_mm ({len(self.points_mm)})"
            refuse(("fractions",), f"{len(self.fractions)} places", must)
        if self.points_mm and not MIN_POINTS <= len(self.points_mm) <= MAX_POINTS:
            refuse(("points_mm",), f"{len(self.points_mm)} points", f"be {MIN_POINTS} to {MAX_POINTS} points")
        if len({len(point) for point in self.points_mm}) > 1:
            refuse(("points_mm",), "mixed", "all be [x, y] or all be [x, y, z]")
        if len(set(self.fractions)) < len(self.fractions):
            twice = next(place for k, place in enumerate(self.fractions) if place in self.fractions[:k])
            refuse(("fractions",), twice, "be given once")
        return self


@checked("cover_glass")
class CoverGlass:
    """A plane-parallel plate on the pixels, on the mirror's side. Its losses are not modelled: radiance is outside it.

    Raises SceneError for a value that is not allowed.
    """

    thickness_mm: PositiveMm
    index: Annotated[float, Strict(), bounded(ge=1, le=3)] = 1.5


@checked("lines")
class ScanLines:
    """The lines of a scan: pixels first_px + k step_px and the next width_px - 1 light up in frame k.

    Raises SceneError for a value that is not allowed.
    """

    step_px: Annotated[_Step, Field(description=f"an integer from 1 to {MAX_PIXELS_PER_AXIS - 1}")] = 1
    width_px: Annotated[_Step, Field(description=f"an integer from 1 to {MAX_PIXELS_PER_AXIS - 1}")] = 1
    first_px: Annotated[_First, Field(description=f"an integer from 0 to {MAX_PIXELS_PER_AXIS - 1}")] = 0

    def count(self, pixels: int) -> int:
        """Number of lines of a scan along an axis of so many pixels: those that lie wholly on the screen."""
        return max((pixels - self.first_px - self.width_px) // self.step_px + 1, 0)


def check_lines(lines: Any, pixels: tuple[int, int]) -> None:
    """Raise the error that a checked dataclass turns into a SceneError, if a scan has fewer than three lines."""
    for count, axis in zip(pixels, ("x", "y"), strict=True):
        if lines.count(count) < 3:
            must = f"leave at least three whole lines of {lines.width_px} pixels on the {count} of the {axis} scan"
            refuse(("lines", "step_px"), lines.step_px, must)
