"""The second harmonic of fringes in every pixel: where a screen, its reflections or a camera are not linear."""

from __future__ import annotations

import numpy as np

from irtscots_cl.imaging.fringes import FringeStack
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.screen_coordinates import ScreenCoordinates
from irtscots_cl.system import interruption

LEAST_SEEN = 0.25  # of a second harmonic's square, that the steps must show: with four, pixels near its zeros show none
AT_ONCE = 2**17  # pixels


def second_harmonic_maps(stack: FringeStack, found: ScreenCoordinates) -> dict[str, FloatArray]:
    """Second harmonic over the first [rows, columns] by axis, of the series of fewest periods, where blur takes least.

    Positive as a screen's gamma above 1 makes it: the part in phase with twice the first's phase, so that noise has no
    bias. NaN outside the mask, where samples are missing, and where the steps do not show it (three steps never do).
    """
    pixels = np.flatnonzero(found.mask)
    maps = {}
    for number, fringes in enumerate(stack.sets):
        one = found.axes[fringes.axis]
        lowest = int(np.argmin(fringes.periods))
        grid = np.full(stack.shape[0] * stack.shape[1], np.nan)
        images = next(images for k, (_, _, images) in enumerate(stack.series(number)) if k == lowest)
        steps = one.survey.steps_rad[lowest]
        basis = np.stack([np.ones_like(steps), np.cos(steps), np.sin(steps)], -1)
        rest = np.eye(len(steps)) - basis @ np.linalg.pinv(basis)
        flat = images.reshape(len(steps), -1)
        for first in range(0, len(pixels), AT_ONCE):
            interruption.check()
            part = pixels[first : first + AT_ONCE]
            raw = flat[:, part]
            values = np.where(raw < stack.saturation, raw, np.nan).astype(float)
            phase = one.survey.sign * one.phase_rad[lowest].ravel()[part].astype(float)
            shape = rest @ np.cos(2 * (phase - steps[:, None]))
            seen = np.square(shape).sum(0)
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = (shape * (rest @ values)).sum(0) / (seen * one.amplitude[lowest].ravel()[part])
            grid[part] = np.where(seen > LEAST_SEEN * len(steps), ratio, np.nan)
        maps[fringes.axis] = grid.reshape(stack.shape)
    return maps
