"""Spectra of measured maps as those of the mirror: a seeded surface of 1/f^2 in, the same out, with true error bars."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ripples import FieldDeparture, RippledSetup, line_images
from scenes import coarse

from irtscots_cl.maths.corrected_spectrum import CorrectedPsd
from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.low_order import remove_terms
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.slopes import deconvolve_pixel
from irtscots_cl.measurement.transfer_function import TransferFunction
from irtscots_cl.measurement.transfer_spectrum import MeasuredMap, mirror_psd
from irtscots_cl.optics.setup import Setup

LEVEL_MM2 = 1e-13  # of a density level / f^2
NODES = 48  # of the integrated maps, a side
FINE = 4  # samples to a pixel


def transfer_of(measure: str, pixels: int = 21) -> TransferFunction:
    return TransferFunction.of(coarse("sphere", pixels).nominal(), measure)


def pull(found: CorrectedPsd, law: np.ndarray) -> np.ndarray:
    """Error over the standard error of the law's density: that of the density found is in proportion to it, so that
    low ones would have small ones."""
    return (found.corrected_mm4 / law - 1) * found.corrected_mm4 / found.standard_error_mm4


def seen_of_field(transfer: TransferFunction, seed: int, slope_noise: float = 0.0) -> MeasuredMap:
    """A field of 1/f^2 up to four times the grid's highest frequency, its slopes averaged over square pixels and
    integrated: no transfer function is used."""
    pitch = float(np.linalg.norm(transfer.geometry(transfer.nearest()).pixel[0, 0]))
    count = 2 * NODES * FINE
    frequency = np.fft.fftfreq(count, pitch / FINE)
    radius = np.hypot(frequency[None], frequency[:, None])
    amplitude = np.sqrt(LEVEL_MM2) / np.where(radius > 0, radius, np.inf) / (pitch / FINE)
    random = np.random.default_rng(seed)
    waves = np.fft.fft2(random.standard_normal((count, count))) * amplitude
    over_pixel = np.sinc(frequency * pitch)
    slopes = [
        np.fft.ifft2(waves * 2j * np.pi * k * over_pixel[None] * over_pixel[:, None]).real[: NODES * FINE : FINE,
                                                                                            : NODES * FINE : FINE]
        for k in (frequency[None], frequency[:, None])
    ]  # fmt: skip
    slopes = [slope + slope_noise * random.standard_normal(slope.shape) for slope in slopes]
    x, y = np.meshgrid(*[(np.arange(NODES) - (NODES - 1) / 2) * pitch] * 2)
    mask = np.hypot(x, y) < NODES * pitch / 2
    if not transfer.how.pixel_average:
        slopes = [np.where(mask, deconvolve_pixel(slope, mask), 0.0) for slope in slopes]
    heights = integrate_slopes(x, y, *slopes, mask, transfer.how.method)
    return MeasuredMap(heights, (pitch, 0.0), (0.0, pitch), own_grid=True)


@pytest.mark.parametrize("measure, share", [("paper", 0.85), ("fine", 0.9)])
def test_a_density_of_one_over_f_squared_comes_back(measure, share):
    """4 fields; with the law beyond the grid, whose power is taken out."""
    transfer = transfer_of(measure)
    pulls, told = [], []
    for seed in range(4):
        found = mirror_psd(transfer, seen_of_field(transfer, seed))
        law = LEVEL_MM2 / found.frequency_per_mm**2
        pulls.append(pull(found, law))
        told.append(np.isfinite(found.corrected_mm4).mean())
        assert found.exponent == pytest.approx(2.0, abs=0.4)
    assert min(told) > share
    pulls = np.array(pulls)
    assert np.nanstd(pulls) == pytest.approx(1.0, abs=0.35)
    assert abs(np.nanmean(pulls)) < 0.6  # 4 x 20 rings, neighbours alike: 0.15 a sigma
    # uncorrected, the highest frequencies are wrong by far
    highest = np.flatnonzero(np.isfinite(found.corrected_mm4))[-4:]
    assert (found.measured_mm4 / law)[highest].mean() < (0.4 if measure == "paper" else 0.65)


def test_stated_noise_is_subtracted():
    """Slope noise that doubles the density of the highest frequencies; its slopes' or its heights' errors known."""
    transfer, noise = transfer_of("fine"), 5e-8
    measured = seen_of_field(transfer, 1, noise)
    found = mirror_psd(transfer, replace(measured, slope_errors=(noise * 1.17, noise * 1.17)))  # as deconvolve_pixel
    upper = slice(len(found.frequency_per_mm) // 2, -3)  # leaves it
    law = LEVEL_MM2 / found.frequency_per_mm**2
    included = mirror_psd(transfer, measured)
    assert np.isnan(included.noise_mm4).all()
    assert np.nanmean((included.corrected_mm4 / law)[upper]) > 1.5
    assert np.nanmean((found.corrected_mm4 / law)[upper]) == pytest.approx(1.0, abs=0.25)  # 9 rings of 20 %: 3.5 sigma
    by_heights = mirror_psd(transfer, replace(measured, height_error_mm=1e-6)).noise_mm4
    np.testing.assert_allclose(by_heights / by_heights[10], found.noise_mm4 / found.noise_mm4[10], rtol=1e-6)


@pytest.mark.slow
def test_a_map_of_height_errors_gives_the_noise_its_level():
    """Maps of nothing but noise, of which the rms error without piston and tilt is known."""
    transfer = transfer_of("paper")
    still = seen_of_field(transfer, 0)
    pitch = still.column_mm[0]
    mask = np.isfinite(still.heights_mm)
    x, y = np.meshgrid(*[np.arange(NODES) * pitch] * 2)
    p, q = np.random.default_rng(5).standard_normal((2, 12, NODES, NODES)) * 1e-6
    heights = integrate_slopes(x, y, p, q, mask, "southwell")
    rms = np.sqrt(np.nanmean([remove_terms(x, y, h, mask, "piston_tilt") ** 2 for h in heights]))
    ratios = []
    for h in heights:
        found = mirror_psd(transfer, replace(still, heights_mm=h, height_error_mm=float(rms)))
        ratios.append((found.measured_mm4 / found.noise_mm4)[4:20])
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.25)  # the level is from heights that lack the lowest frequencies


@pytest.mark.slow
@pytest.mark.parametrize("measure", ["paper", "fine"])
def test_so_it_does_from_the_images_of_a_simulated_test(measure):
    """Three seeded mirrors of 1/f^2 up to 1.7 times the highest frequency, measured from the images of their lines."""
    scene = coarse("sphere", 41).nominal()
    setup = Setup(scene)
    transfer = TransferFunction.of(setup, measure)
    geometry = transfer.geometry(transfer.nearest())
    column, row = ((float(step[0]), float(step[1])) for step in geometry.pixel[0])
    radius, pitch = scene.mirror.diameter_mm / 2, column[0]
    flat = measure_by(measure, line_images(RippledSetup(scene, None)), setup)
    pulls = []
    for seed in range(3):
        field = FieldDeparture.of(seed, radius, pitch / 6, 1e-15, 1.7 * 0.5 / pitch)
        found = measure_by(measure, line_images(RippledSetup(scene, field)), setup)
        heights = np.where(found.mask & flat.mask, found.deviation_mm - flat.deviation_mm, np.nan)
        psd = mirror_psd(transfer, MeasuredMap(heights, column, row, own_grid=True))
        pulls.append(pull(psd, 1e-15 / psd.frequency_per_mm**2))
    pulls = np.array(pulls)
    assert np.isfinite(pulls).mean() > 0.7
    assert np.nanstd(pulls) < 1.5 and abs(np.nanmean(pulls)) < 0.7
