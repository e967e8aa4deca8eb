"""Chords through the camera's aperture, and the rims' rays that they come from, against rays of their own."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import with_part
from tracers import setup_of

from irtscots_cl.optics.aperture_rims import RIM
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.pixel.aperture_chords import Chords
from irtscots_cl.scene.presets import load_scene


@pytest.mark.parametrize("name", ["sphere-deviated", "off-axis", "vista-secondary"])
def test_light_moves_along_one_axis_of_the_screen_over_a_chord(name):
    """As the chord says, to third order; the places at both ends and in the middle tell linear and quadratic terms."""
    chief = setup_of(load_scene(name)).chief_rays
    pixels = np.flatnonzero(chief.sees_mirror)[::97]
    chords, radius = Chords.of(chief, pixels), chief.scene.camera.aperture_diameter_mm / 2
    row, column = np.divmod(pixels, chief.shape[1])
    for k in range(2):
        a, b = chords.normal[..., k] * radius
        np.testing.assert_allclose(np.hypot(a, b), radius)
        low, middle, high = (chief.reverse(row, column, s * a, s * b) for s in (-1, 0, 1))
        size = np.abs(chords.slope[:, k]).max()
        along, across = (low[1 + k], middle[1 + k], high[1 + k]), (low[2 - k], high[2 - k])
        np.testing.assert_allclose((along[2] - along[0]) / 2, chords.slope[:, k], atol=1e-5 * size)  # third order
        bend = (along[2] + along[0]) / 2 - along[1]
        np.testing.assert_allclose(bend, chords.bend[:, k], atol=1e-5 * size)  # fourth order
        assert np.abs(across[1] - across[0]).max() < 2e-5 * size  # third order
        move = (high[0] - low[0])[:, :2].T / 2
        np.testing.assert_allclose(move, chords.mirror[..., k], atol=1e-6 * radius)  # third order


def test_the_weight_grows_along_a_chord_as_cos4_does():
    chief = setup_of(load_scene("sphere")).chief_rays
    pixels = np.flatnonzero(chief.sees_mirror)[::211]
    chords, camera = Chords.of(chief, pixels), chief.scene.camera
    x, y = (v / camera.image_distance_mm for v in chief.camera_model.image_point(*np.divmod(pixels, chief.shape[1])))
    step = 1e-3 * camera.aperture_diameter_mm / 2 / camera.focus_mm
    for k in range(2):
        a, b = chords.normal[..., k] * step
        weights = [(1 + (s * a - x) ** 2 + (s * b - y) ** 2) ** -2 for s in (-1, 1)]
        growth = (weights[1] - weights[0]) / (weights[1] + weights[0])
        np.testing.assert_allclose(growth, 1e-3 * chords.growth[:, k], rtol=1e-6, atol=1e-12)  # second order


def test_a_pixel_whose_rays_miss_the_surface_has_chords_of_no_length():
    """The surface ends at 580 mm, and the detector looks at 600 mm."""
    scene = with_part(load_scene("sphere"), "mirror", radius_mm=580.0, diameter_mm=800.0)
    chief = setup_of(scene).chief_rays
    pixels = np.arange(125 * 125)
    points, u, _ = chief.reverse(*np.divmod(pixels, 125))
    assert 1000 < np.isnan(points[:, 0]).sum() < 2000  # the corners of the detector
    missed = np.isnan(u)  # or they do not come to the screen
    chords = Chords.of(chief, pixels)
    for values in (chords.normal, chords.slope, chords.bend, chords.growth, chords.mirror):
        assert (values[..., missed, :] == 0).all()
    whole = np.isfinite(chief.rims.at(pixels)[1]).all(-1) & ~missed
    assert whole.sum() > 5000 and np.abs(chords.normal[:, whole]).max(0).min() > 0.1


def test_rims_are_of_the_pixels_near_the_mirror_and_those_of_single_rays():
    """Half of the detector looks past the mirror."""
    scene = with_part(load_scene("sphere-deviated"), "mirror", diameter_mm=600.0)
    chief = ChiefRays(scene)
    rims = chief.rims
    seen = np.flatnonzero(chief.sees_mirror)
    assert len(rims.pixels) < 0.6 * 125**2
    assert np.isin(seen, rims.pixels).all()
    points, u, v = rims.at(seen)
    a, b = scene.camera.aperture_diameter_mm / 2 * RIM.T
    row, column = np.divmod(seen[:, None], 125)
    for found, alone in zip((points, u, v), chief.reverse(row, column, a, b), strict=True):
        np.testing.assert_array_equal(found, alone)
    far = np.setdiff1d(np.arange(125**2), rims.pixels)[:3]
    assert all(np.isnan(values).all() for values in rims.at(far))
    half = chief.rims.half_range(0)
    np.testing.assert_array_equal(half.ravel()[seen], (u.max(-1) - u.min(-1)) / 2)
    assert np.isnan(half.ravel()[far]).all()


def test_the_pixels_that_see_the_mirror_are_those_with_rays_on_it():
    """Whole pixels are not asked: all of their rays are on it."""
    for name in ("sphere-deviated", "jwst-segment"):
        chief = setup_of(load_scene(name)).chief_rays
        margin = chief._margin(chief.rims)
        np.testing.assert_array_equal(chief.sees_mirror, chief._footprint(margin).coverage > 0)
