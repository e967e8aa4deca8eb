"""Checks of calibration frames and exposures against the images: right ones pass, wrong ones are named."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.imaging.lab_frames import LabFrames, camera_calibration
from irtscots_cl.measurement.camera_checks import camera_checks, check_bad, light_range

SHAPE = (24, 32)
SCENE = np.zeros(SHAPE)
SCENE[4:20, 6:26] = 1.0  # the mirror, with darkness around


def pictures(level, count=12, seed=1, offset=50.0, exposures=(1.0,)):
    """Frames of a mirror with fringes, `exposures` of each following each other."""
    random = np.random.default_rng(seed)
    shown = [SCENE * (1 + np.cos(np.arange(SHAPE[1]) / 3 + k)) / 2 for k in range(count)]
    return np.stack([
        np.minimum(np.rint(offset + time * level * image + random.normal(0, 2, SHAPE)), 4095)
        for image in shown for time in exposures
    ]).astype(np.uint16)  # fmt: skip


def levels_of(lab):
    return {c.name: c.level for c in camera_checks(lab, lambda kind, k: f"{kind} {k + 1}")}


def text_of(lab, name):
    return next(c.text for c in camera_checks(lab, lambda kind, k: f"{kind} {k + 1}") if c.name == name)


def darks(level=50.0, count=5):
    return np.rint(level + np.random.default_rng(9).normal(0, 2, (count, *SHAPE))).astype(np.uint16)


@pytest.mark.parametrize("level", [30, 3000])
def test_right_frames_pass_also_with_little_light(level):
    """30 counts of light at a noise of 2."""
    lab = LabFrames(pictures(level), camera_calibration(dark=darks()), 4095)
    assert set(levels_of(lab).values()) == {"ok"}
    low, high = light_range(lab)
    assert 0 < low < 3 and high == pytest.approx(0.7 * level, rel=0.3)


@pytest.mark.parametrize("dark, level, worst", [(50, 1000, "ok"), (90, 1000, "warning"), (400, 1000, "error")])
def test_dark_frames_that_are_brighter_than_the_images_are_named(dark, level, worst):
    lab = LabFrames(pictures(level), camera_calibration(dark=darks(dark)), 4095)
    assert levels_of(lab)["dark"] == worst


def test_a_calibration_frame_unlike_the_others_is_named():
    frames = darks()
    frames[3] += 60
    lab = LabFrames(pictures(1000), camera_calibration(dark=frames), 4095)
    assert levels_of(lab)["dark frames"] == "warning" and "dark 4 has 110" in text_of(lab, "dark frames")


@pytest.mark.parametrize("told, worst", [(8.0, "ok"), (7.5, "warning"), (4.0, "error"), (0.125, "error")])
@pytest.mark.parametrize("known", [True, False])
def test_exposures_are_compared_with_the_images(told, worst, known):
    """Also where the long exposure saturates, and where the offset is not known."""
    frames = pictures(800, exposures=(1.0, 8.0))
    calibration = camera_calibration(bias=darks()) if known else camera_calibration()
    lab = LabFrames(frames, calibration, 4095, (1.0, told))
    assert levels_of(lab)["exposures"] == worst
    if worst != "ok":
        assert "times as bright" in text_of(lab, "exposures")


def test_exposures_without_contrast_cannot_be_compared():
    lab = LabFrames(pictures(0, exposures=(1.0, 8.0)), camera_calibration(bias=darks()), 4095, (1.0, 8.0))
    assert "too little contrast" in text_of(lab, "exposures")


def test_repeats_that_show_other_pictures_are_named():
    frames = pictures(1000, exposures=(1.0, 1.0))
    calibration = camera_calibration(bias=darks())
    assert levels_of(LabFrames(frames, calibration, 4095, (None, None)))["repeats"] == "ok"
    wrong = LabFrames(frames, calibration, 4095, (None, None), "in turn")
    assert levels_of(wrong)["repeats"] == "error" and "of the same frame, differ by" in text_of(wrong, "repeats")


def test_many_bad_pixels_are_named():
    bad = np.zeros(SHAPE, bool)
    bad[:2] = True
    assert check_bad(bad, None).level == "warning" and check_bad(bad & (np.arange(32) < 8), None).level == "ok"


def test_clipped_flat_frames_are_named():
    flat = np.full((3, *SHAPE), 3000, np.uint16)
    flat[:, :2] = 4095
    lab = LabFrames(pictures(1000), camera_calibration(bias=darks(), flat=flat, saturation=4095), 4095)
    assert levels_of(lab)["flat"] == "warning" and "8.3% of the flat frames' pixels" in text_of(lab, "flat")
