"""Aspheric departures on the host: profiles, segments, and where rays meet them."""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from aspheres import MIRRORS

from irtscots_cl.optics.asphere import BEYOND_RIM, Profile
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.asphere import Asphere
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.validation import SceneError

ON_AXIS = [name for name in MIRRORS if not name.startswith("off-axis")]


def exact_sag(mirror: Mirror, r):
    """The sag equation with 40 digits, powers and Qcon (by the hypergeometric function); without Qbfs."""
    r, radius, terms = mpmath.mpf(r), mpmath.mpf(mirror.radius_mm), mirror.asphere
    conic = r**2 / (radius * (1 + mpmath.sqrt(1 - (1 + mpmath.mpf(mirror.conic)) * (r / radius) ** 2)))
    total = conic + sum(mpmath.mpf(a) * r**n for n, a in (terms.coefficients_mm or {}).items())
    if terms.q_con_um:
        x = (r / mpmath.mpf(terms.normalisation_radius_mm)) ** 2
        total += sum(a * x**2 * mpmath.jacobi(m, 0, 4, 2 * x - 1) for m, a in terms.q_con_um.items()) / 1000
    return total


@pytest.mark.parametrize("name", [name for name in ON_AXIS if name not in ("q-bfs", "flat", "deviated")])
def test_sag_and_slope_are_the_sag_equations(name):
    """To an ulp of the sag, 7 mm, and of a slope of 0.4 with terms of many um of order 40."""
    mirror, surface = MIRRORS[name], Surface.of(MIRRORS[name])
    with mpmath.workdps(40):
        for r, angle in ((1e-3, 0.3), (7.0, 2.0), (31.0, -2.5), (50.0, 0.9)):
            x, y = np.array([r * np.cos(angle)]), np.array([r * np.sin(angle)])
            at = mpmath.sqrt(mpmath.mpf(float(x[0])) ** 2 + mpmath.mpf(float(y[0])) ** 2)
            slope = mpmath.diff(lambda rho: exact_sag(mirror, rho), at)
            assert float(abs(mpmath.mpf(float(surface.sag(x, y)[0])) - exact_sag(mirror, at))) < 4e-15
            found = np.array(surface.gradient(x, y))[:, 0]
            assert np.abs(found - float(slope) * np.array([x[0], y[0]]) / float(at)).max() < 2e-14


@pytest.mark.parametrize("name", ON_AXIS)
def test_profiles_go_on_along_their_tangents(name):
    """Far outside, where a power of 20 overflows, rays of pixels that see past the mirror need some surface."""
    profile = Surface.of(MIRRORS[name]).design[0].profile
    edge = profile.scale_mm
    assert edge == pytest.approx(BEYOND_RIM * 50.0)
    r, zero = edge * np.array([1 - 1e-9, 1 + 1e-9, 2.0, 1e6]), np.zeros(4)
    height, slope, across = profile.at(r, zero)
    assert not across.any() and slope[1:] == pytest.approx(slope[1])
    assert height[1] == pytest.approx(height[0], rel=1e-6) and slope[1] == pytest.approx(slope[0], rel=1e-5)
    assert height[2:] == pytest.approx(height[1] + slope[1] * (r[2:] - edge))


def test_slopes_at_the_vertex_are_finite_and_0():
    for name in ON_AXIS:
        zero = np.zeros(1)
        assert [float(v[0]) for v in Surface.of(MIRRORS[name]).design[0].at(zero, zero)] == [0.0, 0.0, 0.0]


def test_a_paraboloid_by_its_power_of_2_is_the_conic():
    flat = Mirror(radius_mm=np.inf, diameter_mm=100.0, asphere=Asphere({2: 1 / 400}))
    conic = Surface.of(Mirror(radius_mm=200.0, conic=-1.0, diameter_mm=100.0))
    random = np.random.default_rng(2)
    points = np.stack([*random.uniform(-30, 30, (2, 500)), np.full(500, 250.0)], -1)
    ways = np.stack([*random.uniform(-0.3, 0.3, (2, 500)), np.full(500, -1.0)], -1)
    found, right = Surface.of(flat).meet(points, ways), conic.meet(points, ways)
    inside = np.hypot(*right[0][:, :2].T) < 50
    assert inside.mean() > 0.3
    for mine, its in zip(found, right, strict=True):
        assert np.abs(mine - its)[inside].max() < 1e-12


def test_a_segment_of_a_parent_that_is_a_conic_after_all():
    """Terms of the difference between a sphere and a paraboloid, to order 20: the segment is the paraboloid's."""
    radius, off = 2000.0, 300.0
    # the paraboloid less the sphere: minus the sphere's binomial series from r^4 on
    terms = {2 * n: -float(mpmath.binomial(0.5, n)) * (-1) ** (n + 1) * radius ** (1 - 2 * n) for n in range(2, 11)}
    made = Mirror(radius_mm=radius, diameter_mm=200.0, off_axis_mm=off, asphere=Asphere(terms))
    right = replace(made, conic=-1.0, asphere=None)
    angle = np.linspace(0, 6, 40)
    x, y = 100 * np.cos(angle) * np.linspace(0, 1, 40), 100 * np.sin(angle) * np.linspace(0, 1, 40)
    # the series ends after r^20: 400 mm leave 2000 (400 / 2000)^22 / 60 mm
    assert np.abs(Surface.of(made).sag(x, y) - Surface.of(right).sag(x, y)).max() < 1e-12
    for found, expected in zip(Surface.of(made).gradient(x, y), Surface.of(right).gradient(x, y), strict=True):
        assert np.abs(found - expected).max() < 1e-13


def test_best_fit_spheres_that_end_near_the_mirror():
    """The root of Qbfs terms has no polynomial near the sphere's edge: refused, not fitted badly."""
    deep = Asphere(q_bfs_um={0: 1.0}, normalisation_radius_mm=50.0)
    assert len(Profile.of(Mirror(radius_mm=60.0, diameter_mm=100.0, asphere=deep)).series) < 60
    with pytest.raises(
        SceneError, match=r"q_bfs_um: must have its mirror farther from the edge of the best-fit sphere"
    ):
        Profile.of(Mirror(radius_mm=50.0 + 1e-6, diameter_mm=100.0, asphere=deep))
