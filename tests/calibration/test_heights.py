"""Heights from places, against figures that are put in and the oracle's own sensitivities."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from calibrations import inner_pixels, measured, paraboloid
from oracle import sensitivities
from scenes import coarse
from scipy.ndimage import label

from irtscots_cl.calibration import heights
from irtscots_cl.calibration.heights import TERMS, HeightGrid
from irtscots_cl.calibration.jacobian import design_centroids
from irtscots_cl.calibration.measured import from_maps
from irtscots_cl.calibration.parameters import moved
from irtscots_cl.maths.low_order import remove_terms
from irtscots_cl.optics.setup import Setup

SCENE = paraboloid(41)
ORACLE = json.loads(Path(sensitivities.__file__).with_suffix(".json").read_text())


def grid_of(measurement, scene=None) -> HeightGrid:
    return HeightGrid.of(measurement, scene or measurement.scene, np.ones(len(measurement.pixels), bool))


def heights_of(measurement, scene=None):
    grid = grid_of(measurement, scene)
    return grid, grid.heights(grid.maps(measurement.places_mm[:, grid.chosen]))


def test_a_mirror_as_designed_has_no_height():
    grid, height = heights_of(measured(SCENE, {}, noise=1e-15))
    assert grid.mask.sum() == inner_pixels(SCENE).sum()
    assert np.nanmax(np.abs(height)) < 1e-10  # 1e-4 nm: rounding


def test_a_figure_is_found_with_its_terms():
    figure = {"zernike.5_um": 0.2, "zernike.7_um": -0.1, "zernike.9_um": 0.05, "zernike.11_um": 0.1}
    grid, height = heights_of(measured(SCENE, figure, noise=1e-12))
    expected = [figure.get(f"zernike.{noll}_um", 0.0) for noll in TERMS]
    # pixels of 27 mm, and means over differences between them: 1 nm
    np.testing.assert_allclose(grid.coefficients(height) * 1e3, expected, atol=1e-3)


def test_the_right_geometry_finds_the_figure_too():
    true = {"camera.x_mm": 2.0, "screen.clocking_rad": 0.01, "screen.pitch_relative": 0.01, "camera.k1": 3.0}
    m = measured(SCENE, true | {"zernike.6_um": 0.2}, noise=1e-12)
    grid, height = heights_of(m, moved(SCENE, true))
    wrong = heights_of(m)[1]
    assert grid.coefficients(height)[TERMS.index(6)] * 1e3 == pytest.approx(0.2, abs=1e-3)
    assert np.nanstd(grid.without(wrong, "piston_tilt")) > 1e-3  # a micrometre and more


def test_a_design_that_is_changed_tells_heights_from_the_first_one():
    """The whole surface is what is measured: another vertex radius of the design changes nothing."""
    m = measured(SCENE, {"mirror.radius_relative": 1e-6}, noise=1e-12)
    grid, height = heights_of(m)
    other, same = heights_of(m, moved(SCENE, {"mirror.radius_relative": 1e-6}))
    assert np.nanstd(height) > 5e-6  # 5 nm
    np.testing.assert_allclose(grid.without(height, "piston_tilt")[grid.mask],
                               other.without(same, "piston_tilt")[other.mask], atol=2e-7)  # fmt: skip


@pytest.mark.parametrize("name", ["camera.x_mm", "camera.z_mm", "screen.x_mm", "screen.z_mm"])
def test_errors_of_the_geometry_cost_what_the_oracle_says(name):
    scene = coarse("sphere", 125)
    inside = Setup(scene).chief_rays.footprint.coverage >= 0.5
    u, v = design_centroids(moved(scene, {name: 0.1}), scene).reshape(2, *inside.shape)
    grid, height = heights_of(from_maps(scene, np.where(inside, u, np.nan), v, 1.0, 1.0))
    for terms in ("piston_tilt", "piston_tilt_power"):
        found = np.sqrt(np.mean(grid.without(height, terms)[grid.mask] ** 2)) * 1e6
        # the oracle's pixels are those whose centre is on the mirror
        assert found == pytest.approx(ORACLE[name]["self_consistent"][terms], rel=0.01, abs=0.05)


def test_noise_heights_are_the_differences_of_heights():
    m = measured(SCENE, {})
    grid = grid_of(m)
    noise = 1e-4 * np.random.default_rng(0).standard_normal((3, 2, len(grid.chosen)))
    landing = grid.landing_mm[:, None]
    expected = grid.heights(landing + np.moveaxis(grid.maps(noise), 1, 0)) - grid.heights(landing)
    found = grid.noise_heights(noise)
    level = np.nanstd(expected)
    np.testing.assert_allclose(found[:, grid.mask], expected[:, grid.mask], atol=0.02 * level)  # the feedback


@pytest.mark.parametrize("terms", ["piston_tilt", "piston_tilt_power"])
def test_low_orders_are_removed_as_elsewhere(terms):
    grid, height = heights_of(measured(SCENE, {"zernike.4_um": 0.1, "zernike.8_um": 0.2}))
    expected = remove_terms(*grid.mirror_mm, height, grid.mask, terms)
    np.testing.assert_allclose(grid.without(height, terms), expected, atol=1e-15)


def test_large_images_are_thinned(monkeypatch):
    monkeypatch.setattr(heights, "MOST_NODES", 120)
    m = measured(SCENE, {"zernike.5_um": 0.2}, noise=1e-12)
    grid, height = heights_of(m)
    assert grid.step == 3 and 60 < grid.mask.sum() <= 120 and grid.mask.shape == (14, 14)
    row, column = m.place_of(grid.chosen)
    assert set((row % 3).tolist()) == {1} == set((column % 3).tolist())
    assert grid.coefficients(height)[TERMS.index(5)] * 1e3 == pytest.approx(0.2, abs=2e-3)


@pytest.mark.parametrize("every", [2, 3])
def test_images_of_which_some_pixels_are_used_are_thinned_further(monkeypatch, every):
    """The grid is one of the pixels that there are, without holes."""
    monkeypatch.setattr(heights, "MOST_NODES", 60)
    m = measured(SCENE, {"zernike.5_um": 0.2}, noise=1e-12)
    row, column = m.place_of()
    kept = np.flatnonzero((row % every == every // 2) & (column % every == every // 2))
    some = dataclasses.replace(m, pixels=m.pixels[kept], places_mm=m.places_mm[:, kept], every=every,
                               errors_mm=m.errors_mm[:, kept], offsets_mm=m.offsets_mm[:, kept],
                               mirror_offsets_mm=m.mirror_offsets_mm[:, kept])  # fmt: skip
    grid, height = heights_of(some)
    assert grid.step % every == 0 and grid.step > every and 10 < grid.mask.sum() <= 60
    assert label(grid.mask)[1] == 1
    assert grid.coefficients(height)[TERMS.index(5)] * 1e3 == pytest.approx(0.2, abs=0.01)


def test_pixels_that_do_not_count_have_no_height():
    m = measured(SCENE, {})
    used = np.arange(len(m.pixels)) != 17
    grid = HeightGrid.of(dataclasses.replace(m), SCENE, used)
    assert grid.mask.sum() == used.sum() and 17 not in grid.chosen
