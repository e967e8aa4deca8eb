"""Cells of pixels, whole and cut by a rim: their areas, and how those change as the rim moves aside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from irtscots_cl.optics.pixel.edges import Circle
from irtscots_cl.optics.pixel.quadrature import PixelQuadrature, cut_cells, join, whole_cells, without
from irtscots_cl.optics.pixel.ray_map import OUTPUTS, RayMap

ALONG, ACROSS = (3, 2), (8, 9)  # intervals and Gauss points, different along s and t
_TERMS = ("", "a", "b", "s", "t")
_PLACE = {"": 0, "b": 1, "a": 2, "t": 3, "s": 4}  # of the monomials in RayMap.coefficient


@dataclass(frozen=True)
class Footprints:
    """Linear maps of n pixels onto the mirror: centre, step_s, step_t, step_a, step_b [n, 2] in mm.

    The pixel is the parallelogram centre +- step_s +- step_t; from the aperture point (a, b) it looks moved.
    """

    centre: np.ndarray
    step_s: np.ndarray
    step_t: np.ndarray
    step_a: np.ndarray
    step_b: np.ndarray

    @classmethod
    def at(cls, centre, turn=0.0, half=(1.0, 1.1), move=((0.004, 0.001), (-0.002, 0.005))):
        """Equal rectangles about the centres [n, 2], turned, of half edges `half`."""
        cosine, sine = np.cos(turn), np.sin(turn)
        steps = [(half[0] * cosine, half[0] * sine), (-half[1] * sine, half[1] * cosine), *move]
        centre = np.asarray(centre, float)
        return cls(centre, *(np.broadcast_to(np.array(step), centre.shape) for step in steps))

    def maps(self) -> RayMap:
        count = len(self.centre)
        coefficient = np.zeros((15, 4, count))
        for name, value in zip(_TERMS, (self.centre, self.step_a, self.step_b, self.step_s, self.step_t), strict=True):
            for k, axis in enumerate("xy"):
                coefficient[_PLACE[name], OUTPUTS.index(axis)] = value[:, k]
        return RayMap(np.zeros(count), np.arange(count), coefficient, np.zeros((2, count)))

    def share(self, radius_mm, a=0.0, b=0.0) -> np.ndarray:
        """Share [n] of each pixel's area within radius_mm of the axis: exact chords, many of them side by side.

        They run along the edge that the rim crosses more steeply, so that their lengths vary smoothly.
        """
        count = 20_000
        inward = np.abs((self.centre * self.step_s).sum(1)) >= np.abs((self.centre * self.step_t).sum(1))
        along, across = (np.where(inward[:, None] == first, self.step_s, self.step_t) for first in (True, False))
        place = ((np.arange(count) + 0.5) / count * 2 - 1)[None, :, None]
        start = (self.centre + a * self.step_a + b * self.step_b)[:, None] + place * across[:, None]
        # |start + s along| = radius: s^2 g + 2 s h + k = 0
        g, h = (along**2).sum(-1)[:, None], (start * along[:, None]).sum(-1)
        k = (start**2).sum(-1) - radius_mm**2
        root = np.sqrt(np.maximum(h * h - g * k, 0.0))
        ends = np.clip((-h - root) / g, -1, 1), np.clip((-h + root) / g, -1, 1)
        return np.mean((ends[1] - ends[0]) / 2, axis=1)

    def growth(self, radius_mm) -> np.ndarray:
        """Derivatives [2, n] of share along a and b."""
        step = 0.25
        return np.stack(
            [(self.share(radius_mm, *p * step) - self.share(radius_mm, *-p * step)) / (2 * step) for p in np.eye(2)]
        )


def cut(footprints, radius_mm) -> PixelQuadrature:
    return cut_cells(footprints.maps(), np.arange(len(footprints.centre)), Circle(radius_mm), ALONG, ACROSS)


def around(radius_mm, count, inward_mm):
    """Centres [count, 2] of pixels near a rim: all around it and up to inward_mm to both its sides."""
    angle = (np.arange(count) + 0.37) * 2 * np.pi / count
    distance = radius_mm + inward_mm * np.sin(np.arange(count) * 2.4)
    return np.stack([distance * np.cos(angle), distance * np.sin(angle)], -1)


def test_the_monomials_lie_where_the_footprints_put_them():
    maps = Footprints.at([[7.0, -3.0]], turn=0.3).maps()
    assert [maps.term("x", m)[0] for m in ("", "a", "b")] == [7.0, 0.004, -0.002]
    assert [maps.term("y", m)[0] for m in ("", "a", "b")] == [-3.0, 0.001, 0.005]
    assert [maps.term("x", "s")[0], maps.term("y", "t")[0]] == [np.cos(0.3), 1.1 * np.cos(0.3)]


# --- whole pixels ------------------------------------------------------------------------------------------


def test_whole_cells_tile_their_pixels():
    cells = whole_cells(np.array([4, 2]), 3, 2)
    np.testing.assert_array_equal(cells.pixel, [4] * 6 + [2] * 6)
    np.testing.assert_allclose(cells.sum(cells.weight, 6), [0, 0, 1, 0, 1, 0], rtol=0, atol=1e-15)  # rounding
    for first in (0, 6):  # six boxes that touch: their centres and half-lengths
        s, t = cells.s[first : first + 6], cells.t[first : first + 6]
        np.testing.assert_allclose(sorted(set(zip(s.round(12), t.round(12), strict=True))), [
            (-0.666666666667, -0.5), (-0.666666666667, 0.5), (0, -0.5), (0, 0.5), (0.666666666667, -0.5),
            (0.666666666667, 0.5),
        ], rtol=0, atol=1e-12)  # as rounded  # fmt: skip
    assert (cells.half_s == 1 / 3).all() and (cells.half_t == 1 / 2).all() and (cells.push == 0).all()
    # the second moments of cells and of what is inside them are a pixel's: 1/3
    moment = cells.sum(cells.weight * (cells.s**2 + cells.half_s**2 / 3), 6)[[2, 4]]
    np.testing.assert_allclose(moment, 1 / 3, rtol=1e-14)  # rounding


# --- pixels cut by a rim -----------------------------------------------------------------------------------

# (radius in half pixels, tolerance of a share): the presets' rim, and smaller ones, which bend more in a pixel
RADII = [(110.0, 1e-8), (30.0, 1e-8), (8.0, 3e-6)]


@pytest.mark.parametrize("turn", [0.0, 0.5])
@pytest.mark.parametrize(("radius_mm", "tolerance"), RADII)
def test_areas_of_cut_pixels_are_exact(radius_mm, tolerance, turn):
    footprints = Footprints.at(around(radius_mm, 101, 1.4), turn)
    cells = cut(footprints, radius_mm)
    expected = footprints.share(radius_mm)
    assert ((expected > 0.02) & (expected < 0.98)).sum() > 50
    # tolerance: Gauss points on pieces of the rim between the pixel's corners; 1e-8: the reference's 20,000 chords
    np.testing.assert_allclose(cells.sum(cells.weight, 101), expected, rtol=0, atol=tolerance)
    assert (cells.weight >= 0).all() and (np.diff(cells.pixel) >= 0).all()
    assert np.abs(cells.s).max() <= 1 and np.abs(cells.t).max() <= 1


@pytest.mark.parametrize(("radius_mm", "tolerance"), RADII)
def test_cut_pixels_have_the_right_moments(radius_mm, tolerance):
    """Centre of gravity and spread of the part on the mirror, with what the cells' own lengths add."""
    footprints = Footprints.at(around(radius_mm, 23, 0.8), 0.2)
    cells = cut(footprints, radius_mm)
    step = (np.arange(800) + 0.5) / 400 - 1
    s, t = (v.ravel() for v in np.meshgrid(step, step))
    for k in range(23):
        x, y = (footprints.centre[k, i] + s * footprints.step_s[k, i] + t * footprints.step_t[k, i] for i in (0, 1))
        on = np.hypot(x, y) <= radius_mm
        mine = cells.pixel == k
        weight, found_s, found_t = cells.weight[mine], cells.s[mine], cells.t[mine]
        moments = [
            (found_s, s), (found_t, t), (found_s * found_t, s * t),
            (found_s**2 + cells.half_s[mine] ** 2 / 3, s**2), (found_t**2 + cells.half_t[mine] ** 2 / 3, t**2),
        ]  # fmt: skip
        for found, expected in moments:
            assert weight @ found == pytest.approx(np.mean(np.where(on, expected, 0.0)), abs=2e-4)  # 800 x 800 points


