"""Centroids of known curves, and the error that counting gives them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.measurement.centroids import centroids, jackknife_centroids, poisson_error

A, D = 0.5, 0.2  # the paper's aperture radius and line width [mm]


def scan_of(curves, first_line=0, positions=None, hits=1.0) -> Scan:
    curves = np.atleast_2d(np.asarray(curves, float))
    n = len(curves)
    positions = (np.arange(21) - 10) * D if positions is None else positions
    return Scan(
        "x",
        positions,
        (1, n),
        np.arange(n),
        np.full(n, first_line),
        curves[None],
        np.ones(1),
        np.full(n, float(hits)),
    )


def chord_curves(offsets_mm) -> np.ndarray:
    """Paper Eq. 2 by its own formula: curves [n, 21] over pi a^2 whose light is centred at the offsets."""

    def F(u):
        u = np.clip(u, -A, A)
        return u * np.sqrt(A**2 - u**2) + A**2 * np.arcsin(u / A)

    x = (np.arange(21) - 10) * D - np.asarray(offsets_mm)[:, None]
    return (F(x + D / 2) - F(x - D / 2)) / (np.pi * A**2)


@pytest.mark.parametrize(
    ("curve", "first_line", "expected"),
    [
        ([1, 2, 1], 4, -1.0),  # symmetric about line 5
        ([1, 2, 2, 1], 9, 0.1),  # symmetric about the middle between lines 10 and 11
        ([0, 0, 7], 18, 2.0),  # one line alone, the last
        ([3, 1], 10, 0.05),  # a quarter of a line
        ([1e-30, 3e-30], 10, 0.15),  # faint light counts the same
    ],
)
def test_known_centroids(curve, first_line, expected):
    scan = scan_of(curve, first_line)
    assert centroids(scan, scan.mean_w())[0] == pytest.approx(
        expected,
        abs=1e-15,  # rounding of numbers near 1
    )


@pytest.mark.parametrize("threshold", [0.0, 0.2])
@pytest.mark.parametrize("change", [0.0, -1e-3])  # below 0: such samples do not count
def test_replicates_left_out_by_their_moments_are_those_left_out_of_the_curves(threshold, change):
    scan = scan_of(chord_curves([0.0, 0.3, -0.21, 0.1]))
    random = np.random.default_rng(0)
    flux = scan.flux_w * random.uniform(0.5, 1.5, (3, 4, 21))
    flux[:, 2] = 0.0  # a dark pixel
    flux[1:, 3] = 0.0  # one whose light is in one replicate alone
    flux[0, 0, 0] = change
    scan = dataclasses.replace(scan, flux_w=flux, weights=np.array([1.0, 3.0, 0.7]))
    found = jackknife_centroids(scan, threshold)
    np.testing.assert_allclose(found, centroids(scan, scan.jackknife_w(), threshold), rtol=0, atol=1e-14)
    assert np.isnan(found[:, 2]).all()
    assert np.isnan(found[:, 3]).tolist() == [False, True, False, False]


def test_one_replicate_has_no_others():
    scan = scan_of(chord_curves([0.1]))
    assert jackknife_centroids(scan).tolist() == [centroids(scan, scan.mean_w()).tolist()]


def test_a_curve_far_from_the_screen_s_middle_keeps_its_precision():
    positions = 1e6 + np.arange(21) * D
    scan = scan_of([3, 1], 10, positions)
    assert centroids(scan, scan.mean_w())[0] - positions[10] == pytest.approx(
        0.05,
        abs=2e-10,  # the ulp of 1e6 mm
    )


def test_a_dark_curve_has_no_centroid():
    scan = scan_of([[0, 0, 0], [0, 1, 0]], hits=2.0)
    found = centroids(scan, scan.mean_w())
    assert np.isnan(found[0]) and found[1] == -1.8
    assert np.isnan(poisson_error(scan, scan.mean_w())[0])


def test_the_threshold_takes_what_is_above_it():
    scan = scan_of([1, 10, 5, 1.0], 10)
    assert centroids(scan, scan.mean_w(), threshold=0.2)[0] == pytest.approx(
        0.2 + D * 5 / 15,
        abs=1e-15,  # rounding
    )


def test_samples_past_the_last_line_do_not_count():
    scan = scan_of([1, 1, 0, 0], 19)
    assert centroids(scan, scan.mean_w())[0] == pytest.approx(1.9, abs=1e-15)  # rounding


def test_every_replicate_left_out_has_its_own_centroid():
    scan = scan_of([[1, 1], [1, 3]], 10)
    curves = np.stack([scan.mean_w(), scan.mean_w() ** 2])
    np.testing.assert_allclose(centroids(scan, curves), [[0.1, 0.15], [0.1, 0.18]], rtol=1e-14)  # rounding


def test_the_poisson_error_is_the_scatter_of_counted_light():
    curve, hits, draws = chord_curves([0.037])[0], 1000, 20_000
    counts = np.random.default_rng(5).multinomial(hits, curve, size=draws)
    scan = scan_of(curve, hits=hits)
    scatter = centroids(scan_of(counts), counts.astype(float)).std()
    predicted = poisson_error(scan, scan.mean_w())[0]
    # 4 sigma of a standard deviation from that many draws, chance 6e-5; the sum of many is normal
    assert scatter == pytest.approx(predicted, rel=4 / np.sqrt(2 * draws))


def test_the_paper_s_aperture_gives_its_poisson_error():
    """sigma = sqrt(a^2/4 + d^2/12) / sqrt(hits) = 0.2566 mm / sqrt(hits), over all places between lines."""
    offsets = (np.arange(64) + 0.5) / 64 * D
    scan = scan_of(chord_curves(offsets), hits=400)
    found = poisson_error(scan, scan.mean_w())
    mean_square = np.sqrt((found**2).mean())
    assert mean_square == pytest.approx(
        np.sqrt(A**2 / 4 + D**2 / 12) / 20,
        rel=1e-4,  # the mean's own offset, (1 um)^2
    )
    assert mean_square * 20 == pytest.approx(0.2566, abs=5e-5)  # the digits given
    np.testing.assert_allclose(found, 0.2566 / 20, rtol=0.02)  # it depends little on the place


def test_images_from_a_lab_have_no_counts():
    scan = Scan.from_images("x", np.arange(5) * D, np.ones((5, 2, 2)))
    assert np.isnan(poisson_error(scan, scan.mean_w())).all()
    np.testing.assert_allclose(centroids(scan, scan.mean_w()), 2 * D, rtol=1e-14)  # rounding
