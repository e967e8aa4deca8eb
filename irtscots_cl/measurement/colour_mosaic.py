"""A colour camera's mosaic in images that their files call grey: pixels of each square of four that differ alike."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.quality import OK, WARNING, Check

UNEQUAL = 0.1  # of the mean: difference between the four places of a square, from which on it is named
BRIGHT = 0.3  # of the brightest parts: squares that are looked at
LEAST = 20  # squares


def check_mosaic(light: FloatArray) -> Check:
    """Whether every second pixel is brighter. light: [rows, columns] without the fringes, such as a white frame."""
    rows, columns = (n // 2 * 2 for n in light.shape)
    squares = light[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2).transpose(0, 2, 1, 3).reshape(-1, 4)
    means = squares.mean(1)
    known = np.isfinite(means)
    level = np.percentile(means[known], 98) if known.any() else 0.0
    chosen = squares[known & (np.nan_to_num(means) > BRIGHT * level)]
    if len(chosen) < LEAST or not level > 0:
        return Check("mosaic", OK, 0.0, UNEQUAL, 1e-6, "too few bright pixels to look for a colour mosaic")
    shares = np.median(chosen / chosen.mean(1, keepdims=True), axis=0)
    value = float(np.ptp(shares))
    if value <= UNEQUAL:
        return Check("mosaic", OK, value, UNEQUAL, 1e-6, "the pixels are those of a grey camera")
    told = ", ".join(f"{share:.2f}" for share in shares)
    text = (
        f"the pixels of every square of four have {told} of its light: a colour camera's mosaic (Bayer) saved as grey? "
        "Use one channel, or give flat frames"
    )
    return Check("mosaic", WARNING, value, UNEQUAL, 1e-6, text)
