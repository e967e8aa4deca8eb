"""Small stacks of fringe images in closed form: a round mirror, uneven brightness, noise of read-out and of light."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from irtscots_cl.imaging.fringes import FringeSet, FringeStack

SHAPE = (40, 44)
DARK = 20.0
SETS = tuple(FringeSet.equal(axis, (0.9, 3.2), 4) for axis in "xy")


def disk():
    row, column = np.indices(SHAPE)
    return np.hypot(row - 19.5, column - 21.5) < 15.2


def place(axis: str):
    """Fractions [rows, columns] of the screen."""
    row, column = np.indices(SHAPE)
    return 0.5 + 0.021 * (column - 21.5) if axis == "x" else 0.48 + 0.02 * (row - 19.5)


def fringe_stack(
    sets=SETS,
    *,
    light=1000.0,
    read=1.5,
    electrons=4.0,
    gamma=1.0,
    gains=None,
    seed=1,
    uneven=0.3,
    blur=0.0,
    seen=1.0,
    **options,
):
    """electrons: per count; 0 for no noise of light. gains: of the frames. uneven: part of the brightness that is lost
    from the first to the last column. blur: of the mirror's rim, in pixels. seen: share of the usual part of the screen
    that the light comes from. options: of FringeStack."""
    random = np.random.default_rng(seed)
    bright = light * disk() * (1 - uneven * np.indices(SHAPE)[1] / SHAPE[1])
    bright = gaussian_filter(bright, blur) if blur else bright
    clean = []
    for one in sets:
        values = one.values((0.45 + seen * (place(one.axis) - 0.45)).ravel()).reshape(-1, *SHAPE)
        clean += [bright * value**gamma for value in values]
    shown = DARK + np.array(clean) * (1.0 if gains is None else np.reshape(gains, (-1, 1, 1)))
    sigma = np.sqrt(read**2 + (shown / electrons if electrons else 0.0))
    frames = shown + sigma * random.standard_normal(shown.shape)
    dark = DARK + read * random.standard_normal(SHAPE) * 0.1
    return FringeStack(sets, frames, dark=dark, white=DARK + bright, **options)
