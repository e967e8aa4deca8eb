"""Outlines of disks and polygons whose place is known, in pictures with noise, blur and uneven light."""

from __future__ import annotations

import numpy as np
import pytest
from mirror_pictures import blurred_disk, circle, disk, picture, share
from skimage.measure import points_in_poly

from irtscots_cl.measurement.mirror_mask import mirror_mask
from irtscots_cl.measurement.mirror_outline import NoOutlineError, fit_outline
from irtscots_cl.measurement.rim_curve import RimCurve

SHAPE = (40, 44)
MIDDLE, RADIUS = np.array([19.5, 21.5]), 14.3


def fitted(signal, expected=None, **kind):
    return fit_outline(signal, mirror_mask(signal), circle(MIDDLE, RADIUS) if expected is None else expected, **kind)


@pytest.mark.parametrize("blur", [0.0, 0.5, 1.2])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.37, -0.21), (3.4, -2.6)])
def test_shift_and_size_are_found(blur, shift):
    signal = picture(disk(SHAPE, MIDDLE + shift, 1.02 * RADIUS), noise=0.0, blur=blur)
    found = fitted(signal)
    np.testing.assert_allclose(found.shift_px, shift, atol=0.02)  # light that falls by 45 % moves it by 0.01
    assert found.scale == pytest.approx(1.02, abs=0.02 / RADIUS)
    assert found.seen > 0.95 and found.residual_px < 0.05


@pytest.mark.parametrize(
    ("pictures", "limits"),
    [(20, (0.65, 1.35)), pytest.param(150, (0.87, 1.13), marks=pytest.mark.slow)],
)
@pytest.mark.parametrize(("noise", "photons", "blur"), [(2.0, 0.0, 0.5), (0.5, 0.3, 0.8)])
def test_error_bars_of_shift_are_those_of_noisy_pictures(noise, photons, blur, pictures, limits):
    """Two shifts a picture: the pulls' scatter is known to 11 and 4 %: 3 sigma (0.3 %). The seeds are fixed.

    All pixels of a piece have one weight: with photon noise the error bars are up to a tenth too small (1.147 here).
    """
    random = np.random.default_rng(3)
    pulls, errors = [], []
    for k in range(pictures):
        shift = random.uniform(-0.5, 0.5, 2)
        light = blurred_disk(SHAPE, MIDDLE + shift, RADIUS, blur)
        signal = picture(light, noise, seed=1000 * pictures + k, blur=0.0, photons=photons)
        found = fitted(signal)
        pulls.append((found.shift_px - shift) / found.shift_error_px)
        errors.append(found.shift_px - shift)
    assert limits[0] < np.std(pulls) < limits[1] + (0.1 if photons else 0.0)
    assert np.abs(np.mean(errors, axis=0)).max() < 0.02  # pixels
    assert np.abs(np.mean(pulls)) < 0.6


def test_holes_and_polygons():
    signal = picture(disk(SHAPE, MIDDLE, 16.0, hole=6.0, hole_centre=np.add(MIDDLE, [0.6, 0.3])), noise=0.5)
    hole = fitted(signal, circle(MIDDLE, 6.0, hole=True), start=fitted(signal, circle(MIDDLE, 16.0)))
    np.testing.assert_allclose(hole.shift_px, [0.6, 0.3], atol=0.04)
    corners = np.array([[5.3, 7.2], [7.1, 36.4], [33.8, 38.0], [32.2, 5.1]])

    def inside(row, column):
        places = np.stack([row - 0.45, column + 0.2], -1).reshape(-1, 2)
        return points_in_poly(places, corners).reshape(row.shape)

    found = fitted(picture(share(SHAPE, inside), noise=0.5), RimCurve.of_polygon(corners))
    np.testing.assert_allclose(found.shift_px, [0.45, -0.2], atol=0.03)


def test_what_hides_a_part_of_the_rim_moves_nothing():
    """A hand over a seventh of the rim: found as such, the rest to 0.03 pixel."""
    on_mirror = disk(SHAPE, np.add(MIDDLE, [0.3, -0.4]), RADIUS)
    on_mirror[15:25, 28:] = 0
    found = fitted(picture(on_mirror, noise=0.5))
    np.testing.assert_allclose(found.shift_px, [0.3, -0.4], atol=0.05)
    hidden = found.place[found.hidden]
    assert 0.05 < found.hidden.mean() < 0.4 and (hidden[:, 1] > 27).all()


def test_shares_of_pixels_are_those_of_the_outline_found():
    truth = disk(SHAPE, np.add(MIDDLE, [0.31, -0.42]), RADIUS)
    found = fitted(picture(truth, noise=0.5))
    coverage = found.curve.coverage(SHAPE)
    np.testing.assert_allclose(coverage, truth, atol=0.06)
    assert ((coverage == 1) == (truth == 1)).mean() > 0.99
    hole = circle(MIDDLE, 5.0, hole=True).coverage(SHAPE)
    np.testing.assert_allclose(hole, 1 - disk(SHAPE, MIDDLE, 5.0), atol=0.05)


def test_a_mirror_larger_than_the_picture_is_found_by_its_sides():
    signal = picture(disk(SHAPE, np.add(MIDDLE, [0.2, 0.3]), 20.3), noise=0.5)
    found = fitted(signal, circle(MIDDLE, 20.3))
    np.testing.assert_allclose(found.shift_px, [0.2, 0.3], atol=0.15)  # the top and the bottom are outside
    assert 0.3 < found.seen < 0.7


def test_pictures_without_the_mirror_are_refused():
    signal = picture(disk(SHAPE, MIDDLE, RADIUS), noise=1.0)
    with pytest.raises(NoOutlineError, match=r"the outline is 6 pixels wide; must be 8 or more"):
        fitted(signal, circle(MIDDLE, 3.0))
    with pytest.raises(NoOutlineError, match="no edge of the bright region lies in the picture"):
        fit_outline(np.full(SHAPE, 5.0), np.ones(SHAPE, bool), circle(MIDDLE, RADIUS))
    with pytest.raises(NoOutlineError, match="no pixel is bright"):
        fit_outline(signal, np.zeros(SHAPE, bool), circle(MIDDLE, RADIUS))
    far = np.zeros(SHAPE)
    far[2:6, 2:6] = 100
    with pytest.raises(NoOutlineError, match="of the expected rim has an edge in the picture; must be 30% or more"):
        fit_outline(far, far > 0, circle(MIDDLE, RADIUS))
