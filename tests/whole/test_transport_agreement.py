"""Forward and adjoint estimators agree in every bin: the same light, followed in opposite directions.

They share the mirror and the devices' frames, but neither the sampling, the lens, the place on the detector
or the screen, the accumulation nor the unit; of real set-ups neither the distortion (its formula, and quadratics of its
inverse), the bent screen (tangent planes, and cubics) nor its glass. FAILURE_CHANCE, of the whole file, is split among
statements.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scenes import SEQUENTIAL, scene_of
from scipy import stats
from significance import poisson_ratio_p, sidak_p, sidak_z

from irtscots_cl.opencl.structs import WEIGHT_ONE
from irtscots_cl.tracing.trace import trace

FAILURE_CHANCE = 1e-6
# Rays per screen pixel and per detector pixel: 3e7 and 1e7 in all (off-axis: 4e8 and 4e7), a second
RAYS = {
    "sphere": (2**16, 1024),
    "sphere-deviated": (2**16, 1024),
    "off-axis": (4096, 4096),
    "lopsided": (2**16, 4096),
    "lopsided-freeform": (2**16, 4096),
    "real": (2**16, 4096),
    "real-points": (2**16, 4096),
    "asphere": (2**12, 1024),
    "lopsided-asphere": (2**16, 4096),
}
POOL = {"off-axis": (8, 20)}  # detector and screen pixels per side of a pool; its forward hits are few
SCENES = [*SEQUENTIAL, "lopsided", "real", "real-points", "asphere", "lopsided-asphere", "lopsided-freeform"]
STATEMENTS = 4 * len(SCENES)
CHANCE = FAILURE_CHANCE / STATEMENTS


@dataclass(frozen=True)
class Pair:
    """Both estimators' bins of one scene that got any light, [bins]: ray counts and places.

    forward, adjoint: counts (the adjoint's weights as counts, 1 at the axis). share: the part of their sum
    that is the forward's if both are right. adjoint_share: of its pixel's rays, those in the bin.
    row, column: of the detector; screen_row, screen_column: of the screen. pool: sides of a small pool.
    """

    forward: np.ndarray
    adjoint: np.ndarray
    share: np.ndarray
    adjoint_share: np.ndarray
    row: np.ndarray
    column: np.ndarray
    screen_row: np.ndarray
    screen_column: np.ndarray
    pool: tuple[int, int]


@cache
def pair(name, device) -> Pair:
    scene = scene_of(name)
    rays, seed = RAYS[name], 20 + 2 * SCENES.index(name)
    forward = trace(scene, device=device, estimator="forward", rays_per_pixel=rays[0], replicates=1, seed=seed)
    adjoint = trace(scene, device=device, estimator="adjoint", rays_per_pixel=rays[1], replicates=1, seed=seed + 1)
    np.testing.assert_array_equal(forward.windows.pixels, adjoint.windows.pixels)
    np.testing.assert_array_equal(forward.windows.origins, adjoint.windows.origins)
    shape = forward.counts.shape[1:]
    # counts expected of a flux of 1 W
    of_forward = np.broadcast_to(rays[0] / forward.unit_w, shape).ravel()
    of_adjoint = np.broadcast_to(rays[1] / (adjoint.unit_w * WEIGHT_ONE), shape).ravel()
    hits = np.rint(adjoint.counts[0] / WEIGHT_ONE).astype(np.int64).ravel()
    lit = np.flatnonzero(forward.counts[0].ravel() + hits)
    visible_pixel, row, column = np.unravel_index(lit, shape)
    detector_row, detector_column = np.divmod(forward.windows.pixels[visible_pixel], scene.camera.detector.pixels[0])
    return Pair(
        forward.counts[0].ravel()[lit].astype(np.int64),
        hits[lit],
        (of_forward / (of_forward + of_adjoint))[lit],
        hits[lit] / rays[1],
        detector_row,
        detector_column,
        forward.windows.origins[visible_pixel, 1] + row,
        forward.windows.origins[visible_pixel, 0] + column,
        POOL.get(name, (4, 2)),
    )


def contrast_of(forward, adjoint, share, adjoint_share):
    """Contrast forward (1 - share) - adjoint share of bins, of mean 0 under agreement, and its variance.

    Poisson (forward) and binomial (adjoint) variances are taken from the mean that both together give.
    """
    total = forward + adjoint
    variance = total * share * (1 - share) ** 2 + total * (1 - share) * (1 - adjoint_share) * share**2
    return forward * (1 - share) - adjoint * share, variance


def super_bins(bins: Pair, *keys):
    """z of bins pooled by equal keys, for pools that expect at least 25 forward counts."""
    contrast, variance = contrast_of(bins.forward, bins.adjoint, bins.share, bins.adjoint_share)
    label = np.ravel_multi_index(keys, [key.max() + 1 for key in keys])
    contrast, variance = np.bincount(label, contrast), np.bincount(label, variance)
    expected = np.bincount(label, (bins.forward + bins.adjoint) * bins.share)
    enough = expected >= 25
    return contrast[enough] / np.sqrt(variance[enough])


@pytest.fixture(params=SCENES)
def bins(request, device):
    return pair(request.param, device)


def test_every_bin_agrees(bins):
    """Given a bin's sum the forward count is binomial; the adjoint scatters at most as Poisson."""
    p = poisson_ratio_p(bins.forward, bins.adjoint, bins.share)
    assert len(p) > 50_000
    assert p.min() > sidak_p(len(p), CHANCE)


def test_pooled_bins_agree(bins):
    """Pools by detector place and screen column or row, where a small difference of many bins adds up."""
    side, _ = bins.pool
    pools = [
        (bins.row, bins.screen_column),
        (bins.column, bins.screen_row),
        (bins.row, bins.screen_row),
        (bins.column, bins.screen_column),
        (bins.row // side, bins.column // side),
        (bins.screen_row, bins.screen_column),
    ]
    z = np.concatenate([super_bins(bins, *keys) for keys in pools])
    assert len(z) > 1000
    assert np.abs(z).max() < sidak_z(len(z), CHANCE)  # pools overlap: Sidak's limit is then on the safe side


def test_deviations_have_the_size_that_counting_gives(bins):
    """Chi-square over disjoint pools: neither systematic differences nor error bars that are too wide."""
    side, screen_side = bins.pool
    z = super_bins(
        bins,
        bins.row // side,
        bins.column // side,
        bins.screen_row // screen_side,
        bins.screen_column // screen_side,
    )
    assert len(z) > 200
    lower, upper = stats.chi2.isf([1 - CHANCE / 2, CHANCE / 2], len(z))
    # Counts of 25 and more have heavier tails than normal ones, by 1 / count of the variance: 1 %;
    # pools of one pixel are negatively correlated in the adjoint's part, at most its share of the variance.
    assert 0.99 * lower < (z**2).sum() < 1.01 * upper


def test_total_flux_agrees(bins):
    contrast, variance = contrast_of(bins.forward, bins.adjoint, bins.share, bins.adjoint_share)
    assert abs(contrast.sum() / np.sqrt(variance.sum())) < sidak_z(1, CHANCE)
    assert np.sqrt(1 / bins.forward.sum()) < 0.01  # so this holds to a percent or better


def test_the_tests_are_of_enough_bins(device):
    assert sum(len(pair(name, device).forward) for name in SCENES) >= 100_000
