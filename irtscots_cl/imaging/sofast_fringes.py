"""The fringes of a SOFAST measurement, in its own convention of the screen's fractions.

The screen shows cos(2 pi p s - k pi / 2) in the steps k = 0 to 3, s falling from 1 at the first to 0 at the last pixel,
both at the pixels' centres, from left to right and from top to bottom. SOFAST's fractions are x = s and y = 1 - s: x
grows to the left and y down on the screen as shown. In its display files these fractions stand beside the places in
metres, whose x and y grow as the fractions do.

docs/fringes.md says how this follows from measured data alone.
"""

from __future__ import annotations

from irtscots_cl.formats.sofast import STEPS, SofastMeasurement
from irtscots_cl.imaging.fringes import FringeSet, FringeStack


def sofast_fringes(measurement: SofastMeasurement, saturation: float | None = None) -> FringeStack:
    """The fringe images of a measurement. saturation: value at which the camera's pixels saturate; None: the highest
    value that the images' whole numbers can hold."""
    kind = measurement.frames.dtype
    if saturation is None:
        saturation = float(2 ** (8 * kind.itemsize) - 1) if kind.kind == "u" else float("inf")
    return FringeStack(
        (
            FringeSet.equal("y", measurement.periods_y, STEPS, reverse=True, ends="centres"),
            FringeSet.equal("x", measurement.periods_x, STEPS, ends="centres"),
        ),
        measurement.frames,
        measurement.dark,
        measurement.white,
        saturation,
    )
