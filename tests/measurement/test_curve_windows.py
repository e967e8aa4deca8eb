"""Windows on light curves: the light is found wherever it lies, and every sample is counted inside or outside."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from noisy_images import images_of, setup_of, small, sparse_stack

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.measurement.curve_windows import GUARD, MARGIN, find_light, line_pitch, place_windows

PITCH, LINES = 0.2, 31
HALF = 3.0  # lines: half-extent of the synthetic light, a parabola
ROUNDING = 1e-9


def scan_of(curves: np.ndarray) -> Scan:
    """A scan [lines, 1, n] of curves [n, lines], whose first line is not at 0."""
    return Scan.from_images("x", 1.7 + PITCH * np.arange(curves.shape[1]), curves.T[:, None, :])


def parabolas(places: np.ndarray, lines: int = LINES) -> np.ndarray:
    """Curves [n, lines] with light of height 1 at places [n], in lines."""
    return np.maximum(1 - ((np.arange(lines) - np.asarray(places)[:, None]) / HALF) ** 2, 0.0)


def reach_of(count: int) -> np.ndarray:
    return np.full(count, HALF * PITCH)


def found_in(curves: np.ndarray, usable: np.ndarray | None = None) -> np.ndarray:
    usable = np.ones(curves.shape[1], bool) if usable is None else usable
    return find_light(scan_of(curves), curves, reach_of(len(curves)), usable)


# --- where the light is -------------------------------------------------------------------------------------

PLACES = np.arange(HALF, LINES - 1 - HALF, 0.37)


@pytest.mark.parametrize("background", ["none", "pedestal", "slope", "negative"])
@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_light_is_found_at_any_place(background, noise):
    curves = parabolas(PLACES) + np.random.default_rng(1).normal(0, noise, (len(PLACES), LINES))
    if background != "none":
        line = np.arange(LINES)
        curves += {"pedestal": 5.0 + 0 * line, "slope": 0.4 - 0.005 * line, "negative": -0.3 + 0 * line}[background]
    # a slope moves the centroid of the box; the window's margin must still hold it
    limit = MARGIN if background == "slope" else 0.3
    assert np.abs(found_in(curves) - PLACES).max() < limit


@pytest.mark.parametrize("places", [np.linspace(-1.0, HALF, 9), np.linspace(LINES - 1 - HALF, LINES, 9)])
def test_light_that_the_scan_cuts_off_is_found_at_its_end(places):
    lit = parabolas(places)
    assert (np.abs(found_in(lit) - np.clip(places, 0, LINES - 1)) < 1.5).all()  # of what is left of it


def test_a_curve_without_samples_has_no_place():
    curves = parabolas(PLACES[:3])
    curves[1] = np.nan
    assert np.isnan(found_in(curves)).tolist() == [False, True, False]
    assert np.isnan(found_in(parabolas(PLACES[:3]), np.zeros(LINES, bool))).all()


def test_a_frame_that_does_not_count_hides_no_light():
    """The room's light in a frame is far brighter than the screen's; the frame is left out."""
    curves = parabolas(PLACES)
    curves[:, 14] += 50.0
    usable = np.arange(LINES) != 14
    assert np.abs(found_in(curves, usable) - PLACES).max() < 1.0  # without one sample, at the peak for some
    assert np.abs(found_in(curves) - PLACES).max() > 5.0  # or there was nothing to leave out


# --- inside and outside -------------------------------------------------------------------------------------


def test_every_sample_is_counted_once_by_brute_force():
    random = np.random.default_rng(2)
    count = 60
    curves = random.normal(0.3, 1.0, (count, LINES))
    curves[random.random(curves.shape) < 0.05] = np.nan
    usable = random.random(LINES) < 0.9
    reach = random.uniform(0.5, HALF, count) * PITCH
    place = random.uniform(-1, LINES, count)
    windows = place_windows(scan_of(curves), curves, place, reach, usable, HALF * PITCH)
    width = windows.allowed.shape[1]
    for n in range(count):
        half = reach[n] / PITCH + 0.5 + MARGIN
        sums, allowed = np.zeros(6), {}
        for line in range(LINES):
            value, distance = curves[n, line], abs(line - place[n])
            if not usable[line] or np.isnan(value):
                continue
            in_window = 0 <= line - windows.first[n] < width
            if in_window and distance <= half:
                allowed[line] = value
            if not (in_window and distance <= half + GUARD):
                t = line - (LINES - 1) / 2
                sums += [1, t, t * t, value, t * value, value * value]
        np.testing.assert_allclose(windows.outside[:, n], sums, rtol=ROUNDING, atol=ROUNDING)
        of_window = {
            int(line): value
            for line, value, counts in zip(windows.lines[n], windows.samples[n], windows.allowed[n], strict=True)
            if counts
        }
        assert of_window == allowed
        assert (windows.samples[n][~windows.allowed[n]] == 0).all()


def test_the_light_lies_inside_and_only_background_outside():
    curves = parabolas(PLACES) + 0.25
    usable = np.ones(LINES, bool)
    windows = place_windows(scan_of(curves), curves, found_in(curves), reach_of(len(curves)), usable, HALF * PITCH)
    np.testing.assert_allclose(windows.outside[3] / windows.outside[0], 0.25, rtol=1e-12)  # nothing of the light
    light = (windows.samples - 0.25 * windows.allowed).sum(1)
    np.testing.assert_allclose(light, parabolas(PLACES).sum(1), rtol=1e-12)  # all of it


def test_a_part_of_the_windows_is_the_windows_of_a_part():
    curves = np.random.default_rng(3).normal(size=(20, LINES))
    usable, place = np.ones(LINES, bool), np.linspace(2, 28, 20)
    whole = place_windows(scan_of(curves), curves, place, reach_of(20), usable, HALF * PITCH)
    chosen = np.array([3, 17, 4])
    few = place_windows(scan_of(curves[chosen]), curves[chosen], place[chosen], reach_of(3), usable, HALF * PITCH)
    part = whole.part(chosen)
    for name in ("first", "allowed", "samples", "outside", "lines"):
        np.testing.assert_allclose(getattr(part, name), getattr(few, name), rtol=ROUNDING, err_msg=name)


def test_curves_that_a_simulation_stores_in_part_are_dark_elsewhere():
    """The same windows and sums as of whole images, whichever lines are left out."""
    scene = small(25)
    sparse, dense = sparse_stack(scene), images_of(scene).stack()
    half_width, box_row, box_column = setup_of(scene).chief_rays.light_shape(0)
    reach = (half_width + (box_row + box_column) / 2).ravel()
    for axis in "xy":
        few, whole = getattr(sparse, axis), getattr(dense, axis)
        assert few.flux_w.shape[2] < whole.flux_w.shape[2]  # or there is nothing to test
        whole = dataclasses.replace(whole, pixels=few.pixels, first_line=np.zeros(len(few.pixels), np.int64))
        curves = dense.x.flux_w[0] if axis == "x" else dense.y.flux_w[0]
        curves = curves[few.pixels]
        own, widest = reach[few.pixels], float(reach[few.pixels].max())
        for usable in (np.ones(21, bool), np.arange(21) % 7 != 3):
            places = [find_light(s, c, own, usable) for s, c in ((few, few.flux_w[0]), (whole, curves))]
            lit = curves[:, usable].max(1) > 0.1 * curves.max()
            np.testing.assert_allclose(places[0][lit], places[1][lit], atol=1e-6)
            one, other = (
                place_windows(s, c, places[1], own, usable, widest) for s, c in ((few, few.flux_w[0]), (whole, curves))
            )
            np.testing.assert_array_equal(one.allowed, other.allowed)
            np.testing.assert_array_equal(one.samples, other.samples)
            p = curves.max()
            scale = 21 * np.array([1, 10, 100, p, 10 * p, p * p])[:, None]  # of sums that light is subtracted from
            np.testing.assert_allclose(one.outside / scale, other.outside / scale, rtol=0, atol=1e-15)


def test_the_pitch_of_a_single_line_is_one():
    assert line_pitch(scan_of(np.ones((2, 1)))) == 1.0
    assert line_pitch(scan_of(np.ones((2, 5)))) == pytest.approx(PITCH)
