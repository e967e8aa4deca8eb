"""Runs whose map of light transport is large take light curves of smoothed rays, or are refused before they start."""

from __future__ import annotations

import pytest
from scenes import with_part
from tracers import setup_of

from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.screen_response import ScreenResponse
from irtscots_cl.tracing import large_detectors
from irtscots_cl.tracing.large_detectors import fit_memory

WANTED = {"estimator": "adjoint", "smoothing": False, "rays_per_pixel": 16384, "replicates": 8}
SIZE = 8 * 8 * 10043 * 81  # of the maps of the sphere


def fitted(scene, given=None):
    given = given or {}
    return fit_memory(setup_of(scene), WANTED | given, given)


@pytest.fixture
def large(monkeypatch):
    """As if the preset's detector were large."""
    monkeypatch.setattr(large_detectors, "MOST_MAP_BYTES", SIZE - 1)


def test_a_usual_detector_keeps_its_map(monkeypatch):
    monkeypatch.setattr(large_detectors, "MOST_MAP_BYTES", SIZE)
    assert fitted(load_scene("sphere")) == ({}, "")


def test_a_large_map_becomes_light_curves_and_a_line_says_so(large):
    changes, line = fitted(load_scene("sphere"))
    assert changes == {"smoothing": True, "rays_per_pixel": 64, "replicates": 4}
    assert line.startswith("10043 maps of 9 x 9 screen pixels, 8 times, take 0.0 GiB: light curves of smoothed rays")
    assert line.endswith("64 for each detector pixel in 4 parts; --no-smoothing keeps the maps")


def test_what_the_user_said_is_kept(large):
    changes, _ = fitted(load_scene("sphere"), {"rays_per_pixel": 100, "replicates": 8})
    assert changes == {"smoothing": True, "rays_per_pixel": 100, "replicates": 8}
    for given in ({"smoothing": False}, {"smoothing": True}, {"estimator": "forward"}, {"estimator": "analytic"}):
        assert fitted(load_scene("sphere"), given) == ({}, "")


def test_a_scene_that_needs_its_map_keeps_it(large):
    uneven = ScreenResponse(brightness_polynomial=(0.01, 0.0, 0.0, 0.0, 0.0))
    assert fitted(with_part(load_scene("sphere"), "screen", response=uneven)) == ({}, "")


def test_a_run_that_does_not_fit_is_refused_or_smoothed(monkeypatch):
    """The map and what else a run holds are compared with the memory together."""
    others = large_detectors.BYTES_PER_PIXEL * 125**2
    for module in ("irtscots_cl.tracing.large_detectors", "irtscots_cl.system.memory"):
        monkeypatch.setattr(f"{module}.memory_bytes", lambda: others + SIZE - 1)
    scene = load_scene("sphere")
    assert fitted(scene)[0]["smoothing"] is True
    with pytest.raises(ValueError, match=r"^scene sphere: camera.detector.pixels = \[125, 125\]: 8 replicates of 9 x 9 "
                       r"screen pixels for each of 10043: takes about 0.1 GiB of memory; must fit"):  # fmt: skip
        fitted(scene, {"smoothing": False})
    for module in ("irtscots_cl.tracing.large_detectors", "irtscots_cl.system.memory"):
        monkeypatch.setattr(f"{module}.memory_bytes", lambda: others - 1)
    with pytest.raises(ValueError, match="a run: takes about"):
        fitted(scene, {"smoothing": True})
