"""Outlines of mirrors: on the host and on the device against a plain oracle, and distances from their edges."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from outlined import OUTLINED, is_on, outline_of
from scenes import with_part

from irtscots_cl.optics.outline import Polygon
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.outline import Outline, Spider
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.checks.probes import MeetProbe

DIAMETER, HOLE = 1000.0, 60.0
NEAR = {"fp32": 2e-6, "fp64": 1e-10}  # of the diameter: 2 mm are 4 steps of single precision at 500 mm, with margin


@pytest.fixture(scope="module", params=OUTLINED)
def mirror(request, tmp_path_factory) -> Mirror:
    outline = outline_of(request.param, DIAMETER, tmp_path_factory.mktemp("outline"))
    return Mirror(radius_mm=math.inf, diameter_mm=DIAMETER, obscuration_mm=HOLE, outline=outline)


def oracle(mirror: Mirror, x, y) -> np.ndarray:
    return np.array([is_on(mirror.outline, mirror.diameter_mm, mirror.obscuration_mm, *at) for at in zip(x, y)])  # noqa: B905


def anywhere(count: int, seed: int) -> np.ndarray:
    """Points [2, count] all over the disk and beside it."""
    return np.random.default_rng(seed).uniform(-0.53 * DIAMETER, 0.53 * DIAMETER, (2, count))


def beside_edges(mirror: Mirror, away_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Points [2, n] at that distance from the edge, and whether they lie on the mirror, by the oracle alone.

    Pairs of points on both sides of the edge are halved until they are near enough to it.
    """
    x, y = anywhere(1200, 5)
    on = oracle(mirror, x, y)
    inside, outside = np.stack([x, y])[:, on], np.stack([x, y])[:, ~on]
    count = min(inside.shape[1], outside.shape[1], 250)
    inside, outside = inside[:, :count], outside[:, :count]
    while np.abs(inside - outside).max() > away_mm:
        middle = (inside + outside) / 2
        here = oracle(mirror, *middle)
        inside, outside = np.where(here, middle, inside), np.where(here, outside, middle)
    # away from each other again: crossings at a flat angle come too near to the edge, which the caller counts
    step = inside - outside
    step *= away_mm / np.linalg.norm(step, axis=0)
    points = np.concatenate([inside + step, outside - step], 1)
    return points, oracle(mirror, *points)


def test_points_anywhere_are_those_of_the_oracle(mirror):
    x, y = anywhere(4000, 1)
    on = Surface.of(mirror).contains(x, y)
    np.testing.assert_array_equal(on, oracle(mirror, x, y))
    assert 0.05 < on.mean() < 0.9


def test_points_at_edges_are_those_of_the_oracle_to_1e_9_of_the_size(mirror):
    points, expected = beside_edges(mirror, 1e-9 * DIAMETER)
    np.testing.assert_array_equal(Surface.of(mirror).contains(*points), expected)
    assert 0.2 < expected.mean() < 0.8


def test_the_device_has_the_same_points(mirror, device, precision):
    scene = with_part(replace(load_scene("sphere"), mirror=mirror), "mirror")
    near, known = beside_edges(mirror, 2 * NEAR[precision] * DIAMETER)
    depth = np.abs(Surface.of(mirror).depth(*near)[0]) if mirror.outline.file is None else np.inf
    far = depth > NEAR[precision] * DIAMETER  # others are nearer to the edge than rounding
    assert np.mean(far) > 0.5
    points = np.concatenate([anywhere(4000, 2), near[:, np.broadcast_to(far, known.shape)]], 1)
    probe = MeetProbe(device, scene, precision)
    found = probe(np.concatenate([points, np.zeros_like(points)]).astype(probe.real))
    np.testing.assert_array_equal(found.on_mirror, oracle(mirror, *points))


def test_depth_has_the_sign_of_contains_and_is_a_distance(mirror):
    """It grows by at most one per step, so no edge is nearer than it says."""
    surface = Surface.of(mirror)
    x, y = anywhere(3000, 3)
    depth, toward_x, toward_y = surface.depth(x, y)
    np.testing.assert_array_equal(depth > 0, oracle(mirror, x, y))
    turn = np.random.default_rng(4).uniform(0, 2 * np.pi, x.shape)
    for share in (0.3, 0.99):
        step = share * np.abs(depth)
        moved = surface.contains(x + step * np.cos(turn), y + step * np.sin(turn))
        np.testing.assert_array_equal(moved, depth > 0)
    if mirror.outline.file is None:
        step = 1e-5
        ahead = surface.depth(x + step * toward_x, y + step * toward_y)[0]
        kinks = np.abs(ahead - depth - step) > 1e-9
        assert kinks.mean() < 0.01  # only where two edges are equally near
        np.testing.assert_allclose(np.hypot(toward_x, toward_y), 1.0, atol=1e-9)


