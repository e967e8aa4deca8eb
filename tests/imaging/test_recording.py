"""A scene's own screen and camera: what is done to its images, and that nothing is where it says nothing."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import with_part
from synthetic import noise_free_stack, small_scene

from irtscots_cl.imaging.detector import expose
from irtscots_cl.imaging.recording import check_recording, has_noise, line_scan, record
from irtscots_cl.imaging.screen_response import brightness_map, shown
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.instrument import Detector
from irtscots_cl.scene.screen_response import ScreenResponse

SCENE = small_scene(pixels=15)
NOISE = DetectorNoise(electrons_at_peak=1000.0, shot_noise=True)


def scene_with(noise=None, response=None):
    detector = SCENE.camera.detector
    scene = with_part(SCENE, "camera", detector=Detector(detector.pixels, detector.pitch_mm, noise))
    return with_part(scene, "screen", response=response)


@pytest.mark.parametrize("noise", [None, DetectorNoise(), DetectorNoise(electrons_at_peak=1e4, exposures=3)])
@pytest.mark.parametrize("response", [None, ScreenResponse(), ScreenResponse(gamma=2.2, seed=9)])
def test_without_any_effect_the_images_are_the_very_same(noise, response):
    scene, stack = scene_with(noise, response), noise_free_stack(SCENE)
    assert record(stack, scene) is stack
    assert not has_noise(scene)
    assert line_scan(scene).brightness is None


def test_a_detector_s_noise_is_recorded():
    stack, response = noise_free_stack(SCENE), ScreenResponse(drift=0.1)
    for own in (None, response):
        scene = scene_with(NOISE, own)
        assert has_noise(scene)
        for axis in ("x", "y"):
            found, expected = getattr(record(stack, scene), axis), getattr(expose(stack, NOISE, own), axis)
            np.testing.assert_array_equal(found.flux_w, expected.flux_w)
            assert found.unit == "DN"


def test_a_screen_s_drift_alone_leaves_watts():
    stack, response = noise_free_stack(SCENE), ScreenResponse(drift=0.1)
    scene = scene_with(None, response)
    assert has_noise(scene)
    found = record(stack, scene).x
    np.testing.assert_array_equal(found.flux_w, shown(stack, response).x.flux_w)
    assert found.unit == "W" and (found.flux_w != stack.x.flux_w).any()


def test_an_uneven_screen_has_its_map_in_the_line_scan():
    response = ScreenResponse(brightness_polynomial=(0.1, 0, 0, 0, 0), dead_rows=(3,))
    scene = scene_with(None, response)
    assert has_noise(scene)
    np.testing.assert_array_equal(line_scan(scene).brightness, brightness_map(response, SCENE.screen.pixels))
    stack = noise_free_stack(SCENE)
    assert record(stack, scene) is stack  # the map is in the light already


@pytest.mark.parametrize(
    ("noise", "response", "line"),
    [
        (None, ScreenResponse(brightness_polynomial=(3.0, 0, 0, 0, 0)), "screen.response.brightness_polynomial = "),
        (None, ScreenResponse(brightness_map="none.npy"), "none.npy: screen.response.brightness_map: cannot be"),
        (
            DetectorNoise(electrons_at_peak=1.0, quantum_efficiency_map="none.npy"), None,
            "none.npy: camera.detector.noise.quantum_efficiency_map: cannot be read",
        ),
        (
            DetectorNoise(electrons_at_peak=1.0, shot_noise=True, exposures=9), None,
            "camera.detector.noise.exposures = 9: must be at most --replicates = 8",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_recorded_is_refused_before_rays_are_traced(noise, response, line):
    with pytest.raises(ValueError, match=".") as caught:
        check_recording(scene_with(noise, response), 8)
    assert str(caught.value).startswith(line)
    check_recording(scene_with(NOISE, ScreenResponse(dead_rows=(1,))), 8)
