"""Figures of maps against closed forms and hand calculations."""

import numpy as np
import pytest

from irtscots_cl.maths.low_order import TERMS, remove_terms
from irtscots_cl.maths.map_figures import Unit, all_figures, enclosing_disk, figures, zernike_figures
from irtscots_cl.maths.zernike.polynomials import zernike

RADIUS = 40.0


def disk_map(terms, pixels=101):
    """Heights in mm of Noll terms on a disk of 40 mm about (3, -2), x and y; NaN outside."""
    place = (np.arange(pixels) - (pixels - 1) / 2) * 2 * RADIUS / (pixels - 1)
    u, v = np.meshgrid(place / RADIUS, place / RADIUS)
    heights = sum(value * zernike(noll, u, v) for noll, value in terms.items()) + 0 * u
    heights[u * u + v * v > 1] = np.nan
    return heights, u * RADIUS + 3.0, v * RADIUS - 2.0


def test_terms_are_removed_in_turn():
    """Terms that are Noll-normalised and orthogonal: what is left is the root of the others' sum of squares."""
    terms = {1: 7e-4, 2: 3e-4, 3: 4e-4, 4: 1e-4, 5: 2e-5, 6: 2e-5, 7: 1e-5}
    found = all_figures(*disk_map(terms, 301))
    assert [one.removed for one in found] == list(TERMS)
    gone = [(), (1,), (1, 2, 3), (1, 2, 3, 4), (1, 2, 3, 4, 5, 6)]
    for one, without in zip(found, gone, strict=True):
        wanted = np.sqrt(sum(value**2 for noll, value in terms.items() if noll not in without))
        assert one.rms_mm == pytest.approx(wanted, rel=0.01)  # a disk of pixels, not quite a disk


def test_astigmatism_is_removed_whole():
    heights, x, y = disk_map({5: 1e-4, 6: -3e-4})
    left = remove_terms(x, y, heights, np.isfinite(heights), "piston_tilt_power_astigmatism")
    assert np.nanmax(np.abs(left)) < 1e-16


def test_pv_and_slopes_of_a_plane():
    x, y = np.meshgrid(np.arange(7) * 0.5, np.arange(5) * 0.2)
    heights = 1e-3 * x - 2e-3 * y
    heights[2, 3] = np.nan
    found = figures(heights, x, y, "none")
    assert found.pv_mm == pytest.approx(1e-3 * 3.0 + 2e-3 * 0.8)
    assert found.slope_rms_rad == pytest.approx((1e-3, 2e-3))
    assert found.pixels == 34
    flat = figures(heights, x, y, "piston_tilt")
    assert flat.rms_mm < 1e-17 and max(flat.slope_rms_rad) < 1e-16


def test_few_pixels():
    heights, x, y = np.full((3, 3), np.nan), *np.meshgrid(np.arange(3.0), np.arange(3.0))
    heights[0, :2] = 1.0, 2.0
    found = all_figures(heights, x, y)
    assert [one.removed for one in found] == ["none", "piston"]
    assert found[0].slope_rms_rad[0] == 1.0 and np.isnan(found[0].slope_rms_rad[1])


def test_the_disk_holds_the_pixels_whole():
    heights, x, y = disk_map({4: 1e-4})
    disk = enclosing_disk(heights, x, y)
    assert (disk.x_mm, disk.y_mm) == pytest.approx((3.0, -2.0))
    assert disk.radius_mm == pytest.approx(RADIUS + 0.4)  # half a pixel of 0.8 mm


def test_zernike_terms_are_those_of_the_map_on_its_disk():
    terms = {2: 3e-4, 4: 1e-4, 7: 2e-5, 11: -1e-5}
    heights, x, y = disk_map(terms)
    found = zernike_figures(heights, x, y, disk=Unit(RADIUS, 3.0, -2.0))
    assert found.dropped == () and len(found.nolls) == 36
    for noll, value in zip(found.nolls, found.coefficients_mm, strict=True):
        assert value == pytest.approx(terms.get(noll, 0.0), abs=1e-15)
    # half a pixel more of radius is 2 % more of focus: the disk is told, not guessed
    wide = zernike_figures(*disk_map({4: 1e-4}))
    focus = wide.coefficients_mm[wide.nolls.index(4)]
    assert focus == pytest.approx(1e-4 * (1 + 0.4 / RADIUS) ** 2, rel=1e-9)


def test_pvr_is_the_fits_pv_and_three_times_the_rest():
    heights, x, y = disk_map({4: 1e-4})
    noise = np.random.default_rng(1).normal(0, 1e-6, heights.shape)
    found = zernike_figures(heights + noise, x, y, disk=Unit(RADIUS, 3.0, -2.0))
    pv = np.sqrt(3) * 2 * 1e-4
    assert found.rest_rms_mm == pytest.approx(1e-6, rel=0.03)  # 7845 pixels know it to 0.8 %
    assert found.pvr_mm == pytest.approx(pv + 3e-6, abs=1.5e-6)  # the fit's rim has noise of 0.1 nm rms and more
    spike = heights.copy()
    spike[50, 50] += 5e-5  # one wild pixel changes the PV, hardly PVr
    assert zernike_figures(spike, x, y, disk=Unit(RADIUS, 3.0, -2.0)).pvr_mm < pv + 5e-6


def test_terms_that_pixels_cannot_tell_apart_are_dropped_and_named():
    heights, x, y = disk_map({4: 1e-4})
    heights[np.abs(y + 2) > 1] = np.nan  # three rows
    found = zernike_figures(heights, x, y)
    assert found.dropped and not set(found.dropped) & set(found.nolls)
    with pytest.raises(ValueError, match="no valid pixel is on the disk"):
        zernike_figures(heights, x, y, disk=Unit(1.0, 500.0, 500.0))


def test_all_pixels_of_a_large_map_are_fitted():
    heights, x, y = disk_map({4: 1e-4}, 301)
    found = zernike_figures(heights, x, y, disk=Unit(RADIUS, 3.0, -2.0))
    assert found.fitted_pixels == np.isfinite(heights).sum() == 70681
    assert found.coefficients_mm[found.nolls.index(4)] == pytest.approx(1e-4, rel=1e-9)


def test_slopes_of_a_sine():
    """Differences of neighbours see sin(pi p / L) / (pi p / L) of the slope 2 pi A / L / sqrt 2, along x alone."""
    length, amplitude, pitch = 20.0, 1e-4, 2.0
    x, y = np.meshgrid(np.arange(201) * pitch, np.arange(5) * pitch)
    found = figures(amplitude * np.sin(2 * np.pi * x / length), x, y, "none")
    wanted = np.sqrt(2) * np.pi * amplitude / length * np.sinc(pitch / length)
    assert found.slope_rms_rad == (pytest.approx(wanted, rel=1e-6), 0.0)