def test_a_margin_widens_the_mirror_and_narrows_what_is_cut_from_it(mirror):
    surface, (x, y) = Surface.of(mirror), anywhere(3000, 6)
    on, wide = surface.contains(x, y), surface.contains(x, y, 20.0)
    assert (wide | ~on).all() and wide.sum() > on.sum()
    if mirror.outline.file is None:
        near = surface.depth(x, y)[0] > -10.0
        assert wide[near].all()
    assert not surface.contains(x, y, 20.0)[np.hypot(x, y) > DIAMETER / 2 + 20.0].any()


def test_points_that_are_no_numbers_are_beside_every_mirror(mirror):
    surface, none = Surface.of(mirror), np.array([np.nan, 0.0])
    assert not surface.contains(none, none[::-1]).any()
    assert not surface.contains(none, none[::-1], 5.0).any()


def test_sides_that_are_level_but_for_rounding_leave_no_gap(device):
    """The end of a strip at 90 degrees is level to 1e-15 mm; a ray on that height crosses both long sides or none."""
    outline = Outline(spider=(Spider(width_mm=25.0, angles_deg=(90.0,)),))
    mirror = Mirror(radius_mm=math.inf, diameter_mm=DIAMETER, outline=outline)
    x, y = (v.ravel() for v in np.meshgrid([-438.0, -20.0, 20.0, 438.0], [-1e-15, -1e-16, 0.0, 1e-16, 1e-15]))
    assert Surface.of(mirror).contains(x, y).all()
    probe = MeetProbe(device, with_part(replace(load_scene("sphere"), mirror=mirror), "mirror"), "fp32")
    assert probe(np.stack([x, y, 0 * x, 0 * x]).astype(probe.real)).on_mirror.all()


def test_depth_of_a_square_in_closed_form():
    square = Polygon(np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]))
    x, y = np.array([0.9, 0.0, 2.0, 4.0, -1.5]), np.array([0.0, -0.7, 0.0, 5.0, 0.3])
    depth, toward_x, toward_y = square.depth(x, y)
    np.testing.assert_allclose(depth, [0.1, 0.3, -1.0, -5.0, -0.5], atol=1e-15)
    np.testing.assert_allclose(toward_x, [-1, 0, -1, -0.6, 1], atol=1e-15)
    np.testing.assert_allclose(toward_y, [0, 1, 0, -0.8, 0], atol=1e-15)


def test_a_picture_lies_upright(tmp_path):
    """Row and column grow with y and x, as in all arrays here."""
    mirror = Mirror(radius_mm=math.inf, diameter_mm=DIAMETER, outline=outline_of("mask", DIAMETER, tmp_path))
    x, y = np.array([-200.0, -200.0, 200.0, 200.0]), np.array([-200.0, 200.0, -200.0, 200.0])
    np.testing.assert_array_equal(Surface.of(mirror).contains(x, y), [True, True, True, False])


@pytest.mark.parametrize("shape", [{}, {"shape": "rectangle", "size_mm": (3.0, 60.0), "centre_mm": (20.0, 0.0)}])
def test_spiders_that_leave_nothing_are_refused_and_thinner_ones_not(shape):
    def of(width_mm):
        spider = Spider(width_mm=width_mm, ends_mm=((-200.0, 1.0), (200.0, 1.0)))
        return Surface.of(Mirror(radius_mm=1500.0, diameter_mm=100.0, outline=Outline(**shape, spider=(spider,))))

    with pytest.raises(
        ValueError, match=r"^mirror\.outline\.spider = 1 table: must leave a part of the mirror"
    ) as caught:
        of(103.0)
    assert "\n" not in str(caught.value)
    assert of(56.0).contains(21.0, 29.5)


def test_a_mask_beside_the_disk_or_in_its_hole_is_refused(tmp_path):
    np.save(tmp_path / "mask.npy", np.pad(np.ones((10, 10), bool), 1))

    def of(**changes):
        outline = Outline(shape="mask", file=str(tmp_path / "mask.npy"), pitch_mm=1.0, **changes)
        return Surface.of(Mirror(radius_mm=1500.0, diameter_mm=100.0, obscuration_mm=20.0, outline=outline))

    # its pixels that are not 0 go 5 mm to each side; the disk's rim is 50 mm from the middle
    for beside in ((55.1, 0.0), (40.0, 41.0), (0.0, 0.0)):
        with pytest.raises(ValueError, match=r"mask\.npy': has no pixel on the mirror, a disk of diameter 100 mm"):
            of(centre_mm=beside)
    assert of(centre_mm=(54.9, 0.0)).contains(49.95, 0.2)
    assert of(centre_mm=(3.0, 3.0)).contains(7.9, 7.9)
