"""The height noise that a method produces from white slope noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from irtscots_cl.maths.integration.methods import integrate_slopes
from irtscots_cl.maths.low_order import remove_terms, rms

DRAWS = 64
_AT_ONCE = 8  # maps, to limit memory


@dataclass(frozen=True)
class NoiseGain:
    """Rms height error, without piston and tilt, from white slope noise [nm per urad], and its standard error."""

    nm_per_urad: float
    standard_error: float


def noise_gain(
    x_mm: ArrayLike, y_mm: ArrayLike, mask: ArrayLike, method: str = "southwell", draws: int = DRAWS, seed: int = 0
) -> NoiseGain:
    """Noise gain of ``method`` on these nodes, from ``draws`` maps of Gaussian noise.

    The noise of dz/dx and dz/dy is independent, also between nodes, and 1 urad rms each. Piston and tilt are removed
    once over all nodes of the mask, not for each island; islands are not joined. x_mm, y_mm, mask: [rows, columns], see
    `integrate_slopes`.

    Raises ValueError for fewer than 2 draws or 3 nodes, and the errors of `integrate_slopes`.
    """
    if draws < 2:
        raise ValueError(f"draws = {draws}: must be at least 2, for a standard error")
    x_mm, y_mm, mask = np.asarray(x_mm), np.asarray(y_mm), np.asarray(mask)
    random = np.random.default_rng(seed)
    squares: list[float] = []
    while len(squares) < draws:
        slope_x, slope_y = random.standard_normal((2, min(_AT_ONCE, draws - len(squares)), *mask.shape))
        for height in integrate_slopes(x_mm, y_mm, slope_x, slope_y, mask, method, join=False):
            squares.append(rms(remove_terms(x_mm, y_mm, height, mask, "piston_tilt"), mask) ** 2)
    gain = np.sqrt(np.mean(squares))  # mm per rad is nm per urad
    return NoiseGain(float(gain), float(np.std(squares, ddof=1) / np.sqrt(draws) / (2 * gain)))
