"""Power spectral density and structure function of maps against closed forms and direct sums.

Heights are of the order of 1: pytest.approx lets everything below 1e-12 pass.
"""

import itertools

import numpy as np
import pytest
from scipy.signal.windows import hann

from irtscots_cl.maths.map_spectrum import radial_psd, structure_function

PITCH = (0.5, 0.25)


def test_white_noise_is_flat_and_its_power_is_its_variance():
    """Pixels of variance s^2 have the density s^2 x pitch_x x pitch_y at all frequencies."""
    noise = np.random.default_rng(1).normal(0, 2.0, (128, 96))
    psd = radial_psd(noise, PITCH)
    wanted = 4.0 * PITCH[0] * PITCH[1]
    pulls = (psd.psd_mm4 / wanted - 1) * np.sqrt(psd.samples / 4.0)
    # Hann correlates neighbours: fewer independent samples; 5 sigma of 48 bins fail by chance once in 30,000
    assert np.abs(pulls).max() < 5
    mean = np.average(psd.psd_mm4, weights=psd.samples)
    assert mean == pytest.approx(wanted, rel=0.06)  # 12,288 pixels, half of them under the window: 1.8 % a sigma
    assert psd.window_share == pytest.approx(1.0)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_ripple_is_at_its_frequency_with_its_power(axis):
    rows, columns = 120, 80
    x, y = np.meshgrid(np.arange(columns) * PITCH[0], np.arange(rows) * PITCH[1])
    frequency = 0.4
    psd = radial_psd(np.cos(2 * np.pi * frequency * (y if axis else x)), PITCH)
    assert psd.frequency_per_mm[np.argmax(psd.psd_mm4)] == pytest.approx(frequency, abs=0.03)
    cell = 1 / (rows * PITCH[1] * columns * PITCH[0])  # of the plane of frequencies
    assert (psd.psd_mm4 * psd.samples).sum() * cell == pytest.approx(0.5, rel=0.02)


def test_each_bin_is_the_mean_of_its_frequencies_under_hanns_window():
    """Term by term, with SciPy's window at the middles of the pixels."""
    heights = np.random.default_rng(4).normal(0, 1.0, (16, 12))
    window = np.outer(hann(33)[1::2], hann(25)[1::2])
    values = (heights - (heights * window).sum() / window.sum()) * window
    density = np.abs(np.fft.fft2(values)) ** 2 * PITCH[0] * PITCH[1] / (window**2).sum()
    radius = np.hypot(*np.meshgrid(np.fft.fftfreq(12, PITCH[0]), np.fft.fftfreq(16, PITCH[1])))
    edges = np.linspace(0, 1.0, 7)  # up to half a period a pixel of the coarser pitch
    psd = radial_psd(heights, PITCH)
    bins = [(radius >= low) & (radius < high) & (radius > 0) for low, high in itertools.pairwise(edges)]
    full = [inside for inside in bins if inside.any()]
    assert len(full) == len(psd.psd_mm4) == 5  # the first is below the lowest frequency
    for k, inside in enumerate(full):
        assert psd.psd_mm4[k] == pytest.approx(density[inside].mean(), rel=1e-9)
        assert psd.frequency_per_mm[k] == pytest.approx(radius[inside].mean(), rel=1e-9)


def test_holes_change_no_level():
    rng = np.random.default_rng(2)
    noise = rng.normal(0, 1.0, (128, 128))
    noise[rng.random(noise.shape) < 0.3] = np.nan
    padded = np.pad(noise, 20, constant_values=np.nan)
    psd = radial_psd(padded, PITCH)
    assert np.average(psd.psd_mm4, weights=psd.samples) == pytest.approx(PITCH[0] * PITCH[1], rel=0.06)
    assert psd.window_share == pytest.approx(0.7, abs=0.02)


def test_structure_function_is_the_mean_over_pairs():
    rng = np.random.default_rng(3)
    heights = rng.normal(0, 1.0, (9, 7))
    heights[rng.random(heights.shape) < 0.2] = np.nan
    found = structure_function(heights, PITCH)
    x, y = np.meshgrid(np.arange(7) * PITCH[0], np.arange(9) * PITCH[1])
    good = np.isfinite(heights)
    p, q = np.triu_indices(int(good.sum()), 1)
    distance = np.hypot(x[good][p] - x[good][q], y[good][p] - y[good][q])
    square = (heights[good][p] - heights[good][q]) ** 2
    top, count = 3.5 / 2, 3
    index = np.floor(distance / top * count).astype(int)
    for k in range(count):
        assert found.pairs[k] == (index == k).sum()
        assert found.mean_square_mm2[k] == pytest.approx(square[index == k].mean(), rel=1e-9)
        assert found.distance_mm[k] == pytest.approx(distance[index == k].mean(), rel=1e-9)


def test_structure_function_of_a_tilt_grows_with_the_square():
    x, _ = np.meshgrid(np.arange(64) * 1.0, np.arange(64) * 1.0)
    found = structure_function(1e-3 * x, (1.0, 1.0))
    # over all directions the mean of (slope x distance x cos)^2 is half of its largest
    np.testing.assert_allclose(found.mean_square_mm2[5:], 0.5e-6 * found.distance_mm[5:] ** 2, rtol=0.06)


def test_maps_without_a_height():
    for function in (radial_psd, structure_function):
        with pytest.raises(ValueError, match="no valid height"):
            function(np.full((3, 3), np.nan), PITCH)
