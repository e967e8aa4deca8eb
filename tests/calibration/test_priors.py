"""What is known beforehand: covariances, distances, and the scene's table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lopsided import lopsided

from irtscots_cl.calibration.parameters import moved
from irtscots_cl.calibration.priors import Distance, Priors, default_priors, distance_gradient, scene_priors
from irtscots_cl.scene.calibration_known import Calibration
from irtscots_cl.scene.presets import load_scene


def test_a_distance_is_the_difference_of_two_places():
    scene = lopsided()
    names = ["camera.x_mm", "camera.z_mm", "screen.y_mm", "screen.tilt_x_rad", "mirror.z_mm"]
    for first, second in (("camera", "screen"), ("camera", "mirror"), ("mirror", "screen")):
        found = distance_gradient(scene, first, second, names)

        def distance(scene, ends=(first, second)):
            points = {"camera": scene.camera.position_mm, "screen": scene.screen.position_mm, "mirror": (0.0, 0.0, 0.0)}
            return np.linalg.norm(np.subtract(points[ends[0]], points[ends[1]]))

        expected = [(distance(moved(scene, {n: 1e-3})) - distance(moved(scene, {n: -1e-3}))) / 2e-3 for n in names]
        np.testing.assert_allclose(found, expected, atol=1e-6)  # second order of the differences


def test_the_covariance_of_independent_unknowns_and_of_a_known_distance():
    scene = load_scene("sphere")
    sigma = {"camera.x_mm": 0.5, "screen.x_mm": 2.0, "screen.clocking_rad": 1e-3}
    root = Priors(sigma).root(scene)
    np.testing.assert_allclose(root @ root.T, np.diag(np.square(list(sigma.values()))), rtol=1e-14)  # rounding
    root = Priors(sigma, (Distance("camera", "screen", 0.01),)).root(scene)
    covariance = root @ root.T
    apart = np.array([-1.0, 1.0, 0.0])  # the presets' devices stand 436 mm apart along x
    prior = 0.5**2 + 2.0**2
    assert apart @ covariance @ apart == pytest.approx(1 / (1 / prior + 1 / 0.01**2), rel=1e-9)
    together = np.array([2.0**2, 0.5**2, 0.0])  # uncorrelated with the distance: what it says nothing about
    assert covariance[2, 2] == pytest.approx(1e-6)
    information = np.linalg.inv(covariance)
    expected = np.diag(1 / np.square(list(sigma.values()))) + np.outer(apart, apart) / 0.01**2
    np.testing.assert_allclose(information, expected, rtol=1e-6)
    assert together @ expected @ apart == pytest.approx(together @ information @ apart, rel=1e-6)


def test_the_default_leaves_the_mirror_out():
    priors = default_priors(load_scene("sphere"))
    assert not [name for name in priors.names if name.startswith("mirror")]
    assert priors.sigma["camera.x_mm"] == 0.5 and priors.sigma["screen.tilt_x_rad"] == pytest.approx(np.pi / 1800)


def test_the_scenes_table_comes_first():
    scene = load_scene("sphere")
    assert scene_priors(scene) == default_priors(scene)
    table = Calibration(known={"camera.x_mm": 0.02, "camera to screen": 0.05, "zernike.4_um": 0.3})
    found = scene_priors(replace(scene, calibration=table))
    assert found.sigma["camera.x_mm"] == 0.02 and found.sigma["camera.y_mm"] == 0.5
    assert found.names[-1] == "zernike.4_um" and found.distances == (Distance("camera", "screen", 0.05),)


def test_bad_values_are_refused():
    scene = load_scene("sphere")
    table = Calibration(known={"camera.w_mm": 0.02})
    with pytest.raises(ValueError, match="calibration.known: unknown 'camera.w_mm': did you mean"):
        scene_priors(replace(scene, calibration=table))
    with pytest.raises(ValueError, match="prior of camera.x_mm = 0"):
        Priors({"camera.x_mm": 0.0})
    with pytest.raises(ValueError, match="'lens' must be one of camera, screen, mirror"):
        Distance("lens", "screen", 1.0)
    with pytest.raises(ValueError, match="from 'screen' to itself"):
        Distance("screen", "screen", 1.0)
    with pytest.raises(ValueError, match="sigma_mm = -1"):
        Distance("camera", "screen", -1.0)