@pytest.mark.parametrize("turn", [0.0, 0.5])
@pytest.mark.parametrize(("radius_mm", "tolerance"), RADII)
def test_push_is_the_growth_of_the_share_as_the_aperture_point_moves(radius_mm, tolerance, turn):
    footprints = Footprints.at(around(radius_mm, 101, 1.4), turn)
    cells = cut(footprints, radius_mm)
    growth = footprints.growth(radius_mm)
    assert np.abs(growth).max() > 1e-3  # a step of 0.005 mm over an edge of 2 mm
    for k in (0, 1):
        found = cells.sum(cells.push[k], 101)
        near = np.abs(footprints.maps().corner_radius - radius_mm).min(1) > 0.03  # a corner on the rim is a kink
        # the finite difference's cubic part and, where the rim bends, as many Gauss points as for the area
        np.testing.assert_allclose(found[near], growth[k][near], rtol=0, atol=1e-7 + tolerance / 10)
    assert (cells.push[:, cells.weight > 0] == 0).all()  # cells on the rim have no area


def test_cut_pixels_have_the_cells_that_were_asked_for():
    """3 intervals along s at 9 Gauss points of t, or 2 along t at 8 of s, on 5 pieces of which one has a length."""
    cells = cut(Footprints.at([[50.0, 0.3], [0.3, 50.0]]), 50.1)
    for pixel, lengths, intervals, points in [(0, "half_s", 3, 9), (1, "half_t", 2, 8)]:
        mine = (cells.pixel == pixel) & (cells.weight > 0)
        assert mine.sum() == intervals * points and (getattr(cells, lengths)[mine] > 0).all()
        assert ((cells.pixel == pixel) & (cells.weight == 0)).sum() == points  # on the rim


