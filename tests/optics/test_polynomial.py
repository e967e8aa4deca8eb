"""Polynomials and annular terms of a mirror, on the host and on the device, against their definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from freeform import ANNULAR, CHEBYSHEV, DESIGN, MONOMIAL, RIM_MM, polynomial_height

from irtscots_cl.maths.zernike.annular import annular_zernike
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.polynomial import Polynomial
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.checks.probes import MeetProbe

SPHERE_MM = 4166.747
STEP_MM = 1e-2  # of differences of the fourth order: 1e-12 rad of rounding, and less of the fifth derivative
HEIGHT_MM = {"fp64": 1e-6, "fp32": 1e-3}  # 1 nm; 1 um
SLOPE_RAD = {"fp64": 1e-9, "fp32": 1e-7}
HIGH = Polynomial("chebyshev", (RIM_MM, RIM_MM), coefficients_um=((30, 0, 0.1), (0, 30, 0.1), (30, 30, 0.03)))
KINDS = {
    "chebyshev": ((CHEBYSHEV,), ()),
    "legendre, 1 mm": ((DESIGN,), ()),
    "monomial": ((MONOMIAL,), ()),
    "order 30": ((HIGH,), ()),
    "several rectangles": ((DESIGN, CHEBYSHEV, MONOMIAL), ()),
    "annular": ((), ANNULAR[:1]),
    "annular of a narrow ring": ((), (ZernikeTerms(RIM_MM, "noll", {11: 0.2, 22: -0.1, 37: 0.1, 29: 0.1}, 0.7),)),
    "all": ((DESIGN, CHEBYSHEV, MONOMIAL), ANNULAR),
}


def mirror_of(kind: str, **changes) -> Mirror:
    polynomial, zernike = KINDS[kind]
    given = {"obscuration_mm": 0.7 * 2 * RIM_MM} if kind.endswith("ring") else {}
    return replace(load_scene("sphere").mirror, polynomial=polynomial, zernike=zernike, **given, **changes)


def height(mirror: Mirror, x, y):
    """The departure from the sphere, from the tables as they are."""
    total = sum(polynomial_height(table, x, y)[0] for table in mirror.polynomial)
    for terms in mirror.zernike:
        for index, value in terms.coefficients_um.items():
            at = (x / terms.radius_mm, y / terms.radius_mm, terms.obscuration, terms.ordering)
            total = total + 1e-3 * value * annular_zernike(index, *at)
    return total


def slopes(mirror: Mirror, x, y):
    """Of the height, by differences of the fourth order."""

    def difference(dx, dy):
        return sum(w * height(mirror, x + k * dx, y + k * dy) for k, w in ((-2, 1), (-1, -8), (1, 8), (2, -1))) / (
            12 * STEP_MM
        )

    return difference(STEP_MM, 0.0), difference(0.0, STEP_MM)


def points_on(mirror: Mirror, count: int = 400):
    random = np.random.default_rng(7)
    hole = mirror.obscuration_mm / mirror.diameter_mm
    radius, angle = RIM_MM * np.sqrt(random.uniform(hole**2 + 0.001, 0.998, count)), random.uniform(0, 2 * np.pi, count)
    return radius * np.cos(angle), radius * np.sin(angle)


@pytest.mark.parametrize("kind", KINDS)
def test_the_host_s_surface_is_the_sum_of_its_tables(kind):
    mirror = mirror_of(kind)
    x, y = points_on(mirror)
    found, expected = Surface.of(mirror).departure_at(x, y), slopes(mirror, x, y)
    assert np.ptp(found[0]) > 1e-5  # mm: it has some height
    np.testing.assert_allclose(found[0], height(mirror, x, y), rtol=0, atol=1e-14)  # mm: rounding of 1 mm
    np.testing.assert_allclose(found[1:], expected, rtol=0, atol=1e-11)  # of differences


@pytest.mark.parametrize("kind", KINDS)
def test_the_device_meets_the_surface_with_its_slopes(device, precision, kind):
    """Lines through known points of the surface; the device's point lies on it, and its normal is the one there."""
    mirror = mirror_of(kind)
    scene = replace(load_scene("sphere"), mirror=mirror)
    x, y = points_on(mirror)
    z = (x * x + y * y) / (SPHERE_MM + np.sqrt(SPHERE_MM**2 - x * x - y * y)) + height(mirror, x, y)
    p, q = np.random.default_rng(8).uniform(-0.1, 0.1, (2, len(x))) - np.array([x, y]) / SPHERE_MM  # near the normal
    lines = np.stack([x - p * z, y - q * z, p, q]).astype(precision.replace("fp", "float"))
    met = MeetProbe(device, scene, precision)(lines)
    assert met.on_mirror.all()
    at_x, at_y, at_z = met.point.astype(float)
    root = np.sqrt(SPHERE_MM**2 - at_x**2 - at_y**2)
    sag = (at_x**2 + at_y**2) / (SPHERE_MM + root)
    limit = HEIGHT_MM[precision]
    np.testing.assert_allclose(at_z, sag + height(mirror, at_x, at_y), rtol=0, atol=limit)
    np.testing.assert_allclose(np.hypot(at_x - x, at_y - y), 0, atol=limit)
    by_x, by_y = slopes(mirror, at_x, at_y)
    normal = met.normal.astype(float)
    np.testing.assert_allclose(-normal[0] / normal[2], at_x / root + by_x, rtol=0, atol=SLOPE_RAD[precision])
    np.testing.assert_allclose(-normal[1] / normal[2], at_y / root + by_y, rtol=0, atol=SLOPE_RAD[precision])


def test_the_design_keeps_its_part_and_the_deviation_is_the_rest():
    mirror = mirror_of("all")
    x, y = points_on(mirror)
    whole, design = Surface.of(mirror), Surface.of(mirror.nominal())
    assert mirror.nominal().polynomial == (DESIGN,) and mirror.nominal().zernike == ()
    np.testing.assert_allclose(design.departure_at(x, y)[0], polynomial_height(DESIGN, x, y)[0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(whole.sag(x, y) - design.sag(x, y), whole.deviation_at(x, y)[0], rtol=0, atol=1e-12)
    assert design.deviation == ()


def test_a_sum_of_zero_is_no_departure():
    nothing = Polynomial("legendre", (RIM_MM, RIM_MM), coefficients_um=((3, 1, 0.0),))
    surface = Surface.of(replace(load_scene("sphere").mirror, polynomial=(nothing,)))
    assert surface.departures == ()
