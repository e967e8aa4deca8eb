"""Hard cases: what `irtscots stability` runs, on the device under test; and its exact reference beside others."""

from __future__ import annotations

import numpy as np
import pytest
from lopsided import lopsided
from oracle import tracer

from irtscots_cl.geometry import Quadric
from irtscots_cl.presets import load_scene
from irtscots_cl.stability.conics import HALVES
from irtscots_cl.stability.exact import ExactMirror
from irtscots_cl.stability.outcome import Bench, Limit, finding
from irtscots_cl.stability.suite import CASES


def named(cases):
    return pytest.mark.parametrize("case", cases, ids=lambda case: f"{case.group}: {case.name}")


def check(case, bench):
    found = case.run(bench)
    assert found
    for part in found:
        assert part.passed, part


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
    z0 = random.uniform(-2 * radius, 2 * radius, 20_000)
    x0, y0 = random.uniform(-radius, radius, (2, 20_000)) - z0 * np.stack([p, q])
    z = quadric.meet(x0, y0, p, q)
    met = np.isfinite(z)
    x, y = x0 + p * z, y0 + q * z
    down = 1 - quadric.q_zz * z - quadric.q_xz * x
    assert met.sum() > 100
    assert (z[met] >= 0).all() and (down[met] > 0).all()
    residual = quadric.q_xx * x * x + quadric.q_yy * y * y + quadric.q_zz * z * z + 2 * quadric.q_xz * x * z - 2 * z
    assert np.abs(residual[met] / down[met]).max() < 1e-9 * radius  # rounding, over the cosine of grazing lines


# --- the reference -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", [load_scene("off-axis"), lopsided()], ids=lambda scene: scene.name)
def test_exact_mirror_agrees_with_the_oracle(scene):
    """Two references, written apart: 50 digits with the factorial sums in x and y, float64 in polar coordinates."""
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
