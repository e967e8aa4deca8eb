"""The quadratic maps of pixels against float64 rays: values, derivatives, and what the quadratic leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from types import SimpleNamespace

import numpy as np
import pytest
from scenes import scene_of
from tracers import setup_of

from irtscots_cl.optics.pixel import ray_map
from irtscots_cl.optics.pixel.ray_map import OUTPUTS, RAYS, RayMap
from irtscots_cl.scene.presets import load_scene

MONOMIALS = ["".join(m) for order in range(3) for m in combinations_with_replacement("stab", order)]
# Largest error in mm of a map on (screen, mirror) at any point of pixel and aperture: the cubic terms that it leaves.
# Each is three to four times what random points of 200 pixels show.
BOUND_MM = {
    "sphere": (5e-7, 1.5e-5),
    "sphere-deviated": (2e-5, 1.5e-5),
    "off-axis": (2e-5, 1.5e-5),
    "lopsided": (4e-3, 2e-5),
}


def some_pixels(chief, count, seed=0):
    """Rows and columns of pixels that see nothing but mirror, also those next to its rim."""
    row, column = np.nonzero(chief.footprint.coverage == 1)
    chosen = np.random.default_rng(seed).choice(len(row), count, replace=False)
    return row[chosen], column[chosen]


def random_points(shape, seed=1):
    """s, t, a, b of rays: evenly in pixel and aperture."""
    generator = np.random.default_rng(seed)
    s, t = generator.uniform(-1, 1, (2, *shape))
    radius, angle = np.sqrt(generator.random(shape)), generator.uniform(0, 2 * np.pi, shape)
    return s, t, radius * np.cos(angle), radius * np.sin(angle)


def rays(chief, row, column, s, t, a, b):
    """{output: values} of rays through points of pixels, broadcast."""
    radius = chief.scene.camera.aperture_diameter_mm / 2
    points, u, v = chief.reverse(row + t / 2, column + s / 2, a * radius, b * radius)
    return dict(zip(OUTPUTS, (u, v, points[..., 0], points[..., 1]), strict=True))


def evaluated(maps, output, s, t, a, b):
    """A map's output [n, ...], monomial by monomial."""
    point = {"s": s, "t": t, "a": a, "b": b}
    return sum(
        maps.term(output, m)[:, None] * np.prod([point[name] for name in m] or [np.ones_like(s)], 0) for m in MONOMIALS
    )


@pytest.fixture(params=BOUND_MM)
def mapped(request):
    """(name, calibration, maps) of 200 pixels of a scene"""
    chief = setup_of(scene_of(request.param)).chief_rays
    return request.param, chief, RayMap.of(chief, *some_pixels(chief, 200))


# --- against rays ------------------------------------------------------------------------------------------


def test_maps_are_the_rays(mapped):
    name, chief, maps = mapped
    points = random_points((200, 30))
    expected = rays(chief, maps.row[:, None], maps.column[:, None], *points)
    for output in OUTPUTS:
        error = np.abs(evaluated(maps, output, *points) - expected[output])
        assert error.max() < BOUND_MM[name][output in "xy"]  # see there
    for k, output in enumerate("uv"):  # residual is what the fit's few points show of the error: a third of it
        error = np.sqrt(np.mean((evaluated(maps, output, *points) - expected[output]) ** 2))
        assert error / 5 < np.sqrt(np.mean(maps.residual[k] ** 2)) < 2 * error  # 1.5 to 3.6 times smaller here


def test_centre_is_the_chief_ray(mapped):
    name, chief, maps = mapped
    s, t, _, _ = random_points((200, 3, 2))
    expected = rays(chief, maps.row[:, None, None], maps.column[:, None, None], s, t, 0.0, 0.0)
    for output in OUTPUTS:
        found = maps.centre(output, s, t)
        assert found.shape == (200, 3, 2)
        np.testing.assert_allclose(found, expected[output], rtol=0, atol=BOUND_MM[name][output in "xy"])  # see there
        np.testing.assert_array_equal(maps.centre(output, s[:, 0, 0], t[:, 0, 0]), found[:, 0, 0])  # [n] alone


@pytest.mark.parametrize("along", "stab")
def test_gradients_are_those_of_finite_differences(mapped, along):
    name, chief, maps = mapped
    s, t, _, _ = random_points((200, 4))
    step = 0.05
    ends = []
    for sign in (1, -1):
        point = {"s": s, "t": t, "a": np.zeros_like(s), "b": np.zeros_like(s)}
        point[along] = point[along] + sign * step
        ends.append(rays(chief, maps.row[:, None], maps.column[:, None], **point))
    for output in OUTPUTS:
        differences = (ends[0][output] - ends[1][output]) / (2 * step)
        # A map's error of e at the ends of [-1, 1] bends its slope by up to 4 e (Markov: cubic terms, 9 e at the most)
        bound = 9 * BOUND_MM[name][output in "xy"]
        np.testing.assert_allclose(maps.gradient(output, along, s, t), differences, rtol=0, atol=bound)
        assert np.abs(differences).max() > 20 * bound or name == "lopsided" or output + along in WEAK


WEAK = {"ut", "ub", "vs", "va", "xt", "xb", "ys", "ya"}  # derivatives across: as small as the bound


