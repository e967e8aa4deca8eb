"""Gains of frames: found where they are, within their errors; not found where there are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from noisy_images import Images, images_of, setup_of, small
from scenes import with_part

from irtscots_cl.measurement.frame_factors import FALSE_ALARM, MODEL_ERROR, frame_gains
from irtscots_cl.measurement.scan_estimates import _Side, estimate_centroids

SCENE = small(25)
DESIGN = images_of(SCENE.nominal())
NOISE = 0.002  # of the peak
LINES = 21
TILT_MM = 0.02  # a tenth of a line


def gains_of(images: Images, scene=SCENE, rounds: int = 1):
    """The gains that `rounds` corrections find, their standard errors, and the first chance; x, then y."""
    setup = setup_of(scene)
    stack = images.stack()
    sides = [_Side(scan, setup, setup.pixel_response) for scan in (stack.x, stack.y)]
    for side in sides:
        side.fit()
    chances = []
    for _ in range(rounds):
        found = frame_gains(*(side.for_gains() for side in sides))
        chances.append(found.chance)
        for side, change in zip(sides, (found.x, found.y), strict=True):
            side.gain *= change
            side.fit()
    gain = np.concatenate([side.gain for side in sides])
    return gain, np.concatenate([found.error_x, found.error_y]), chances[0]


def with_gains(images: Images, x, y) -> Images:
    return replace(images, x=images.x * x[:, None, None], y=images.y * y[:, None, None])


def lit() -> np.ndarray:
    """Frames [2 x lines] with at least a fifth of the brightest one's light."""
    light = np.concatenate([a.sum((1, 2)) for a in (images_of(SCENE).x, images_of(SCENE).y)])
    return light > 0.2 * light.max()


JITTER = 1 + 0.03 * np.random.default_rng(1).standard_normal((2, LINES))
DRIFT = np.stack([np.linspace(0.975, 1.025, LINES), np.ones(LINES)])
HALF = np.ones((2, LINES))
HALF[0, 10] = 0.5


@pytest.mark.parametrize("injected", [JITTER, DRIFT, HALF], ids=["jitter", "drift", "half exposure"])
def test_gains_are_found_within_their_errors(injected):
    found, error, chance = gains_of(with_gains(images_of(SCENE), *injected).noisy(NOISE, 2), rounds=4)
    assert chance < 1e-12
    injected, known = injected.ravel(), lit()
    assert known.sum() > 15
    ratio = (found / injected)[known]
    assert (np.abs(ratio - 1) < 3 * np.hypot(error[known], MODEL_ERROR)).all()
    # a common factor of both scans belongs to the fluxes, and the prior alone tells it
    assert np.abs(ratio / np.median(ratio) - 1).max() < 4 * MODEL_ERROR
    assert np.abs(injected[known] / np.median(injected[known]) - 1).max() > 0.015  # there was something to find


def test_equal_frames_are_told_to_be_equal():
    """Of the design, whose profile is the light's: what is left is chance."""
    chances = [gains_of(DESIGN.noisy(0.005, seed), SCENE.nominal())[2] for seed in range(50)]
    assert min(chances) > FALSE_ALARM  # 50 draws: 0.5 % by chance


def test_equal_frames_keep_gains_of_exactly_one():
    """Though the measured mirror's profile is not quite the design's."""
    scene = small(45)
    for estimate in estimate_centroids(images_of(scene).noisy(NOISE, 3).stack(), setup_of(scene), "likelihood"):
        np.testing.assert_array_equal(estimate.gain, 1.0)


def mean_place(images: Images) -> float:
    """Mean centroid of the x scan, in mm."""
    estimate = estimate_centroids(images.stack(), setup_of(SCENE), "likelihood")[0]
    return float(estimate.centroid_mm[0][estimate.flags == 0].mean())


def test_a_drift_is_told_from_a_shift_of_the_light():
    """Both move the bright side of every curve. A tilt of the mirror keeps the sum of each curve, a drift does not."""
    images = images_of(SCENE)
    here = mean_place(images.noisy(NOISE, 4))
    line = np.arange(LINES)
    # the screen moved by a tenth of a line: the same as a tilted mirror
    moved = images_of(with_part(SCENE, "screen", centre_offset_mm=(-TILT_MM, 0.0)))
    moved = replace(moved, lines_x=images.lines_x).noisy(NOISE, 4)
    assert mean_place(moved) - here == pytest.approx(TILT_MM, rel=0.05)
    drifted = with_gains(images, 1 + 0.02 * (line - 10), np.ones(LINES)).noisy(NOISE, 4)
    assert abs(mean_place(drifted) - here) < 0.05 * TILT_MM
    gain, _, _ = gains_of(drifted, rounds=4)
    known = lit()[:LINES]
    slope = np.polyfit(line[known] - 10, gain[:LINES][known], 1)
    assert slope[0] / slope[1] == pytest.approx(0.02, rel=0.05)
    # without gains the drift would have been taken for a shift
    setup = setup_of(SCENE)
    sides = [_Side(one.stack().x, setup, setup.pixel_response) for one in (images.noisy(NOISE, 4), drifted)]
    for side in sides:
        side.fit()
    still, feigned = (side.fits for side in sides)
    bright = np.nan_to_num(still.flux) > 0.5 * np.nanmax(still.flux)
    assert np.mean((feigned.place_mm - still.place_mm)[bright]) > 0.2 * TILT_MM


def test_frames_without_light_get_the_typical_gain():
    """Their own would be of noise and of the profile's tails."""
    found, _, _ = gains_of(with_gains(images_of(SCENE), *JITTER).noisy(NOISE, 5), rounds=4)
    brightest = np.concatenate([a.max((1, 2)) for a in (images_of(SCENE).x, images_of(SCENE).y)])
    dark = brightest < 1e-3 * images_of(SCENE).peak
    assert dark.any()
    for scan in (slice(LINES), slice(LINES, None)):
        assert np.abs(found[scan][dark[scan]] / np.median(found[scan]) - 1).max() < 0.01