def test_pixels_inside_and_outside():
    """A rim that passes by: cut_cells may be asked about pixels that it does not cut."""
    footprints = Footprints.at([[6.0, 0.0], [0.0, 8.5], [11.8, 0.0], [-3.0, -13.0]])
    cells = cut(footprints, 10.0)
    np.testing.assert_allclose(cells.sum(cells.weight, 4), [1, 1, 0, 0], rtol=0, atol=1e-12)  # rounding
    assert (cells.push == 0).all()
    assert set(cells.pixel) == {0, 1}


@pytest.mark.parametrize("turn", [0.0, 0.4, np.pi / 4, 2.0])
def test_a_rim_through_a_corner_is_no_special_case(turn):
    """The corner (-1, -1) of the pixel lies on the rim, or 1e-9 mm to either side of it."""
    radius_mm = 50.0
    for aside in (-1e-9, 0.0, 1e-9):
        for direction in np.arange(12) * np.pi / 6 + 0.1:
            corner = (radius_mm + aside) * np.array([np.cos(direction), np.sin(direction)])
            shift = Footprints.at([[0.0, 0.0]], turn)
            footprints = Footprints.at([corner + shift.step_s[0] + shift.step_t[0]], turn)
            cells = cut(footprints, radius_mm)
            np.testing.assert_allclose(
                cells.sum(cells.weight, 1), footprints.share(radius_mm), rtol=0, atol=1e-7
            )  # chords of the reference at a corner
            lowest, highest = np.sort([cells.sum(cells.push[0], 1)[0], footprints.growth(radius_mm)[0, 0]])
            assert highest - lowest < 2e-5  # 0.005 of a pixel, the step to both sides of a kink, of 0.004


