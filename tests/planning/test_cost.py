"""What a run will cost, as `irtscots run` would trace it."""

import pytest

from irtscots_cl.optics.setup import Setup
from irtscots_cl.planning.cost import check_cost
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing import large_detectors

PIXELS = 10043  # of the sphere's detector, that can see the mirror


@pytest.fixture
def sphere():
    return Setup(load_scene("sphere"))


def test_a_usual_run(sphere, device):
    (found,) = check_cost(sphere, device, 16384, 8)
    assert found.level == "info"
    assert found.text.startswith(f"irtscots run: {PIXELS * 16384:.2g} rays of {PIXELS} pixels, about ")


def test_a_run_that_smooths_because_its_map_is_large(sphere, device, monkeypatch):
    monkeypatch.setattr(large_detectors, "MOST_MAP_BYTES", 1)
    (found,) = check_cost(sphere, device, 16384, 8)
    assert found.text.startswith(f"irtscots run: {PIXELS * 64:.2g} rays of {PIXELS} pixels, about ")
    assert "light curves of smoothed rays instead, 64 for each detector pixel" in found.text


def test_a_run_that_does_not_fit(sphere, device, monkeypatch):
    monkeypatch.setattr("irtscots_cl.system.memory.memory_bytes", lambda: 1e6)
    monkeypatch.setattr(large_detectors, "can_smooth", lambda scene: False)
    (found,) = check_cost(sphere, device, 16384, 8)
    assert found.level == "error" and "must fit the 0.0 GiB" in found.text
