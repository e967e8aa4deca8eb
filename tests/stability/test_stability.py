"""Hard cases: what `irtscots stability` runs, on the device under test; and its exact reference beside others."""

from __future__ import annotations

import numpy as np
import pytest
from oracle import tracer
from scenes import CURVATURES, scene_of

from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.measurement.centroids import centroids
from irtscots_cl.measurement.light_curves import Flag
from irtscots_cl.stability import conics, curves, edges, masks, paths, zernike
from irtscots_cl.stability.checks import Bench, Limit, finding
from irtscots_cl.stability.conics import HALVES
from irtscots_cl.stability.exact import ExactMirror
from irtscots_cl.stability.suite import CASES


def named(cases):
    return pytest.mark.parametrize("case", cases, ids=lambda case: f"{case.group}: {case.name}")


def check(case, bench):
    found = case.run(bench)
    assert found
    for part in found:
        assert part.passed, part


@pytest.fixture
def few_rays(monkeypatch):
    """Fewer rays than `irtscots stability` takes: their reference at 50 digits is nearly all of the time."""
    for module in (conics, edges):
        monkeypatch.setattr(module, "RAYS", 64)  # of each bundle of 256
    monkeypatch.setattr(paths, "RAYS", 2)  # of each pixel's 6
    monkeypatch.setattr(zernike, "RAYS", 32)  # of 64


@pytest.mark.usefixtures("few_rays")
@named([case for case in CASES if not case.on_host and not case.long])
def test_on_the_device(case, device, precision):
    check(case, Bench(device, precision))


@pytest.mark.parametrize("mirror", HALVES.values(), ids=HALVES)
def test_the_host_too_meets_the_mirrors_own_half_alone(mirror):
    """Where a line parallel to the vertex's tangent plane cuts the parent's other half, there is no mirror."""
    radius, conic, off_axis, _ = mirror
    quadric = Quadric.conic(radius, conic, off_axis)
    # steep lines from far above to far below the vertex: beside it they meet the own half, or nothing
    random = np.random.default_rng(3)
    p, q = random.normal(0, 30, (2, 20_000))
    size = abs(radius)
    z0 = random.uniform(-2 * size, 2 * size, 20_000)
    x0, y0 = random.uniform(-size, size, (2, 20_000)) - z0 * np.stack([p, q])
    z = quadric.meet(x0, y0, p, q)
    met = np.isfinite(z)
    x, y = x0 + p * z, y0 + q * z
    down = 1 - quadric.q_zz * z - quadric.q_xz * x
    assert met.sum() > 100
    assert (np.sign(radius) * z[met] >= 0).all() and (down[met] > 0).all()
    residual = quadric.q_xx * x * x + quadric.q_yy * y * y + quadric.q_zz * z * z + 2 * quadric.q_xz * x * z - 2 * z
    assert np.abs(residual[met] / down[met]).max() < 1e-9 * size  # rounding, over the cosine of grazing lines


# --- the reference -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["off-axis", "lopsided", *CURVATURES])
def test_exact_mirror_agrees_with_the_oracle(name):
    """Two references, written apart: 50 digits with the factorial sums in x and y, float64 in polar coordinates."""
    scene = scene_of(name)
    random, n = np.random.default_rng(5), 64
    x, y = random.uniform(-0.35, 0.35, (2, n)) * scene.mirror.diameter_mm
    p, q = random.uniform(-0.3, 0.3, (2, n))
    exact = ExactMirror(scene.mirror).meet(np.stack([x, y, p, q]))
    oracle = tracer.OracleMirror(scene.mirror)
    direction = np.stack([p, q, np.ones(n)], -1)
    point = oracle.meet(np.stack([x, y, np.zeros(n)], -1), direction)
    assert exact.point_error(point.T).max() < 1e-11  # mm: rounding of a metre, a few times
    outgoing = oracle.reflect(point, -direction)
    outgoing /= np.linalg.norm(outgoing, axis=-1, keepdims=True)
    found = np.stack([c.astype(float) for c in exact.direction], -1)
    np.testing.assert_allclose(found, outgoing, rtol=0, atol=1e-14)  # rounding, of order 20's sums too
    np.testing.assert_array_equal(exact.on_mirror, oracle.contains(point))
    assert exact.on_mirror.sum() > 0


def test_a_finding_without_a_number_fails():
    limit = Limit(1.0, "mm", "")
    assert finding("", np.array([0.5, -1.0]), limit).passed
    assert finding("", np.array([0.5, -1.0]), limit).rms == pytest.approx(np.sqrt(0.625))
    assert not finding("", np.array([0.5, 1.1]), limit).passed
    assert not finding("", np.array([0.5, np.nan]), limit).passed
    assert not finding("", np.array([]), limit).passed


# --- measurement: light curves and masks ------------------------------------------------------------------------

HOST = Bench(None, "fp64")
SHORT = [case for case in (*curves.CASES, *masks.CASES) if not case.long]


@named(SHORT)
def test_on_the_host(case):
    check(case, HOST)


@pytest.mark.slow
@named([case for case in masks.CASES if case.long])
def test_on_the_host_with_a_large_mask(case):
    check(case, HOST)


def test_both_groups_belong_to_the_suite():
    assert set(SHORT) < set(CASES) and all(case.on_host for case in SHORT)


def failed(case):
    """Names of the findings that did not pass."""
    return {part.quantity for part in case.run(HOST) if not part.passed}


@pytest.mark.parametrize("flag", list(Flag), ids=lambda flag: flag.name)
def test_a_light_curve_with_a_wrong_flag_is_found(monkeypatch, flag):
    """Every curve called the same: all but those that are so are wrong."""
    monkeypatch.setattr(curves, "flag_curves", lambda scan, *_: np.full(len(scan.pixels), flag))
    expected = {name for name, (_, right) in curves._curves().items() if right != flag}
    assert failed(curves.CASES[0]) == expected and len(expected) >= 8


@pytest.mark.parametrize("error", [1e-9, np.nan])
def test_a_wrong_centroid_is_found(monkeypatch, error):
    monkeypatch.setattr(curves, "centroids", lambda *given: centroids(*given) + error)
    assert "centroids of good curves" in failed(curves.CASES[0])


BROKEN = {
    "a height": (lambda z, mask: z + 1e-8 * (np.cumsum(mask).reshape(mask.shape) == 1), "height of each island"),
    "a piston": (lambda z, mask: z + 1e-8, "piston of"),
    "a number where none is known": (lambda z, mask: np.nan_to_num(z), "values outside the mask"),
    "none where one is known": (lambda z, mask: z + np.nan, "height of each island"),
}


@pytest.mark.parametrize("case", [case for case in masks.CASES if not case.long], ids=lambda case: case.name)
@pytest.mark.parametrize(("broken", "named_in"), BROKEN.values(), ids=BROKEN)
def test_wrong_heights_on_a_mask_are_found(monkeypatch, case, broken, named_in):
    def integrated(*given, **options):
        return broken(integrate_slopes(*given, **options), given[4])

    monkeypatch.setattr(masks, "integrate_slopes", integrated)
    assert any(name.startswith(named_in) for name in failed(case))
