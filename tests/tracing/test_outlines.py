"""Light of mirrors that are no whole disks: all estimators see the same one, and its area is that of plain geometry.

FAILURE_CHANCE, of every statistical test, is split among its statements by Sidak's rule.
"""

from __future__ import annotations

import math
import os
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from outlined import EFF, ELL, OUTLINED, PIXELS, ell_picture, grown, outline_of
from scenes import coarse, with_part
from significance import poisson_ratio_p, sidak_p, sidak_z

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.opencl.structs import WEIGHT_ONE
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.checks.probes import MeetProbe
from irtscots_cl.tracing.fingerprint import trace_fingerprint
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.trace import trace

FAILURE_CHANCE = 1e-6
DIAMETER = 1064.0
CONVEX = ("hexagon", "rectangle", "cut hexagon")
FEW, MANY = (2**13, 2**11), (2**16, 2**13)  # rays per screen pixel and per detector pixel
BIAS = 1e-5  # of a light curve's peak: what the closed form may differ by
REPLICATES = 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("outline")


@cache
def scene_of(kind, folder, pixels=25):
    mirror = {"outline": outline_of(kind, DIAMETER, folder), "obscuration_mm": 150.0}
    return with_part(coarse("sphere-deviated", pixels), "mirror", **mirror)


@pytest.mark.parametrize(
    ("kind", "rays"),
    [("hexagon", FEW), ("parts", FEW), *(pytest.param(kind, MANY, marks=pytest.mark.slow) for kind in OUTLINED)],
)
def test_forward_and_adjoint_agree_in_every_bin(device, folder, kind, rays):
    """Given a bin's sum the forward count is binomial; the adjoint scatters at most as Poisson."""
    scene = scene_of(kind, folder)
    forward = trace(scene, device=device, estimator="forward", rays_per_pixel=rays[0], replicates=1, seed=31)
    adjoint = trace(scene, device=device, rays_per_pixel=rays[1], replicates=1, seed=32)
    np.testing.assert_array_equal(forward.windows.pixels, adjoint.windows.pixels)
    hits = np.rint(adjoint.counts[0] / WEIGHT_ONE).astype(np.int64)
    expected = (rays[0] / forward.unit_w, rays[1] / (adjoint.unit_w * WEIGHT_ONE))
    share = np.broadcast_to(expected[0] / (expected[0] + expected[1]), hits.shape)
    for sums in (lambda v: v.ravel(), lambda v: v.sum((1, 2))):  # of every bin, and of every pixel
        first, second, of_first = sums(forward.counts[0].astype(np.int64)), sums(hits), sums(share)
        of_first = of_first * len(first) / share.size
        lit = first + second > 0
        p = poisson_ratio_p(first[lit], second[lit], of_first[lit])
        assert lit.sum() > 100
        assert p.min() > sidak_p(lit.sum(), FAILURE_CHANCE / 2)


def exact_area(kind: str) -> float:
    """Of the mirror without a hole, from the keys of `outlined.outline_of`."""
    r = DIAMETER / 2

    def polygon(points):
        return abs(sum(x * v - y * u for (x, y), (u, v) in zip(points, [*points[1:], points[0]], strict=True))) / 2

    return {
        "hexagon": (1.6 * r) ** 2 * math.sqrt(3) / 2,
        "rectangle": 1.5 * 0.8 * r * r,
        "ell": polygon(grown(ELL, r)),
        "eff": polygon(grown(EFF, r)),
        "mask": np.count_nonzero(ell_picture()) * 1.6 * 1.7 * (r / PIXELS) ** 2,
    }[kind]


@pytest.mark.parametrize("kind", ["hexagon", "rectangle", "ell", "eff", "mask"])
def test_the_area_that_rays_find_is_the_polygons(device, folder, kind):
    """Binomial: of rays along z, spread evenly over a square."""
    outline, count = outline_of(kind, DIAMETER, folder), 2**20
    mirror = Mirror(radius_mm=math.inf, diameter_mm=DIAMETER, outline=outline)
    probe = MeetProbe(device, replace(load_scene("sphere"), mirror=mirror), "fp32")
    points = np.random.default_rng(9).uniform(-DIAMETER / 2, DIAMETER / 2, (2, count))
    found = probe(np.concatenate([points, np.zeros_like(points)]).astype(probe.real)).on_mirror.sum()
    share = exact_area(kind) / DIAMETER**2
    assert abs(found - count * share) < sidak_z(1, FAILURE_CHANCE) * math.sqrt(count * share * (1 - share))


