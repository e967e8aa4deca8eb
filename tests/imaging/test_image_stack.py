"""Scans: replicates and their error bars, images from light curves, scans from images."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.statistics import jackknife_error

ROUNDING = 1e-12  # relative: sums of a few float64 numbers


def some_scan(replicates: int = 5, seed: int = 1) -> Scan:
    """Four light curves of three samples on 3 x 4 pixels, six lines, replicates of unequal weight."""
    random = np.random.default_rng(seed)
    return Scan(
        "x",
        np.linspace(-1.0, 1.0, 6),
        (3, 4),
        np.array([0, 3, 6, 11]),
        np.array([0, 2, 3, 1]),
        random.uniform(0.5, 2.0, (replicates, 4, 3)),
        random.uniform(1.0, 3.0, replicates),
        np.full(4, np.nan),
    )


def test_the_mean_is_weighted_by_the_replicates():
    scan = some_scan()
    expected = sum(w * f for w, f in zip(scan.weights, scan.flux_w, strict=True)) / sum(scan.weights)
    np.testing.assert_allclose(scan.mean_w(), expected, rtol=ROUNDING)


def test_the_jackknife_is_what_leaving_out_one_replicate_gives():
    scan = some_scan()
    found = scan.jackknife_w()
    assert found.shape == (6, 4, 3)
    np.testing.assert_allclose(found[0], scan.mean_w(), rtol=ROUNDING)
    for r in range(5):
        others = [k for k in range(5) if k != r]
        expected = np.average(scan.flux_w[others], axis=0, weights=scan.weights[others])
        np.testing.assert_allclose(found[1 + r], expected, rtol=ROUNDING)


def test_what_only_one_replicate_saw_is_dark_without_it():
    scan = some_scan()
    scan.flux_w[:, 1] = 0.0
    scan.flux_w[2, 1] = 1e-7
    assert (scan.jackknife_w()[1:, 1] >= 0).all()
    assert (scan.jackknife_w()[3, 1] == 0).all()


def test_negative_samples_of_noise_keep_their_sign():
    scan = some_scan(replicates=6)
    scan.weights[:] = 1.0
    scan.flux_w[:] -= 1.25  # the middle of the samples' range
    assert (scan.jackknife_w()[1:] < 0).mean() > 0.2
    np.testing.assert_allclose(
        scan.standard_error_w(),
        scan.flux_w.std(0, ddof=1) / np.sqrt(6),
        rtol=1e-10,  # through differences of the means
    )


def test_a_single_replicate_has_no_error_bar():
    scan = some_scan(replicates=1)
    assert scan.jackknife_w().shape == (1, 4, 3)
    np.testing.assert_array_equal(scan.mean_w(), scan.flux_w[0])
    assert np.isnan(scan.standard_error_w()).all()
    assert np.isfinite(some_scan(replicates=2).standard_error_w()).all()


def test_the_jackknife_error_of_a_mean_is_the_classical_standard_error():
    values = np.random.default_rng(2).normal(size=(7, 3))
    left_out = [np.delete(values, r, axis=0).mean(0) for r in range(7)]
    found = jackknife_error(np.stack([values.mean(0), *left_out]))
    np.testing.assert_allclose(found, values.std(0, ddof=1) / np.sqrt(7), rtol=ROUNDING)


def test_the_standard_error_of_equal_replicates_is_the_classical_one():
    scan = some_scan(replicates=6)
    scan.weights[:] = 3.0
    expected = scan.flux_w.std(0, ddof=1) / np.sqrt(6)
    np.testing.assert_allclose(
        scan.standard_error_w(),
        expected,
        rtol=1e-10,  # through differences of the means
    )


def test_the_images_hold_every_sample_at_its_pixel_and_line_and_nothing_else():
    scan = some_scan()
    expected = np.zeros((6, 3, 4))
    for n, (pixel, first) in enumerate(zip(scan.pixels, scan.first_line, strict=True)):
        for k in range(3):
            expected[first + k, pixel // 4, pixel % 4] = scan.mean_w()[n, k]
    np.testing.assert_array_equal(np.stack([scan.image(line) for line in range(6)]), expected)


def test_other_values_of_the_same_samples_make_images_too():
    scan = some_scan()
    values = np.arange(12.0).reshape(4, 3) + 1.0
    np.testing.assert_array_equal(scan.image(2, values), [[3, 0, 0, 4], [0, 0, 0, 0], [0, 0, 0, 11]])


@pytest.mark.parametrize("exposures", [None, 1, 4])
def test_a_scan_from_images_gives_them_back(exposures):
    shape = (5, 3, 4) if exposures is None else (exposures, 5, 3, 4)
    images = np.random.default_rng(3).uniform(size=shape)
    scan = Scan.from_images("y", np.arange(5) * 0.2, images)
    expected = images if exposures is None else images.mean(0)
    for line in range(5):
        np.testing.assert_allclose(scan.image(line), expected[line], rtol=ROUNDING)
    assert (scan.axis, scan.shape, scan.flux_w.shape) == ("y", (3, 4), (exposures or 1, 12, 5))
    assert np.isnan(scan.hits).all()


@pytest.mark.parametrize("bad", [np.inf, -np.inf, 1e101, -1e101])
def test_a_single_infinite_or_huge_sample_is_refused(bad):
    images = np.ones((5, 3, 4))
    images[2, 1, 3] = bad
    with pytest.raises(ValueError, match=r"images/y\[2, 1, 3\] = .*: must be a finite number within 1e\+100"):
        Scan.from_images("y", np.arange(5), images)


def test_a_sample_that_is_no_number_is_missing():
    """Whatever the other samples hold: those of its pixel and line stay what they are."""
    images = np.random.default_rng(4).uniform(size=(5, 3, 4))
    images[2, 1, 3] = np.nan
    scan = Scan.from_images("y", np.arange(5), images)
    assert np.flatnonzero(np.isnan(scan.flux_w[0])).tolist() == [7 * 5 + 2]
    for line in range(5):
        np.testing.assert_array_equal(scan.image(line), images[line])


@pytest.mark.parametrize(
    ("images", "positions", "message"),
    [
        (
            np.zeros((5, 4)),
            np.arange(5),
            "images of the y scan have shape (5, 4); must be [lines, rows, columns] or ",
        ),
        (np.zeros((0, 3, 4)), np.arange(0), "images of the y scan have shape (0, 3, 4); must be "),
        (np.zeros((5, 3, 4)), np.arange(4), "the y scan has 5 images but line positions of shape (4,)"),
        (np.zeros((5, 3, 4)), np.zeros((5, 1)), "the y scan has 5 images but line positions of shape (5, 1)"),
        (
            np.where(np.arange(60).reshape(5, 3, 4) == 42, -np.inf, np.nan),
            np.arange(5),
            "images/y[3, 1, 2] = -inf: must be a finite number within 1e+100",
        ),
        (
            np.zeros((5, 3, 4)),
            [0, 1, np.inf, 3, 4],
            "lines/y_mm[2] = inf: must be a finite number within 1e+100",
        ),
        (
            np.zeros((5, 3, 4)),
            -np.arange(5),
            "the line positions of the y scan must grow from line to line: lines/y_mm has 0 then -1 at lines 0 and 1, "
            "counted from 0; all fall: reverse the order of the lines and of their images",
        ),
        (
            np.zeros((5, 3, 4)),
            [0, 1, 1, 2, 3],
            "the line positions of the y scan must grow from line to line: lines/y_mm has 1 then 1 at lines 1 and 2, "
            "counted from 0",
        ),
    ],
)
def test_images_that_make_no_scan_are_refused(images, positions, message):
    with pytest.raises(ValueError, match="y") as caught:
        Scan.from_images("y", positions, images)
    assert str(caught.value).startswith(message)
    assert str(caught.value).isprintable()