def test_a_rim_that_touches_only_a_corner():
    """From a corner that just lies in the mirror to one that just does not: shares fall as the square of the depth."""
    depth = np.array([0.3, 0.1, 0.03, 1e-2, 1e-3, 1e-5, 0.0, -1e-5, -0.1])
    half = np.hypot(1.0, 1.1)
    direction = np.array([1.0, 1.1]) / half  # of the pixel's diagonal
    footprints = Footprints.at((200.0 - depth + half)[:, None] * direction)
    cells = cut(footprints, 200.0)
    share, push = cells.sum(cells.weight, len(depth)), cells.sum(cells.push[0], len(depth))
    np.testing.assert_allclose(share, footprints.share(200.0), rtol=0, atol=3e-8)  # chords of the reference
    triangle = np.maximum(depth, 0) ** 2 / (2 * direction[0] * direction[1]) / 4.4
    np.testing.assert_allclose(share, triangle, rtol=0.02, atol=0)  # of a straight rim; this one bends
    assert (share[-3:] == 0).all() and (push[-3:] == 0).all()
    # along a the pixel moves by (0.004, 0.001): out of the mirror
    moved = 0.004 * direction[0] + 0.001 * direction[1]
    expected = -np.maximum(depth, 0) / (direction[0] * direction[1]) / 4.4 * moved
    np.testing.assert_allclose(push, expected, rtol=0.02, atol=0)  # the same


@pytest.mark.xfail(reason="a rim is taken to cross a pixel in one direction", strict=True)
def test_a_rim_within_a_pixel():
    footprints = Footprints.at([[0.1, 0.05]])
    cells = cut(footprints, 0.5)
    assert cells.sum(cells.weight, 1)[0] == pytest.approx(np.pi * 0.5**2 / 4.4, abs=1e-3)  # a coarse look


# --- several parts -----------------------------------------------------------------------------------------


def test_joined_cells_stand_pixel_by_pixel():
    first, second = whole_cells(np.array([0, 2, 5]), 2, 1), whole_cells(np.array([1, 3, 4]), 1, 3)
    cells = join([second, first])
    np.testing.assert_array_equal(cells.pixel, [0, 0, 1, 1, 1, 2, 2, 3, 3, 3, 4, 4, 4, 5, 5])
    np.testing.assert_allclose(cells.sum(cells.weight, 6), 1, rtol=1e-14)  # rounding
    assert (cells.half_s == np.where(np.isin(cells.pixel, [0, 2, 5]), 1 / 2, 1)).all()
    assert cells.push.shape == (2, 15)


def test_an_annulus_is_a_disk_without_a_disk():
    outer_mm, inner_mm = 60.0, 58.8  # a pixel may have both in it
    footprints = Footprints.at(np.concatenate([around(59.4, 41, 2.0), [[58.0, 1.0]]]), 0.3)
    count = len(footprints.centre)
    outer, hole = cut(footprints, outer_mm), cut(footprints, inner_mm)
    cells = without(outer, hole)
    expected = footprints.share(outer_mm) - footprints.share(inner_mm)
    np.testing.assert_allclose(cells.sum(cells.weight, count), expected, rtol=0, atol=1e-8)  # the reference's chords
    growth = footprints.growth(outer_mm) - footprints.growth(inner_mm)
    away = np.minimum(
        *(np.abs(footprints.maps().corner_radius - radius).min(1) for radius in (outer_mm, inner_mm))
    ) > 0.03  # fmt: skip
    for k in (0, 1):
        np.testing.assert_allclose(
            cells.sum(cells.push[k], count)[away], growth[k][away], rtol=0, atol=1e-7
        )  # as of one rim
    assert (np.diff(cells.pixel) >= 0).all()
    both = (footprints.share(inner_mm) > 0.01) & (footprints.share(outer_mm) < 0.99)
    assert both.any()
