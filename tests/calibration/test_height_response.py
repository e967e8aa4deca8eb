"""Height maps that errors of the geometry make, against a separate calculation and against a whole measurement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from irtscots_cl.calibration.height_response import LEFT_AFTER, HeightResponse, by_terms
from irtscots_cl.calibration.jacobian import centroid_jacobian
from irtscots_cl.calibration.parameters import moved, zernike_names
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

# The preset `sphere`: nm rms with piston and tilt | + power | + astigmatism | + coma removed. From rays of a moved
# sphere in float64 and half vectors with the height fed back, integrated by polynomials to order 12: no code in common.
EXPECTED = {
    "camera x": ({"camera.x_mm": 0.1}, (12.404, 10.764, 6.228, 0.028)),
    "camera y": ({"camera.y_mm": 0.1}, (10.797, 10.797, 6.201, 0.025)),
    "camera z": ({"camera.z_mm": 0.1}, (118.401, 0.441, 0.377, 0.377)),
    "screen x": ({"screen.x_mm": 0.1}, (12.430, 10.774, 6.219, 0.028)),
    "screen y": ({"screen.y_mm": 0.1}, (10.770, 10.770, 6.243, 0.025)),
    "screen z": ({"screen.z_mm": 0.1}, (118.398, 0.442, 0.377, 0.377)),
    "both x": ({"camera.x_mm": 0.1, "screen.x_mm": 0.1}, (12.447, 12.447, 12.447, 0.038)),
    "both y": ({"camera.y_mm": 0.1, "screen.y_mm": 0.1}, (12.444, 12.444, 12.444, 0.038)),
    "both z": ({"camera.z_mm": 0.1, "screen.z_mm": 0.1}, (236.805, 0.882, 0.754, 0.754)),
    "mirror z": ({"mirror.z_mm": 0.1}, (236.805, 0.882, 0.754, 0.754)),
    "turned about x": ({"screen.tilt_x_rad": 1e-3}, (0.536, 0.536, 0.536, 0.003)),
    "turned about y": ({"screen.tilt_y_rad": 1e-3}, (0.530, 0.530, 0.530, 0.002)),
    "turned about z": ({"screen.clocking_rad": 1e-3}, (19.234, 19.234, 0.031, 0.031)),
    "pitch": ({"screen.pitch_relative": 1e-3}, (19.151, 19.151, 0.034, 0.034)),
    "apart in x": ({"camera.x_mm": 0.05, "screen.x_mm": -0.05}, (10.746, 8.790, 0.021, 0.021)),
    "apart in y": ({"camera.y_mm": 0.05, "screen.y_mm": -0.05}, (8.808, 8.808, 0.027, 0.016)),
    "apart in z": ({"camera.z_mm": 0.05, "screen.z_mm": -0.05}, (0.001, 0.001, 0.001, 0.001)),
}


@pytest.fixture(scope="module")
def sphere():
    return HeightResponse.of(Setup(load_scene("sphere")))


def heights_nm(response, setup, changes):
    """The height map [1, n] of changes {name: value}."""
    names = list(changes)
    jacobian = centroid_jacobian(setup, names, response.seen.pixels)
    return response.heights_mm((jacobian @ np.array([changes[name] for name in names]))[None]) * 1e6


@pytest.mark.parametrize("case", EXPECTED)
def test_the_sensitivities_of_the_sphere(sphere, case):
    changes, expected = EXPECTED[case]
    assert sphere.seen.mask.sum() == 9793
    found = sphere.left(heights_nm(sphere, load_scene("sphere"), changes))[0]
    # 0.2 %: the expected values are of finite changes; 0.003 nm: trapezoids instead of polynomials
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=3e-3)


@pytest.mark.parametrize("noll", [4, 5, 8, 11, 22])
@pytest.mark.parametrize("name", ["sphere", "off-axis"])
def test_a_deviation_of_the_mirror_is_found_as_it_is(name, noll):
    """The same rule makes heights of a mirror's own deviation: they are the deviation."""
    setup = Setup(load_scene(name))
    response = HeightResponse.of(setup, method="spline")
    found = heights_nm(response, setup, {zernike_names([noll])[0]: 1e-3})[0]
    seen, radius = response.seen, setup.scene.mirror.diameter_mm / 2
    expected = zernike(noll, seen.x_mm[seen.mask] / radius, seen.y_mm[seen.mask] / radius)
    error = response.without(found - expected, "piston_tilt")
    assert np.sqrt(np.mean(error**2)) < 3e-3  # of a nanometre rms: the integration's own error at the rim


