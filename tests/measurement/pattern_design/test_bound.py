"""The Cramer-Rao bound of any pattern: closed form, and random patterns that never beat it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from designed import CAMERA, setup_of

from irtscots_cl.measurement.pattern_design.bound import place_bounds
from irtscots_cl.measurement.pattern_design.pixels import seen_pixels


@pytest.fixture(scope="module")
def seen():
    return seen_pixels(setup_of("sphere", 125))  # pixels so small that the light is the aperture's disk


def test_closed_form_without_noise_of_light(seen):
    """A knife-edge at the disk's middle, whose density is 2 / (pi a): noise / (E 2 / (pi a)), a = 0.5 mm."""
    camera = replace(CAMERA, shot=False, step_e=0.0)
    found = place_bounds(seen, camera, 1.0)
    expected = 2.5 * np.pi * 0.5 / 2 / (9000.0 * seen.bright)
    assert found.of_frames[0] == pytest.approx(expected, rel=0.02)  # cells of the light, and pixels at the rim
    assert found.of_light[0] == pytest.approx(found.of_frames[0])  # no longer exposure than that of a white screen


def test_random_patterns_never_beat_it(seen):
    """Screens of grey pixels at random; how well a frame tells the place, by differences of the light itself."""
    random = np.random.default_rng(3)
    pixel, pitch, step = 7, 0.02, 1e-4
    bounds = place_bounds(seen, CAMERA, 16.0)
    middle = seen.place_mm[0, pixel]
    edges = middle + (np.arange(81) - 40) * pitch
    light = [
        seen.light.light("u", np.broadcast_to(edges - shift, (len(seen.bright), 81)))[pixel] / seen.white_share
        for shift in (0.0, step, -step)
    ]
    assert light[0].sum() == pytest.approx(seen.bright[pixel], rel=1e-3)
    best = 0.0
    for kind in range(400):
        run = random.random(80) if kind % 2 else np.repeat(random.random(16) > 0.5, 5).astype(float)
        signal, up, down = (CAMERA.electrons * part @ run for part in light)
        best = max(best, ((up - down) / (2 * step)) ** 2 / CAMERA.noise.variance(np.array(signal)))
    of_frame = bounds.of_frames[0, pixel]
    assert of_frame < 1 / np.sqrt(best) < 4 * of_frame  # not beaten, and not far
    edge = (edges[:-1] >= middle - pitch / 2).astype(float)
    signal, up, down = (CAMERA.electrons * part @ edge for part in light)
    knife = np.sqrt(CAMERA.noise.variance(np.array(signal))) / abs((up - down) / (2 * step))
    assert bounds.of_light[0, pixel] <= of_frame < knife
