"""How a real screen departs from an even and steady one: the table [screen.response].

Only scenes with that table import this module.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Strict

from irtscots_cl.scene.validation import MAX_PIXELS_PER_AXIS, Fraction, NumpyFile, Seed, array_of, bounded, checked

_Index = Annotated[int, Strict(), Field(ge=0, lt=MAX_PIXELS_PER_AXIS)]
_Coefficient = Annotated[float, Strict(), Field(ge=-1e3, le=1e3, allow_inf_nan=False)]
_SHARE = bounded(ge=0, le=1)
Indices = Annotated[tuple[_Index, ...], *array_of(f"an array of integers from 0 to {MAX_PIXELS_PER_AXIS - 1}")]
Polynomial = Annotated[
    tuple[_Coefficient, _Coefficient, _Coefficient, _Coefficient, _Coefficient],
    *array_of("[x, y, xx, xy, yy], five finite numbers within 1000"),
]
PixelList = Annotated[tuple[tuple[_Index, _Index], ...], *array_of("an array of [column, row], counted from 0")]
NO_POLYNOMIAL = (0.0, 0.0, 0.0, 0.0, 0.0)


@checked("response")
class ScreenResponse:
    """Factors on the radiance of a screen that lights single lines; each effect is off by default.

    brightness_polynomial: factor 1 + a x + b y + c x^2 + d x y + e y^2 for [a, b, c, d, e], x and y from -1 to 1 over
    the screen. A lit line has the grey level grey_level, and grey_level^gamma of the full radiance: gamma changes
    nothing where lines are full on (grey_level 1).
    drift: change of brightness over each scan, linear in the line's number, from 1 - drift / 2 to 1 + drift / 2.
    jitter: relative rms of the brightness from camera frame to camera frame.

    Raises SceneError for a value that is not allowed.
    """

    brightness_map: NumpyFile = None
    brightness_polynomial: Polynomial = NO_POLYNOMIAL
    grey_level: Fraction = 1.0
    gamma: Annotated[float, Strict(), bounded(gt=0, le=10)] = 1.0
    dead_pixels: PixelList = ()
    dead_columns: Indices = ()
    dead_rows: Indices = ()
    dead_pixel_share: Annotated[float, Strict(), _SHARE] = 0.0
    dead_line_share: Annotated[float, Strict(), _SHARE] = 0.0
    drift: Annotated[float, Strict(), bounded(ge=-1, le=1)] = 0.0
    jitter: Annotated[float, Strict(), bounded(ge=0, le=1)] = 0.0
    seed: Seed = 1

    @property
    def needs_map(self) -> bool:
        """Whether screen pixels of a line differ, which only a map of transport can tell apart."""
        return bool(
            self.brightness_map or self.dead_pixels or self.dead_columns or self.dead_rows or self.dead_pixel_share
            or self.dead_line_share or self.brightness_polynomial != NO_POLYNOMIAL
        )  # fmt: skip

    @property
    def level(self) -> float:
        """Factor on the radiance of every line."""
        return float(self.grey_level**self.gamma)

    @property
    def changes_frames(self) -> bool:
        """Whether whole frames differ from those of an even and steady screen."""
        return self.level != 1.0 or self.drift != 0.0 or self.jitter != 0.0
