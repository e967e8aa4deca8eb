"""From errors of places to nm, and what a gamma that is left in does to heights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from designed import fringe_images, setup_of

from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.measurement.pattern_design.bias import gamma_bias_nm
from irtscots_cl.measurement.pattern_design.fringe_errors import Fringes
from irtscots_cl.measurement.pattern_design.heights import height_noise
from irtscots_cl.measurement.pattern_design.pixels import seen_pixels
from irtscots_cl.measurement.phase import fit_sinusoid
from irtscots_cl.measurement.screen_places import ScreenPlaces, surface_from_places


@pytest.fixture(scope="module")
def setup():
    return setup_of("sphere", 41)


@pytest.fixture(scope="module")
def seen(setup):
    return seen_pixels(setup)


@pytest.fixture(scope="module")
def heights(setup, seen):
    return height_noise(setup, seen, np.full((2, len(seen.bright)), 1e-3))


def test_nm_is_that_of_the_measurements_own_error_bars(seen, heights):
    """Other errors than the reference's, growing over the mirror, and larger along x."""
    reference = heights.reference
    grown = 1e-3 * (1 + 0.5 * (reference.x_mm / 532.0 + 1))
    bars = error_bars(replace(reference, place_errors_mm=(2 * grown, grown)))
    values = grown.ravel()[seen.pixels]
    found = heights.nm(np.stack([2 * values, values]))
    assert found == pytest.approx(rms(bars.height_mm, reference.height_mask) * 1e6, rel=0.03)  # of the draws


def test_pixels_without_a_place(heights, seen):
    errors = np.full((2, len(seen.bright)), 2e-3)
    whole = heights.nm(errors)
    errors[0, 3] = np.inf
    assert heights.nm(errors) == pytest.approx(whole)
    errors[0, : len(seen.bright) // 20] = np.inf
    assert heights.nm(errors) == np.inf


@pytest.mark.parametrize(("steps", "gamma"), [(4, 2.2), (3, 1.3)])
def test_gamma_bias_is_that_of_simulated_images(setup, seen, heights, steps, gamma):
    """The same fringes shown with and without the gamma, their phases taken as they are."""
    mask, found = heights.reference.mask, []
    for shown in (1.0, gamma):
        stack = fringe_images(setup, (0.9,), steps, gamma=shown)
        found.append([fit_sinusoid(images[:, mask], np.array(s)).phase_rad
                      for number in range(2) for _, s, images in stack.series(number)])  # fmt: skip
    places = []
    for axis, place in enumerate((heights.reference.centroid_x_mm, heights.reference.centroid_y_mm)):
        moved = place.copy()
        difference = np.angle(np.exp(1j * (found[1][axis] - found[0][axis])))
        moved[mask] += seen.width_mm(axis) * difference / (2 * np.pi * 0.9)
        places.append(moved)
    error = np.where(mask, 1.0, np.nan)
    result = surface_from_places(ScreenPlaces(*places, error, error), setup, method="cubic", pixel_average=False)
    height = remove_terms(result.x_mm, result.y_mm, result.deviation_mm, result.height_mask, "piston_tilt")
    expected = rms(height, result.height_mask) * 1e6
    assert expected > 1.0
    assert gamma_bias_nm(Fringes("", (0.9,), steps), gamma, seen, heights.reference) == pytest.approx(expected, rel=0.1)
