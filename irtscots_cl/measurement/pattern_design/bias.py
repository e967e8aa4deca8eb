"""What a screen's gamma, left in the images, does to the height."""

from __future__ import annotations

import numpy as np

from irtscots_cl.imaging.fringes import equal_steps
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.harmonics import gamma_harmonics, phase_bias
from irtscots_cl.measurement.pattern_design.fringe_errors import Fringes
from irtscots_cl.measurement.pattern_design.pixels import COVERAGE, SeenPixels
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.screen_places import ScreenPlaces, surface_from_places

TAU = 2 * np.pi
NM = 1e6


def gamma_bias_nm(fringes: Fringes, gamma: float, seen: SeenPixels, reference: Reconstruction) -> float:
    """Rms height error in nm, piston and tilt removed, of the harmonics that the steps take for the first.

    reference: the design's surface. The series count as their modulations and periods weigh them; a harmonic is
    blurred as a sinusoid of its own number of periods is in a typical pixel.
    """
    screen, steps = seen.scene.screen, np.array(equal_steps(fringes.steps))
    mask = reference.mask
    moved = []
    for axis, place in enumerate((reference.centroid_x_mm, reference.centroid_y_mm)):
        width = seen.width_mm(axis)
        fraction = (place[mask] - screen.centre_offset_mm[axis]) / width + 0.5
        shift, whole = np.zeros(fraction.shape), 0.0
        for periods in fringes.periods:
            ratios = gamma_harmonics(gamma)
            first = _typical(seen, axis, periods)
            ratios[2:] *= [_typical(seen, axis, k * periods) / max(first, 1e-12) for k in range(2, len(ratios))]
            weight = (periods * first) ** 2
            shift += weight * phase_bias(TAU * periods * fraction, steps, ratios) / (TAU * periods)
            whole += weight
        found = place.copy()
        found[mask] += width * shift / whole
        moved.append(found)
    error = np.where(mask, 1.0, np.nan)
    result = surface_from_places(
        ScreenPlaces(moved[0], moved[1], error, error), reference.setup, method=reference.method, pixel_average=False,
        min_coverage=COVERAGE,
    )  # fmt: skip
    height = remove_terms(result.x_mm, result.y_mm, result.deviation_mm, result.height_mask, "piston_tilt")
    return rms(height, result.height_mask) * NM


def _typical(seen: SeenPixels, axis: int, periods: float) -> float:
    """Median modulation; none beyond the table."""
    return float(np.median(seen.modulation_at(axis, periods))) if periods <= seen.most_periods else 0.0
