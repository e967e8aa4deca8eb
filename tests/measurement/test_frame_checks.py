"""Frames that show another line than their own, nothing, or other light: named by their number, and no others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from noisy_images import Images, images_of, setup_of, small

from irtscots_cl.measurement.scan_estimates import estimate_centroids

SCENE = small(25)
LINES = np.arange(21)


def shown(images: Images) -> tuple[dict[int, int], dict[int, int]]:
    """Of both scans: frames that do not show their own line, and what they show."""
    estimates = estimate_centroids(images.stack(), setup_of(SCENE), "likelihood")
    return tuple({int(k): int(e.frames.shows[k]) for k in np.flatnonzero(e.frames.shows != LINES)} for e in estimates)


def with_frames(images: Images, axis: str, frames: dict[int, object]) -> Images:
    """frames: {number: number of another frame, or function of the frame}."""
    own = getattr(images, axis)
    changed = own.copy()
    for number, other in frames.items():
        changed[number] = other(own[number]) if callable(other) else own[other]
    return replace(images, **{axis: changed})


def noisy(seed: int = 1, share: float = 0.002) -> Images:
    return images_of(SCENE).noisy(share, seed)


def black(frame):
    return np.random.default_rng(2).normal(0, 0.002 * images_of(SCENE).peak, frame.shape)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("number", [6, 10, 14])
def test_a_black_frame(axis, number):
    found = shown(with_frames(noisy(), axis, {number: black}))
    assert found["xy".index(axis)] == {number: -1}
    assert found["yx".index(axis)] == {}


@pytest.mark.parametrize("step", [-2, -1, 1, 2])
def test_a_frame_that_repeats_a_neighbour(step):
    assert shown(with_frames(noisy(), "x", {9: 9 + step})) == ({9: 9 + step}, {})


@pytest.mark.parametrize("step", [1, 2])
def test_two_exchanged_frames(step):
    exchanged = with_frames(noisy(), "y", {10: 10 + step, 10 + step: 10})
    assert shown(exchanged) == ({}, {10: 10 + step, 10 + step: 10})


def test_several_wrong_frames_of_different_kinds():
    frames = {5: 6, 9: black, 13: black}
    assert shown(with_frames(noisy(), "x", frames))[0] == {5: 6, 9: -1, 13: -1}


@pytest.mark.parametrize("brightness", [0.3, 3.0])
def test_light_where_none_can_be(brightness):
    """A lamp in the room: as bright everywhere, or on a part of the detector."""
    level = brightness * images_of(SCENE).peak
    assert shown(with_frames(noisy(), "x", {8: lambda frame: frame + level}))[0].get(8, 8) in (-2, 8)
    ramp = np.linspace(0, 2, 25) * level
    assert shown(with_frames(noisy(), "x", {8: lambda frame: frame + ramp})) == ({8: -2}, {})


def test_a_dim_frame_is_no_wrong_one():
    """Half the exposure is a gain: the frame shows its own line."""
    assert shown(with_frames(noisy(), "x", {10: lambda frame: 0.5 * frame})) == ({}, {})


def test_what_a_wrong_frame_shows_is_left_out():
    """The places are those of the images without that frame, not of all frames."""
    setup = setup_of(SCENE)
    clean, wrong = (
        estimate_centroids(images.stack(), setup, "likelihood")[0]
        for images in (noisy(), with_frames(noisy(), "x", {10: 9}))
    )
    good = (clean.flags == 0) & (wrong.flags == 0)
    assert good.sum() > 0.9 * (clean.flags == 0).sum()
    pulls = (wrong.centroid_mm[0] - clean.centroid_mm[0])[good] / wrong.error_mm[good]
    assert abs(pulls.mean()) < 0.15 and pulls.std() < 1.2  # the same noise, less one sample of five or six
    assert np.median(wrong.error_mm[good]) > np.median(clean.error_mm[good])


def test_no_frame_of_good_images_is_called_wrong():
    for seed in range(50):
        share = (0.0005, 0.002, 0.01, 0.03)[seed % 4]
        assert shown(noisy(seed, share)) == ({}, {}), (seed, share)


def test_noise_free_images_are_right():
    assert shown(images_of(SCENE)) == ({}, {})