@cache
def differences(kind, folder, smoothing, device):
    """Rays less closed form in the closed form's peak, and standard errors, [samples] of pixels that an edge crosses.

    Only those whose light has a closed form.
    """
    scene = scene_of(kind, folder)
    exact = trace(scene, estimator="analytic")
    run = trace(
        scene, device=device, sampler="sobol", precision="fp64", smoothing=smoothing,
        rays_per_pixel=2**12 if smoothing else 2**15, replicates=REPLICATES, seed=4,
    )  # fmt: skip
    np.testing.assert_array_equal(run.windows.pixels, exact.windows.pixels)
    coverage = Setup(scene).chief_rays.footprint.coverage.ravel()[exact.windows.pixels]
    found = []
    for axis in "xy":
        curve, of_rays = exact.line_flux_w(axis)[0], run.line_flux_w(axis)
        cut = (curve.sum(1) > 0) & (coverage < 1)
        assert cut.sum() > 10
        error = of_rays.std(0, ddof=1)[cut] / math.sqrt(REPLICATES)
        found.append(np.stack([(of_rays.mean(0) - curve)[cut].ravel(), error.ravel()]) / curve.max())
    return np.concatenate(found, axis=1)


CLOSED = [(kind, False) for kind in OUTLINED if kind != "mask"] + [(kind, True) for kind in CONVEX]


@pytest.mark.parametrize(
    ("kind", "smoothing"),
    [case if case == ("hexagon", True) else pytest.param(*case, marks=pytest.mark.slow) for case in CLOSED],
)
def test_the_closed_form_has_the_light_of_pixels_that_an_edge_crosses(device, folder, kind, smoothing):
    if not device.has_fp64:
        pytest.skip("the device has no double precision")
    difference, error = differences(kind, folder, smoothing, device)
    of_mean = math.sqrt((error**2).sum()) / len(error)
    assert abs(difference.mean()) < BIAS + sidak_z(2 * len(CLOSED), FAILURE_CHANCE) * of_mean
    known = error > 1e-7  # others: no light, and the last digits of the rays' sums
    z2 = (difference[known] / np.hypot(error[known], BIAS)) ** 2
    # the square of Student's t of 7 degrees of freedom has the mean 7 / 5 and the variance 7.8; samples of a pixel go
    # together in tens
    assert z2.mean() < 7 / 5 + sidak_z(2 * len(CLOSED), FAILURE_CHANCE) * math.sqrt(7.8 * 10 / len(z2))


def test_of_a_picture_only_pixels_that_its_edge_does_not_cross_have_a_closed_form(folder):
    scene = scene_of("mask", folder)
    exact = trace(scene, estimator="analytic")
    coverage = Setup(scene).chief_rays.footprint.coverage.ravel()[exact.windows.pixels]
    lit = exact.line_flux_w("x")[0].sum(1) > 0
    assert lit.sum() > 20 and (coverage[lit] == 1).all() and (coverage[~lit] < 1).any()
    assert exact.ledger["failed"] > 0


@pytest.mark.parametrize("kind", [kind for kind in OUTLINED if kind not in CONVEX])
def test_smoothed_rays_are_refused_where_chords_are_cut_into_pieces(folder, kind):
    with pytest.raises(ValueError, match="mirror.outline: must be one convex polygon with smoothing"):
        trace(scene_of(kind, folder), smoothing=True, rays_per_pixel=1)


def test_the_light_of_the_parts_adds_up(device, folder):
    """Two halves of a hexagon give the hexagon's light: no ray is on both, none on neither."""
    half = 0.4 * DIAMETER
    halves = [((-half, -half), (half, -half), (half, 30.0), (-half, -10.0)),
              ((-half, -10.0), (half, 30.0), (half, half), (-half, half))]  # fmt: skip
    kind = type(outline_of("hexagon", DIAMETER))
    outlines = [kind(shape="polygon", points_mm=points) for points in halves]
    whole = kind(shape="rectangle", size_mm=(2 * half, 2 * half))
    base = scene_of("hexagon", folder)
    images = [
        trace(with_part(base, "mirror", outline=o), device=device, rays_per_pixel=256)
        .images(LineScan(base))
        .x.flux_w.sum()
        for o in (*outlines, whole)
    ]
    assert images[0] + images[1] == pytest.approx(images[2], rel=1e-6)  # rays at the common side to rounding


def test_the_nonsequential_estimator_refuses_outlines(folder):
    with pytest.raises(ValueError, match="mirror.outline = no whole disk: must be left out with estimator nonseq"):
        trace(scene_of("hexagon", folder), estimator="nonsequential", rays_per_pixel=8)


def test_a_changed_picture_is_another_trace(tmp_path):
    """A checkpoint of the picture as it was is not continued."""
    scene = scene_of("mask", tmp_path)
    facts = []
    for value in (0, 1):
        picture = ell_picture().copy()
        picture[0, 0] = value
        np.save(scene.mirror.outline.file, picture.astype(bool))
        os.utime(scene.mirror.outline.file, (value, value))
        facts.append(trace_fingerprint(scene, TraceOptions(), np.array([1]), {"device": "", "driver": ""}))
    assert facts[0] != facts[1]
