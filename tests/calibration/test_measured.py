"""Measurements: maps that are taken, and how shared unknowns act in each."""

from __future__ import annotations

import math

import numpy as np
import pytest
from calibrations import measured, paraboloid

from irtscots_cl.calibration.measured import all_names, from_maps, own_name, shares_of
from irtscots_cl.calibration.parameters import moved, zernike_names
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.scene.presets import load_scene

SCENE = paraboloid(21)


def test_pixels_without_data_are_left_out():
    u = np.full((21, 21), 0.5)
    u[3, 4], errors = np.nan, np.full((21, 21), 1e-3)
    errors[5, 6] = 0.0
    m = from_maps(SCENE, u, u, errors, 1e-3)
    assert len(m.pixels) == 21 * 21 - 2 and not {3 * 21 + 4, 5 * 21 + 6} & set(m.pixels.tolist())
    on_grid = m.on_grid(m.places_mm)
    assert np.isnan(on_grid[:, 3, 4]).all() and (on_grid[:, 0, 0] == 0.5).all()


def test_maps_of_another_detector_are_refused():
    with pytest.raises(ValueError, match=r"^lab\.h5: v_mm has shape \(21, 20\); must be the detector's \(21, 21\)$"):
        from_maps(SCENE, np.zeros((21, 21)), np.zeros((21, 20)), 1.0, 1.0, name="lab.h5")


@pytest.mark.parametrize("turn_deg", [120.0, -35.0])
def test_a_turned_mirror_has_its_terms_turned(turn_deg):
    """Heights of the turned figure at a point are those of the figure where the point was before."""
    turn, nolls = math.radians(turn_deg), (4, 5, 6, 7, 8, 9, 10, 11, 14)
    names = zernike_names(nolls)
    m = measured(SCENE, {}, turn_rad=turn)
    shares = shares_of(m, names)
    values = np.random.default_rng(0).normal(size=len(names))
    local = shares.changes(values)
    x, y = np.random.default_rng(1).uniform(-0.7, 0.7, (2, 50))
    before_x, before_y = math.cos(turn) * x + math.sin(turn) * y, math.cos(turn) * y - math.sin(turn) * x
    expected = sum(v * zernike(noll, before_x, before_y) for v, noll in zip(values, nolls, strict=True))
    found = sum(v * zernike(int(name[8:-3]), x, y) for name, v in local.items())
    np.testing.assert_allclose(found, expected, atol=1e-13)  # rounding


def test_a_known_mirror_has_no_terms_of_its_own():
    m = measured(SCENE, {}, knows_mirror=True)
    shares = shares_of(m, ("camera.x_mm", "zernike.4_um"))
    assert shares.names == ("camera.x_mm",) and shares.matrix.tolist() == [[1.0, 0.0]]


def test_an_unknown_of_its_own_adds_to_the_shared_one():
    first, second = measured(SCENE, {}, name="a"), measured(SCENE, {}, name="b", own=("mirror.tilt_x_rad",))
    names = all_names(("mirror.tilt_x_rad", "camera.x_mm"), (first, second))
    assert names == ("mirror.tilt_x_rad", "camera.x_mm", own_name(second, "mirror.tilt_x_rad"))
    values = np.array([1e-3, 0.2, 2e-4])
    assert shares_of(first, names).changes(values) == {"mirror.tilt_x_rad": 1e-3, "camera.x_mm": 0.2}
    assert shares_of(second, names).changes(values) == pytest.approx({"mirror.tilt_x_rad": 1.2e-3, "camera.x_mm": 0.2})


def test_an_off_axis_mirror_cannot_be_turned():
    scene = load_scene("off-axis")
    rows, columns = scene.camera.detector.pixels[::-1]
    m = from_maps(scene, np.zeros((rows, columns)), np.zeros((rows, columns)), 1.0, 1.0, turn_rad=0.1, name="b")
    with pytest.raises(ValueError, match=r"^b: the mirror is turned, but mirror.off_axis_mm = .*revolution"):
        shares_of(m, ("zernike.4_um",))


def test_predictions_are_those_of_the_moved_scene():
    true = {"camera.x_mm": 0.3, "screen.pitch_relative": 1e-3, "zernike.6_um": 0.5}
    m = measured(SCENE, true, noise=1e-12)
    np.testing.assert_allclose(m.predicted(true), m.places_mm, atol=1e-10)
    assert moved(SCENE, true) != SCENE and np.abs(m.predicted({}) - m.places_mm).max() > 1e-3
