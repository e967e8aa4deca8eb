"""Stated errors of slopes and heights against the scatter of repeated noisy measurements."""

from __future__ import annotations

import numpy as np
import pytest
from noisy_images import images_of, setup_of, small
from significance import sidak_z

from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.measurement.error_bars import error_bars, slope_derivatives
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.reconstruction import reconstruct

SCENE = small(25)
RUNS = 40
CHANCE = 1e-6  # of a failure of right code


def result_of(images, way: str = "likelihood", pixel_average: bool = False):
    return reconstruct(images.stack(), setup_of(SCENE), light_curve=way, method="cubic", pixel_average=pixel_average)


def bare(result, height_mm):
    return remove_terms(result.x_mm, result.y_mm, height_mm, result.mask, "piston_tilt")


@pytest.mark.parametrize(("way", "pixel_average"), [("likelihood", False), ("likelihood", True), ("windowed", False)])
def test_the_scatter_of_runs_is_the_stated_error(way, pixel_average):
    clean = result_of(images_of(SCENE), way, pixel_average)
    slopes, heights, stated = [], [], []
    for seed in range(RUNS):
        noisy = result_of(images_of(SCENE).noisy(0.005, seed), way, pixel_average)
        mask = noisy.mask & clean.mask
        assert mask.sum() > 0.99 * clean.mask.sum()
        slopes.append([np.where(mask, getattr(noisy, n) - getattr(clean, n), np.nan) for n in ("slope_x", "slope_y")])
        heights.append(
            bare(clean, np.where(clean.mask, np.nan_to_num(noisy.deviation_mm - clean.deviation_mm), np.nan))
        )
        if seed < 4:
            stated.append(error_bars(noisy))
    for k, name in enumerate(("slope_x", "slope_y")):
        error = np.mean([getattr(bars, name) for bars in stated], axis=0)  # NaN off the mask
        # about 400 independent pixels, 40 runs: 0.6 %; the 400 draws and their noise of the samples: some percent
        assert np.sqrt(np.nanmean((np.array(slopes)[:, k] / error) ** 2)) == pytest.approx(1, abs=0.07), name
        scatter = np.std(np.array(slopes)[:, k], axis=0) / error
        assert np.nanmax(np.abs(scatter - 1)) < sidak_z(400, CHANCE) / np.sqrt(2 * RUNS) + 0.1
    height = np.sqrt(np.mean([rms(bars.height_mm, clean.mask) ** 2 for bars in stated]))
    actual = np.sqrt(np.mean([rms(h, clean.mask) ** 2 for h in heights]))
    # one run's rms scatters by 20 %, few low orders have most of it: 4 sigma of 40 runs
    assert actual / height == pytest.approx(1, abs=4 * 0.2 / np.sqrt(RUNS))


def test_errors_grow_with_the_noise_and_are_the_same_for_the_same_seed():
    results = [result_of(images_of(SCENE).noisy(share, 1)) for share in (0.002, 0.01)]
    less, more = (error_bars(result) for result in results)
    for name in ("slope_x", "slope_y", "height_mm"):
        ratio = rms(getattr(more, name), results[0].mask) / rms(getattr(less, name), results[0].mask)
        assert ratio == pytest.approx(5, rel=0.15)
    again = error_bars(results[0])
    np.testing.assert_array_equal(again.height_mm, less.height_mm)
    other = error_bars(results[0], seed=1)
    assert 0 < np.nanmax(np.abs(other.height_mm / less.height_mm - 1)) < 0.3


def test_errors_are_known_on_the_mask_and_nowhere_else():
    result = result_of(images_of(SCENE).noisy(0.005, 1))
    bars = error_bars(result)
    for values in (bars.slope_x, bars.slope_y):
        np.testing.assert_array_equal(np.isfinite(values), result.mask)
        assert (values[result.mask] > 0).all()
    np.testing.assert_array_equal(np.isfinite(bars.height_mm), result.mask)
    assert bars.draws_mm.shape[1:] == result.mask.shape and len(bars.draws_mm) >= 100
    bared = np.stack([bare(result, h) for h in bars.draws_mm])
    np.testing.assert_allclose(np.sqrt(np.mean(bared**2, 0))[result.mask], bars.height_mm[result.mask])