def test_corner_radii_are_those_of_the_chief_rays(mapped):
    name, chief, maps = mapped
    corner = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]])
    points, _, _ = chief.reverse(maps.row[:, None] + corner[:, 0], maps.column[:, None] + corner[:, 1])
    expected = np.hypot(points[..., 0], points[..., 1])
    np.testing.assert_allclose(maps.corner_radius, expected, rtol=0, atol=2 * BOUND_MM[name][1])  # mm: x and y


# --- quadratics and what they leave ------------------------------------------------------------------------


@dataclass(frozen=True)
class Polynomial:
    """Stands for a ChiefRays whose rays land at polynomials of (s, t, a, b)."""

    terms: dict[str, dict[str, float]]
    aperture_diameter_mm: float = 3.0

    @property
    def scene(self):
        return SimpleNamespace(camera=self)

    def reverse(self, row, column, a_mm, b_mm):
        s, t, a, b = 2.0 * column, 2.0 * row, a_mm / 1.5, b_mm / 1.5  # of the pixel in row 0, column 0
        point = dict(zip("stab", np.broadcast_arrays(s, t, a, b), strict=True))
        u, v, x, y = (
            sum(value * np.prod([point[k] for k in m] or [np.ones_like(point["s"])], 0) for m, value in terms.items())
            for terms in (self.terms.get(output, {"": 0.0}) for output in OUTPUTS)
        )
        return np.stack(np.broadcast_arrays(x, y, 0.0), -1), u, v


def test_quadratics_are_found_exactly():
    generator = np.random.default_rng(4)
    terms = {output: dict(zip(MONOMIALS, generator.normal(size=15), strict=True)) for output in OUTPUTS}
    maps = RayMap.of(Polynomial(terms), np.zeros(2), np.zeros(2))
    for output in OUTPUTS:
        for monomial in MONOMIALS:
            swapped = maps.term(output, monomial[::-1])
            np.testing.assert_allclose(swapped, terms[output][monomial], rtol=0, atol=1e-13)  # rounding of the fit
    assert maps.residual.shape == (2, 2) and maps.residual.max() < 1e-13  # the same
    assert len(MONOMIALS) == 15 and RAYS >= 15


def test_what_a_cubic_does_over_the_aperture_alone_is_kept():
    """a^3 and a b^2 become what they are on average over a disk: 1/2 a, 1/6 a; the rest is the residual."""
    maps = RayMap.of(Polynomial({"u": {"aaa": 1.0}, "v": {"abb": 1.0}}), np.array([0]), np.array([0]))
    assert maps.term("u", "a")[0] == pytest.approx(1 / 2, abs=1e-13)  # <a^4> / <a^2> of a disk; rounding
    assert maps.term("v", "a")[0] == pytest.approx(1 / 6, abs=1e-13)  # <a^2 b^2> / <a^2> of a disk; rounding
    assert maps.residual[0, 0] > 0.1 and maps.residual[1, 0] > 0.05  # nothing of it is hidden


@pytest.mark.parametrize("name", ["sphere-deviated", "off-axis"])
def test_residuals_grow_with_the_aperture(name):
    scene = load_scene(name)
    chief = setup_of(scene).chief_rays
    row, column = some_pixels(chief, 100)
    rms = []
    for factor in (1.0, 4.0, 8.0):
        camera = replace(scene.camera, aperture_diameter_mm=factor * scene.camera.aperture_diameter_mm)
        residual = RayMap.of(setup_of(replace(scene, camera=camera)).chief_rays, row, column).residual
        rms.append(np.sqrt(np.mean(residual**2, axis=1)))
    # a cubic in the aperture's radius alone would grow 64 and 8 times; the pixel's part stays
    assert (rms[1] > 1.2 * rms[0]).all() and (rms[2] > 2 * rms[1]).all() and (rms[2] < 9 * rms[1]).all()


def test_part_of_the_maps_is_the_maps_of_a_part():
    chief = setup_of(load_scene("off-axis")).chief_rays
    row, column = some_pixels(chief, 20)
    maps = RayMap.of(chief, row, column)
    mask = np.arange(20) % 3 == 0
    repeated = np.array([7, 7, 0])
    for chosen in (mask, repeated):
        part, alone = maps.part(chosen), RayMap.of(chief, row[chosen], column[chosen])
        for name in ("row", "column"):
            np.testing.assert_array_equal(getattr(part, name), getattr(alone, name))
        np.testing.assert_allclose(part.coefficient, alone.coefficient, rtol=0, atol=1e-10)  # mm: rounding at 4 m
        np.testing.assert_allclose(part.residual, alone.residual, rtol=0, atol=1e-10)  # the same
        np.testing.assert_array_equal(part.corner_radius, maps.corner_radius[chosen])


def test_many_pixels_in_parts_have_the_same_maps(monkeypatch):
    chief = setup_of(scene_of("lopsided")).chief_rays
    row, column = some_pixels(chief, 50)
    expected = RayMap.of(chief, row, column)
    monkeypatch.setattr(ray_map, "MANY_PIXELS", 20)
    monkeypatch.setattr(ray_map, "PIXELS_OF_PART", 16)
    found = RayMap.of(chief, row, column)
    np.testing.assert_allclose(found.coefficient, expected.coefficient, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.residual, expected.residual, rtol=0, atol=1e-8)