def test_a_measurement_of_the_moved_test_makes_the_same_error():
    """Images of a moved test in closed form, measured as if it were the design: all of the chain."""
    scene, changes = load_scene("sphere"), {"camera.x_mm": 0.1, "screen.clocking_rad": 3e-4}
    detector = replace(scene.camera.detector, pixels=(63, 63), pitch_mm=0.037 * 125 / 63)
    scene = replace(scene, camera=replace(scene.camera, detector=detector))
    measured = []
    for sign in (1, -1):
        light = trace(moved(scene, {name: sign * value for name, value in changes.items()}), estimator="analytic")
        measured.append(reconstruct(light.images(LineScan(scene)), scene, light_curve="chord"))
    setup = Setup(scene)
    response = HeightResponse.of(setup)
    expected = response.seen.on_grid(heights_nm(response, setup, changes))[0]
    found = (measured[0].deviation_mm - measured[1].deviation_mm) / 2 * 1e6
    use = measured[0].mask & measured[1].mask & response.seen.mask
    assert use.sum() > 0.97 * response.seen.mask.sum()
    # each at its own points: those of pixels on the rim are the middle of the part that lies on the mirror
    seen, rest = response.seen, []
    for x, y, height in ((measured[0].x_mm, measured[0].y_mm, found), (seen.x_mm, seen.y_mm, expected)):
        basis = np.stack([np.ones(use.sum()), x[use], y[use]], -1)
        rest.append(height[use] - basis @ np.linalg.lstsq(basis, height[use])[0])
    assert np.sqrt(np.mean(rest[1] ** 2)) > 10  # nm: there is something to compare
    # 1.5 %: points of the rim are not where the centres of its pixels are; 0.3 % with twice as many pixels
    assert np.sqrt(np.mean((rest[0] - rest[1]) ** 2)) < 0.015 * np.sqrt(np.mean(rest[1] ** 2))


def test_terms_are_removed_one_after_the_other(sphere):
    seen = sphere.seen
    x, y = (v[seen.mask] / 532.0 for v in (seen.x_mm, seen.y_mm))
    rest = zernike(14, x, y)
    terms = [2 * x, 2 * zernike(4, x, y), 5 * x * y, 5 * zernike(8, x, y)]
    maps = np.stack([*(term + rest for term in terms), 1 + 0 * x])
    left = sphere.left(maps)
    pure = np.sqrt(np.mean(sphere.without(rest, LEFT_AFTER[-1]) ** 2))
    for row in range(4):  # each has only the rest left once its own terms are removed, and more before
        np.testing.assert_allclose(left[row, row:], pure, rtol=0.02)  # pixels: terms are not quite orthogonal
        assert (left[row, :row] > 1.02 * pure).all()
    np.testing.assert_allclose(left[4], 0.0, atol=1e-12)
    assert by_terms(left[0])["piston_tilt_power"] == left[0, 1]


def test_a_map_that_does_not_settle_is_refused(sphere):
    wrong = replace(sphere, by_height=sphere.by_height * 1e6)
    with pytest.raises(ValueError, match="does not settle in 40 rounds"):
        wrong.heights_mm(np.ones((1, 2, 9793)) * np.linspace(0, 1, 9793))
