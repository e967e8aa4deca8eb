"""Marks in made pictures: found to a fraction of a pixel, with error bars; other things are none."""

from __future__ import annotations

import numpy as np
import pytest
from mirror_pictures import Marked, picture

from irtscots_cl.imaging.mark_files import Mark
from irtscots_cl.measurement.fiducials import MarkShape, find_marks

LAB = Marked()
SIZES = {"dot": 56.0, "cross": 90.0}  # 3.4 and 5.4 pixels; arms of 1.8


def found_in(signal, kind="dot"):
    marks = LAB.marks(kind, size_mm=SIZES[kind])
    shape = MarkShape(marks.marks[0], LAB.mm_per_px(LAB.rim.centre))
    return find_marks(signal, LAB.region(), shape)


def true_places():
    x, y = np.array(LAB.POINTS, float).T
    return np.stack(LAB.chief.pixel(x, y), -1)


def nearest(found, places):
    at = np.array([one.place_px for one in found])
    return [int(np.argmin(np.hypot(*(at - place).T))) for place in places]


@pytest.mark.parametrize("kind", ["dot", "cross"])
@pytest.mark.parametrize("blur", [0.0, 0.7, 1.2])
def test_marks_are_found_to_a_fraction_of_a_pixel(kind, blur):
    signal = picture(LAB.light(LAB.marks(kind, size_mm=SIZES[kind])), noise=0.0, blur=blur)
    found = found_in(signal, kind)
    assert len(found) == len(LAB.POINTS)
    errors = [found[k].place_px - place for place, k in zip(true_places(), nearest(found, true_places()), strict=True)]
    assert np.abs(errors).max() < 0.08  # of marks beside the rim, which have a part of their surroundings only
    assert np.abs(np.mean(errors, axis=0)).max() < 0.03


def test_bright_marks():
    on_mirror = LAB.light(LAB.marks())
    whole = LAB.light(LAB.marks(), without=range(7))
    signal = picture(whole + 0.6 * (whole - on_mirror), noise=0.5)
    shape = MarkShape(Mark(name="A", x_mm=0.0, y_mm=0.0, size_mm=56.0, bright=True), LAB.mm_per_px(LAB.rim.centre))
    assert len(find_marks(signal, LAB.region(), shape)) == 7
    assert found_in(signal) == []


def test_error_bars_of_places():
    """8 pictures, 7 marks, 2 coordinates: the pulls' scatter is known to 7 %; 3 sigma."""
    clean = picture(LAB.light(LAB.marks()), noise=0.0, blur=0.6)
    places, pulls, errors = true_places(), [], []
    for seed in range(8):
        found = found_in(clean + 2.0 * np.random.default_rng(seed).standard_normal(clean.shape))
        for place, k in zip(places, nearest(found, places), strict=True):
            errors.append(found[k].place_px - place)
            pulls.append(errors[-1] / np.sqrt(np.diag(found[k].covariance)))
    assert 0.79 < np.std(pulls) < 1.21
    assert np.abs(np.mean(errors, axis=0)).max() < 0.02


def test_noise_edges_and_bars_are_no_marks():
    signal = picture(LAB.light(LAB.marks(), without=range(7)), noise=3.0)
    assert found_in(signal) == []
    signal[30, :] *= 0.4
    assert found_in(signal) == []


def test_marks_of_a_pixel_are_refused():
    shape = MarkShape(Mark(name="A", x_mm=0.0, y_mm=0.0, size_mm=15.0), LAB.mm_per_px(LAB.rim.centre))
    with pytest.raises(ValueError, match=r"mark A: size_mm = 15: is 0\.\d+ pixels wide in the picture; must be 1.2"):
        find_marks(np.ones((64, 64)), LAB.region(), shape)
