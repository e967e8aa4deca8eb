"""Edges of mirrors as curves: on the edge, closed, and each a rim or a hole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from outlined import outline_of

from irtscots_cl.optics.outline_curves import edge_curves
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.mirror import Mirror

DIAMETER = 1000.0


def curves_of(kind, hole_mm=0.0, folder=None):
    outline = None if kind is None else outline_of(kind, DIAMETER, folder)
    mirror = Mirror(radius_mm=math.inf, diameter_mm=DIAMETER, obscuration_mm=hole_mm, outline=outline)
    surface = Surface.of(mirror)
    return surface, edge_curves(surface)


def area(curve):
    (x, y), (u, v) = curve.T, np.roll(curve, -1, axis=0).T
    return abs((x * v - u * y).sum()) / 2


@pytest.mark.parametrize(
    ("kind", "hole_mm", "rims", "holes"),
    [(None, 0.0, 1, 0), (None, 100.0, 1, 1), ("hexagon", 100.0, 1, 1), ("ell", 0.0, 1, 0), ("parts", 0.0, 5, 1),
     ("spiders", 0.0, 3, 0), ("mask", 0.0, 1, 0)],
)  # fmt: skip
def test_curves_are_the_rims_and_holes_of_the_pieces(kind, hole_mm, rims, holes, tmp_path):
    """The strip of "parts" cuts a piece from its ring, beside the hole, and its hexagon in two."""
    surface, curves = curves_of(kind, hole_mm, tmp_path)
    assert sum(not hole for _, hole in curves) == rims and sum(hole for _, hole in curves) == holes
    if kind != "mask":
        for curve, _ in curves:
            assert np.percentile(np.abs(surface.depth(*curve.T)[0]), 99) < 1e-6 * DIAMETER


def test_the_curve_has_the_polygons_area_and_corners():
    _, ((curve, _),) = curves_of("hexagon")
    assert area(curve) == pytest.approx((0.8 * DIAMETER) ** 2 * math.sqrt(3) / 2, rel=2e-4)  # corners are cut
    corner = 0.8 * DIAMETER / math.sqrt(3) * np.array([math.cos(math.radians(11)), math.sin(math.radians(11))])
    assert np.linalg.norm(curve - corner, axis=1).min() < 3.0  # mm: two steps of the curve


def test_curves_lie_as_the_mirror_does():
    """An L, which no flip or turn takes into itself: its foot goes towards +x, at the lowest y."""
    _, ((curve, _),) = curves_of("ell")
    low = curve[curve[:, 1] < -0.2 * DIAMETER / 2]
    high = curve[curve[:, 1] > 0.2 * DIAMETER / 2]
    assert low[:, 0].max() == pytest.approx(0.45 * DIAMETER / 2, abs=3.0) and high[:, 0].max() < 0
