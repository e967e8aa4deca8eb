"""Cases: the Zernike deviation up to radial order 40, at the rim and outside it, from a picometre to a millimetre."""

from __future__ import annotations

from functools import partial

import numpy as np

from irtscots_cl.maths.zernike.indices import nm_to_noll
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.stability.checks import Bench, Case, Finding, Limit, count, finding
from irtscots_cl.stability.conics import SEED, lines_through, mirror_scene, points_on
from irtscots_cl.stability.exact import ExactMirror
from irtscots_cl.tracing.checks.probes import MeetProbe

RADIUS_MM, DIAMETER_MM = 4166.747, 1064.0
RAYS = 64  # the reference's factorial sums are slow

# For the design itself, plus a share of the deviation's largest slope.
SLOPE_URAD = {"fp32": 0.1, "fp64": 1e-9}
OF_SLOPE = {"fp32": 1e-5, "fp64": 1e-7}
REASON = {
    "fp32": "0.1 urad as for the design, and of the deviation 1e-5: 0.01 nm of 1 um",
    "fp64": "1 fm over a metre, and of the deviation 1e-7: 0.1 nm of 1 mm",
}


def deviated(terms_um: dict[tuple[int, int], float]) -> Mirror:
    """A sphere with Zernike terms (n, m), coefficients in um, on a disk of the mirror's size."""
    terms = ZernikeTerms(DIAMETER_MM / 2, "noll", {nm_to_noll(*nm): value for nm, value in terms_um.items()})
    return Mirror(radius_mm=RADIUS_MM, diameter_mm=DIAMETER_MM, zernike=(terms,))


def _slopes(terms_um: dict[tuple[int, int], float], bench: Bench) -> list[Finding]:
    mirror = deviated(terms_um)
    random = np.random.default_rng(SEED)
    points = points_on(mirror, RAYS, random)
    away = points - np.array([[0.05], [0.0], [1.0]]) * RADIUS_MM
    lines = lines_through(points, away[:2] / away[2], bench.precision)
    exact = ExactMirror(mirror)
    right, met = exact.meet(lines), MeetProbe(bench.device, mirror_scene(mirror), bench.precision)(lines)
    both = right.on_mirror & met.on_mirror
    _, by_x, by_y = exact.deviation(right.point[0], right.point[1])
    slope_urad = np.hypot(by_x.astype(float), by_y.astype(float))[both].max() * 1e6
    limit = Limit(SLOPE_URAD[bench.precision] + OF_SLOPE[bench.precision] * slope_urad, "urad", REASON[bench.precision])
    return [
        finding("normal", right.normal_error(met.normal)[both] * 1e6, limit),
        count("on the mirror or not", np.sum(~both[np.arange(RAYS) % 8 != 0]), RAYS, "inside the rim all rays hit"),
    ]


TERMS = {
    "order 40, m = 0": {(40, 0): 0.1},
    "order 40, m = 40": {(40, 40): 0.1},
    "order 40, m = -20": {(40, -20): 0.1},
    "order 39, m = 1": {(39, 1): 0.1},
    "orders 1 to 40 together": {(n, (-1) ** (n // 4) * (n % 8)): 0.05 for n in range(3, 41, 4)} | {(40, 40): 0.02},
    "few low orders by powers": {(2, 2): 0.3, (3, 1): -0.14, (3, -3): 0.1, (4, 0): 0.09, (7, 1): -0.03},
}
LOW = {(2, 2): 1.0, (4, 0): 0.5, (5, -3): 0.3}
AMPLITUDES_UM = (1e-6, 1e-3, 1.0, 1e2, 1e3)

CASES = (
    *(Case("Zernike deviation", name, partial(_slopes, terms)) for name, terms in TERMS.items()),
    *(
        Case(
            "Zernike deviation",
            f"low orders, {size * 1e3:g} nm",
            partial(_slopes, {k: v * size for k, v in LOW.items()}),
        )
        for size in AMPLITUDES_UM
    ),
)