def test_a_measure_without_errors_of_centroids_has_none():
    result = reconstruct(images_of(SCENE).stack(), setup_of(SCENE))
    assert error_bars(result) is None


def test_slopes_follow_centroids_as_their_derivatives_say():
    """Move all centroids a little and measure again."""
    images = images_of(SCENE)
    result = result_of(images)
    (x_by_u, y_by_u), (x_by_v, y_by_v) = slope_derivatives(result)
    # half of the light's way is 4.2 m: one mm on the screen turns the normal by 0.12 mrad
    assert np.nanmedian(np.abs(x_by_u)) == pytest.approx(1 / (2 * 4166.7), rel=0.02)
    assert np.nanmedian(np.abs(y_by_v)) == pytest.approx(1 / (2 * 4166.7), rel=0.02)
    assert np.nanmax(np.abs(y_by_u)) < 0.1 * np.nanmedian(np.abs(x_by_u))
    assert np.nanmax(np.abs(x_by_v)) < 0.1 * np.nanmedian(np.abs(y_by_v))


TERMS = range(1, 16)  # Noll, from piston on
SEEDS = 200


def _coefficients(result, mask, heights_mm: np.ndarray) -> np.ndarray:
    """[n, terms] of least squares over the mask, of maps whose mean is removed."""
    radius = result.nominal.mirror.diameter_mm / 2
    x, y = result.x_mm[mask] / radius, result.y_mm[mask] / radius
    basis = np.stack([zernike(noll, x, y) for noll in TERMS], 1)
    values = np.stack([h[mask] - h[mask].mean() for h in heights_mm])
    return np.linalg.lstsq(basis, values.T, rcond=None)[0].T


@pytest.mark.long
@pytest.mark.parametrize("noise", [0.002, 0.01])
def test_pulls_and_coverage_over_many_runs(noise):
    """Of slopes, heights and Zernike terms by the best measure: its errors are normal, and of the size it says."""
    setup, pulls = setup_of(SCENE), {"slopes": [], "heights": [], "zernike": []}
    clean = measure_by("likelihood", images_of(SCENE).stack(), setup)
    for seed in range(SEEDS):
        result = measure_by("likelihood", images_of(SCENE).noisy(noise, 1000 + seed).stack(), setup)
        bars, mask = error_bars(result), result.mask & clean.mask
        for name in ("slope_x", "slope_y"):
            pulls["slopes"].append(((getattr(result, name) - getattr(clean, name)) / getattr(bars, name))[mask])
        differ = np.where(mask, result.deviation_mm - clean.deviation_mm, np.nan)
        bared = remove_terms(clean.x_mm, clean.y_mm, differ, mask, "piston_tilt")
        pulls["heights"].append((bared / bars.height_mm)[mask])
        stated = _coefficients(clean, mask, bars.draws_mm).std(0)
        pulls["zernike"].append(_coefficients(clean, mask, differ[None])[0] / stated)
    for name, values in pulls.items():
        values = np.concatenate(values)
        assert abs(values.mean()) < 0.15, name
        assert 0.93 < values.std() < 1.07, name
        assert 0.92 < (np.abs(values) < 1.96).mean() < 0.975, name
    of_term = np.stack(pulls["zernike"])
    # 200 draws: the mean to 0.07, the deviation to 5 %; 15 terms at once
    assert np.abs(of_term.mean(0)).max() < sidak_z(len(TERMS), CHANCE) / np.sqrt(SEEDS)
    limit = sidak_z(len(TERMS), CHANCE) / np.sqrt(2 * SEEDS)
    assert np.abs(of_term.std(0) - 1).max() < limit
