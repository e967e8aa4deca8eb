"""Cases: a deviation's signature on the screen is proportional to it, down to a hundredth of a nanometre."""

from __future__ import annotations

from functools import partial

import numpy as np

from irtscots_cl.optics.surface import Surface
from irtscots_cl.stability.checks import Bench, Case, Finding, Limit, finding
from irtscots_cl.stability.conics import SEED, lines_through, mirror_scene, points_on
from irtscots_cl.stability.zernike import DIAMETER_MM, RADIUS_MM, deviated
from irtscots_cl.tracing.checks.probes import MeetProbe

RAYS = 2**18
AMPLITUDES_UM = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
ARMS_DEGREES = (1.0, 3.0)  # the spot of 3 degrees is 5 mm wide: single precision has steps of 2.4e-7 mm there
LIMIT = Limit(0.01, "of 1", "calibrations of a test are good to 1 % of what it measures")


def responses(bench: Bench, arm_degrees: float) -> np.ndarray:
    """Shift of the light per deviation [amplitudes], projected on the deviation's slopes; all equal if linear.

    It is half the difference between a deviation and its negative, for the same rays.
    """
    n, random = RAYS, np.random.default_rng(SEED)
    unit = deviated({(2, 2): 1.0})
    side = np.tan(np.radians(arm_degrees))
    points = points_on(unit, n, random)
    away = points - np.array([[-side], [0.0], [1.0]]) * RADIUS_MM
    lines = lines_through(points, away[:2] / away[2], bench.precision)
    slopes = np.stack(Surface.of(unit).deviation_at(points[0], points[1])[1:])
    found = []
    for size in AMPLITUDES_UM:
        up, down = (_landing(bench, sign * size, lines, side) for sign in (1, -1))
        moved = (up - down) / (2 * size)
        found.append(-np.sum(moved * slopes) / np.sum(slopes * slopes) / RADIUS_MM)
    return np.array(found)


def _landing(bench: Bench, size_um: float, lines: np.ndarray, side: float) -> np.ndarray:
    scene = mirror_scene(deviated({(2, 2): size_um}), RADIUS_MM, side)
    return MeetProbe(bench.device, scene, bench.precision)(lines).landing.astype(float)


def _linear(arm_degrees: float, bench: Bench) -> list[Finding]:
    found = responses(bench, arm_degrees)
    return [
        finding(f"response at {size * 1e3:g} nm over that at 100 nm", [ratio - 1], LIMIT)
        for size, ratio in zip(AMPLITUDES_UM, found / found[-1], strict=True)
        if size != AMPLITUDES_UM[-1]
    ] + [
        finding("response at 100 nm over that of the law of reflection", [found[-1] / 2 - 1], Limit(
            0.02, "of 1", "twice the slope times the distance, to the squares of arm angles and mirror slopes"))
    ]  # fmt: skip


CASES = tuple(
    Case(
        "the deviation's signature",
        f"astigmatism on a {DIAMETER_MM:g} mm sphere, {arm:g} degree arms",
        partial(_linear, arm),
    )
    for arm in ARMS_DEGREES
)
