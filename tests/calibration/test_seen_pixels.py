"""The pixels on which a design is judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lopsided import lopsided

from irtscots_cl.calibration.seen_pixels import seen_pixels
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError


def test_all_pixels_of_a_small_detector():
    seen = seen_pixels(Setup(load_scene("sphere")))
    assert seen.step == 1 and seen.mask.shape == (125, 125)
    row, column = seen.pixels
    np.testing.assert_array_equal(np.hypot(seen.x_mm, seen.y_mm) <= 532.0, seen.mask)
    assert seen.mask[row.astype(int), column.astype(int)].all() and len(row) == seen.mask.sum()
    assert np.isnan(seen.on_grid(np.ones((2, len(row))))).sum() == 2 * (~seen.mask).sum()


def test_every_third_pixel_of_a_large_one_about_the_middle():
    scene = load_scene("sphere")
    detector = replace(scene.camera.detector, pixels=(375, 375), pitch_mm=0.037 / 3)
    seen = seen_pixels(Setup(replace(scene, camera=replace(scene.camera, detector=detector))))
    assert seen.step == 3 and seen.row[0] == 1 and seen.row[-1] == 373
    assert seen.mask.sum() == 9793


def test_pixels_whose_light_misses_the_screen_are_left_out():
    """Part of the light of this scene falls beside its screen, and its mirror has a hole."""
    setup = Setup(lopsided())
    seen = seen_pixels(setup)
    _, u, v = setup.chief_rays.reverse(*seen.pixels)
    assert np.abs(u - 1.3).max() <= 23 * 0.9 / 2 and np.abs(v + 7.3).max() <= 17 * 0.9 / 2
    assert np.hypot(seen.x_mm, seen.y_mm)[seen.mask].min() >= 35.0


def test_what_is_not_seen_is_refused():
    scene = load_scene("sphere")
    few = replace(scene.camera.detector, pixels=(9, 9), pitch_mm=0.5)
    with pytest.raises(ValueError, match="must be at least 100, for maps of the mirror"):
        seen_pixels(Setup(replace(scene, camera=replace(scene.camera, detector=few))))
    away = replace(scene.screen, position_mm=(400.0, 0.0, 4161.0), look_at_mm=(180.0, 0.0, 0.0))
    with pytest.raises(SceneError, match="no detector pixel sees the"):
        seen_pixels(Setup(replace(scene, screen=away)))
