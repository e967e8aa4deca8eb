"""The gamma of a screen from images of fringes, with the design's light: its blur takes more of a harmonic than of the
first, so that the ratio in the images is not the screen's."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import root_scalar

from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.harmonics import GAMMAS, MIN_COMPLETE, SecondHarmonic, second_harmonic
from irtscots_cl.measurement.phase import fit_sinusoid
from irtscots_cl.measurement.shown_light import light_on_lines
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup

SAMPLE = 1500  # pixels
WIDEST = 256  # lines of the screen that a pixel's light may cover: beyond, blur by the screen's pixels is nothing
SETTLED = 1e-6


@dataclass(frozen=True)
class ScreenGamma:
    """value: the screen emits value^gamma; 1 where the images show none. standard_error: from the images' noise."""

    value: float = 1.0
    standard_error: float = 0.0


def screen_gamma(
    setup: Setup, fringes: FringeSet, number: int, place_mm: FloatArray, seen: SecondHarmonic
) -> ScreenGamma:
    """The gamma that makes the design's light show the second harmonic that was seen in a series.

    number: of the series. place_mm: [rows, columns] upright, where the pixels' light is along the fringes' axis. The
    harmonic is looked for in computed samples in the same way as in the images, so that what that does to it cancels.
    """
    found = ScreenGamma(seen.gamma, _slope(seen.ratio) * seen.standard_error)
    screen, k = setup.scene.screen, "xy".index(fringes.axis)
    pixels = np.flatnonzero(np.isfinite(place_mm))
    pixels = np.intersect1d(pixels, setup.pixel_light.pixels)[:: max(1, len(pixels) // SAMPLE)]
    if len(pixels) < MIN_COMPLETE:
        return found
    fractions, steps = fringes.pixel_fractions(screen.pixels[k]), np.array(fringes.steps_rad[number])
    one = FringeSet(fringes.axis, (fringes.periods[number],), (tuple(steps),), fringes.reverse, fringes.ends)
    values = one.values(fractions)
    light = PixelLight.of(setup.chief_rays, pixels)
    parts = light_on_lines(light, screen, fringes.axis, place_mm.ravel()[pixels])
    shares, lines = (np.concatenate(each, axis=1) for each in zip(*parts, strict=True))
    good = shares.sum(1) > 0
    if np.count_nonzero(good) < MIN_COMPLETE or shares.shape[1] > WIDEST:
        return found

    def ratio(gamma: float) -> float:
        samples = np.einsum("nl,fnl->fn", shares[good], (values**gamma)[:, lines[good]])
        return second_harmonic(samples, fit_sinusoid(samples, steps)).ratio

    try:
        root = root_scalar(lambda g: ratio(float(np.clip(g, *GAMMAS))) - seen.ratio, x0=seen.gamma,
                           x1=1.1 * seen.gamma, method="secant", rtol=SETTLED)  # fmt: skip
    except ValueError:
        return found
    gamma = float(root.root)
    if not root.converged or not GAMMAS[0] < gamma < GAMMAS[1]:
        return found
    slope = (ratio(1.01 * gamma) - ratio(0.99 * gamma)) / (0.02 * gamma)
    return ScreenGamma(gamma, seen.standard_error / abs(slope))


def _slope(ratio: float) -> float:
    """Change of the gamma with the ratio (gamma - 1) / (gamma + 2)."""
    return 3 / (1 - ratio) ** 2 if math.isfinite(ratio) else math.nan
