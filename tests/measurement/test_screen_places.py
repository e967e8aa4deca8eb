"""Heights from places on the screen, however they were found: against exact chief rays of the mirror as made."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.measurement.screen_places import ScreenPlaces, surface_from_places
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene


@pytest.fixture(scope="module")
def scenes():
    true = load_scene("sphere-deviated")
    return Setup(true), Setup(true.nominal())


def places_of(setup, error_mm=1e-3):
    """What each pixel's middle sees: the chief rays of a scene."""
    rows, columns = setup.chief_rays.shape
    grid = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    _, u, v = setup.chief_rays.reverse(*grid)
    error = np.full(u.shape, error_mm)
    return ScreenPlaces(u, v, error, error)


def height_error_nm(result, true):
    deviation, *_ = true.chief_rays.surface.deviation_at(result.x_mm, result.y_mm)
    left = remove_terms(result.x_mm, result.y_mm, result.deviation_mm - deviation, result.mask, "piston_tilt")
    return rms(left, result.mask) * 1e6


def test_exact_places_give_the_height(scenes):
    """Without the aperture: the design's chief rays of the pixels' middles are compared with the true ones."""
    true, nominal = scenes
    result = surface_from_places(places_of(true), nominal, aperture=False)
    # 0.3 nm of zonal integration, the rest is the change of the mirror point by the deviation's own slope
    assert height_error_nm(result, true) < 1.0
    assert result.mask.sum() > 9000 and result.light_curve == "places"
    np.testing.assert_array_equal(result.refused()["empty"], 0)


def test_the_design_gives_no_deviation(scenes):
    _, nominal = scenes
    result = surface_from_places(places_of(nominal), nominal, aperture=False)
    assert rms(result.deviation_mm, result.mask) < 1e-12
    assert (
        rms(result.slope_x - result.x_mm / np.sqrt(4166.747**2 - result.x_mm**2 - result.y_mm**2), result.mask) < 1e-12
    )


def test_error_bars_are_the_scatter(scenes):
    """Pulls of 9,793 slopes and of the height's rms, for places with noise of 2 um."""
    true, nominal = scenes
    exact, error = places_of(true, 2e-3), 2e-3
    random = np.random.default_rng(8)
    clean = surface_from_places(exact, nominal, aperture=False)
    noisy = ScreenPlaces(
        exact.u_mm + error * random.standard_normal(exact.u_mm.shape),
        exact.v_mm + error * random.standard_normal(exact.u_mm.shape),
        exact.u_error_mm,
        exact.v_error_mm,
    )
    result = surface_from_places(noisy, nominal, aperture=False)
    bars = error_bars(result)
    for axis in "xy":
        change = getattr(result, f"slope_{axis}") - getattr(clean, f"slope_{axis}")
        pulls = (change / getattr(bars, f"slope_{axis}"))[result.mask]
        assert abs(pulls.std() - 1) < 0.06 and abs(pulls.mean()) < 0.06  # 5 sigma of 9,793, and the draws' 3 %
    change = remove_terms(
        result.x_mm, result.y_mm, result.deviation_mm - clean.deviation_mm, result.mask, "piston_tilt"
    )
    # low orders carry most of it: about 10 degrees of freedom, so the ratio scatters by a quarter
    assert 0.4 < rms(change, result.mask) / rms(bars.height_mm, result.mask) < 1.9


def test_unknown_places_and_other_mirrors_are_left_out(scenes):
    true, nominal = scenes
    places = places_of(true)
    places.u_mm[60, 60] = np.nan
    places.v_error_mm[61, 61] = 0.0
    half = np.zeros(places.u_mm.shape, bool)
    half[:, 50:] = True
    result = surface_from_places(places, nominal, aperture=False, mirror=half)
    assert not result.mask[60, 60] and not result.mask[61, 61] and not result.mask[:, :50].any()
    assert result.mask[62, 62] and result.refused()["empty"] == 2


def test_maps_of_another_size_are_refused(scenes):
    _, nominal = scenes
    small = ScreenPlaces(*np.ones((4, 10, 20)))
    with pytest.raises(ValueError, match=r"camera.detector.pixels = \[125, 125\]: the images have \[20, 10\]"):
        surface_from_places(small, nominal)
    none = ScreenPlaces(*np.full((4, 125, 125), np.nan))
    with pytest.raises(ValueError, match="0 of the 9793 detector pixels on the mirror see a known place"):
        surface_from_places(none, nominal, aperture=False)
