"""Error source: diffraction at the camera's aperture."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j0, j1, jn_zeros, jv
from small_budget import small_scene

from irtscots_cl.budget.diffraction import Diffraction, blurred, transfer
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw
from irtscots_cl.optics.setup import Setup

BLUR = 0.0088  # mm: 550 nm at f/16


def airy(radius_mm, blur_mm=BLUR):
    """Light per mm^2 of the Airy disk whose whole light is 1."""
    x = np.maximum(np.pi * np.asarray(radius_mm) / blur_mm, 1e-9)
    return np.pi / (4 * blur_mm**2) * (2 * j1(x) / x) ** 2


def moment_mm2(radius_mm, blur_mm=BLUR):
    """Second moment along an axis of the Airy disk's light within a radius, over all its light."""
    x = np.pi * radius_mm / blur_mm
    return (blur_mm / np.pi) ** 2 * x**2 / 2 * (jv(1, x) ** 2 - jv(0, x) * jv(2, x))


def test_first_dark_ring():
    """Of the disk that has this transfer function: by Hankel's integral."""
    radius = jn_zeros(1, 1)[0] / np.pi * BLUR
    assert radius == pytest.approx(1.21967 * BLUR, rel=1e-5)

    def light(r):
        return quad(lambda f: 2 * np.pi * f * transfer(f, BLUR) * j0(2 * np.pi * f * r), 0, 1 / BLUR, limit=200)[0]

    for r in (0.0, 0.5 * radius, 1.6 * radius):
        assert light(r) == pytest.approx(airy(r), rel=1e-6)
    assert abs(light(radius)) < 1e-6 * light(0.0)


@pytest.mark.parametrize("rings", [1.0, 7.3])
def test_second_moment_within_a_radius(rings):
    told, _ = quad(lambda r: np.pi * r**3 * airy(r), 0, rings * BLUR, limit=400)
    assert moment_mm2(rings * BLUR) == pytest.approx(told, rel=1e-8)


def test_means_are_those_of_a_sum_over_the_disk():
    """Light of places between linear interpolations, summed on a fine grid with the Airy disk's own density."""
    random, pitch, fine, size = np.random.default_rng(2), 0.02, 16, 9
    place = random.standard_normal((1, size, size))
    place[0, 1, 2:5] = place[0, :, 8] = np.nan
    light, values = np.isfinite(place[0]).astype(float), np.nan_to_num(place[0])
    at = (np.arange(-fine, fine * size) + 0.5) / fine  # pixels, from one before the first
    low = np.floor(at).astype(int)
    weight = np.zeros((len(at), size + 2))
    weight[np.arange(len(at)), low + 1] = 1 - (at - low)
    weight[np.arange(len(at)), low + 2] = at - low
    weight = weight[:, 1:-1]
    smooth_light, smooth_value = (weight @ values_ @ weight.T for values_ in (light, values))
    found = blurred(place, BLUR, np.array([pitch, pitch]))[0]
    for row, column in ((0, 0), (4, 4), (2, 3), (8, 7)):
        disk = airy(pitch * np.hypot(at[:, None] - row, at - column))
        told = np.sum(disk * smooth_value) / np.sum(disk * smooth_light)
        assert found[row, column] == pytest.approx(told, abs=3e-3)
    assert np.array_equal(np.isnan(found), np.isnan(place[0]))


def test_curved_places_move_by_the_moment_within_the_mirror():
    """In the middle of a round mirror of radius r: curvature times the second moment there, over the light there."""
    size, pitch, radius = 301, BLUR / 2, 60 * BLUR
    at = (np.arange(size) - size // 2) * pitch
    square = at[:, None] ** 2 + at**2
    place = np.where(square < radius**2, 0.7 * square, np.nan)
    found = blurred(place[None], BLUR, np.array([pitch, pitch]))[0, size // 2, size // 2]
    x = np.pi * radius / BLUR
    told = 0.7 * (2 * moment_mm2(radius) / (1 - j0(x) ** 2 - j1(x) ** 2))
    assert found == pytest.approx(told, rel=0.05)
    assert found > 0


def test_linear_places_stay_away_from_the_rim():
    at = np.arange(81.0)
    linear = np.stack([np.broadcast_to(at, (81, 81)), np.broadcast_to(at[:, None], (81, 81))])
    assert np.abs(blurred(linear, BLUR, np.array([0.037, 0.037])) - linear)[:, 40, 40].max() < 1e-9


def test_of_a_design_it_grows_with_the_wavelength_and_is_the_same_in_all_trials():
    design = MeasuredDesign.of(Setup(small_scene()))
    one, two = (Diffraction().changes_mm(design, value, Draw(0, k)) for k, value in enumerate((250.0, 500.0)))
    assert np.abs(two - 2 * one).max() < 0.1 * np.abs(two).max()
    assert np.array_equal(two, Diffraction().changes_mm(design, 500.0, Draw(3, 9)))
