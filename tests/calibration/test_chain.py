"""Derivatives away from the scene, against differences of whole predictions."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from lopsided import lopsided

from irtscots_cl.calibration.jacobian import design_centroids
from irtscots_cl.calibration.known import GROUPS
from irtscots_cl.calibration.measured import from_maps
from irtscots_cl.calibration.parameters import known_parameters, moved, parameter, zernike_names
from irtscots_cl.optics.setup import Setup

SCENE = lopsided()
NAMES = (*known_parameters(SCENE), *zernike_names([4, 5, 8]))
RANDOM = np.random.default_rng(1)
FAR = {name: 2.0 * RANDOM.normal() * parameter(name, SCENE).scale for name in NAMES}


@cache
def measurement():
    """Pixels that see the mirror wherever the unknowns are."""
    rows, columns = Setup(SCENE).chief_rays.shape
    u, v = design_centroids(SCENE, SCENE).reshape(2, rows, columns)
    inside = np.min([Setup(s).chief_rays.footprint.coverage for s in (SCENE, moved(SCENE, FAR))], axis=0) > 0.99
    return from_maps(SCENE, np.where(inside, u, np.nan), v, 1.0, 1.0)


def differences(m, values, name):
    step = 1e-2 * parameter(name, SCENE).scale
    after, before = (m.predicted({**values, name: values[name] + sign * step}) for sign in (1, -1))
    return (after - before) / (2 * step)


@cache
def every_derivative():
    """Of the places by all unknowns, far from the scene."""
    return measurement().jacobian(FAR, NAMES, slice(None))


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_at_values_far_from_the_scene(name):
    m = measurement()
    found = every_derivative()[..., NAMES.index(name)]
    expected = differences(m, FAR, name)
    assert len(m.pixels) > 20 and np.abs(expected).max() > 0
    # what the third derivative leaves of the difference, and rounding of the places
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_a_part_of_the_turns_of_a_device_and_of_the_pixels():
    m = measurement()
    some = m.jacobian(FAR, ["camera.tilt_x_rad", "mirror.y_mm"], slice(3, 9))
    every = every_derivative()[:, 3:9]
    chosen = [NAMES.index(name) for name in ("camera.tilt_x_rad", "mirror.y_mm")]
    np.testing.assert_allclose(some, every[..., chosen], rtol=1e-12)


def test_the_groups_are_all_poses():
    for part in ("camera", "screen", "mirror"):
        assert len(GROUPS[part]) == 6 and set(GROUPS[part]) <= set(known_parameters(SCENE))
