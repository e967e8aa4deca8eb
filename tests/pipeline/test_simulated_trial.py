"""A trial of a budget as a traced and measured test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from height_maps import letter, with_maps
from small_budget import small_scene, small_trials

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.trials import Trials
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.simulated_trial import simulate_trial, simulated_facts, trial_scene
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import Harvey
from irtscots_cl.tracing.trace import trace

SOURCES = {
    "camera.x_mm": 0.1,
    "screen.z_mm": 0.05,
    "screen.pitch_relative": 1e-4,
    "screen.brightness_xx": 0.1,
    "zernike.6_um": 0.05,
    "vibration.camera.x_mm": 1e-2,
    "noise.place_mm": 1e-3,
}


@pytest.fixture(scope="module")
def trials():
    return small_trials(sources=SOURCES, pixels=31)


def test_the_scene_holds_geometry_and_brightness(trials):
    scene, held = trial_scene(trials, 3)
    values, own = trials.values_of(3), trials.design.setup.scene
    assert set(held) == set(SOURCES) - {"vibration.camera.x_mm", "noise.place_mm"}
    assert scene.camera.position_mm[0] - own.camera.position_mm[0] == pytest.approx(values["camera.x_mm"])
    assert scene.screen.response.brightness_polynomial == (0, 0, values["screen.brightness_xx"], 0, 0)
    assert scene.mirror.zernike[0].coefficients_um[6] == values["zernike.6_um"]
    assert scene.name == "sphere-trial-3" and scene.budget is None


@pytest.mark.parametrize("preset", ["sphere-singlet", "sphere-window"])
def test_elements_and_scatter_are_left_out(device, preset):
    scene = load_scene(preset)
    scene = replace(scene, mirror=replace(scene.mirror, scatter=Harvey(tis=0.0025, l=0.01, s=-1.5)))
    budget = Budget(sources={"screen.z_mm": 0.05}, trials=2)
    trials = Trials.of(MeasuredDesign.of_budget(Setup(scene), budget), budget)
    found = simulate_trial(trials, 1, rays_per_pixel=2**10, device=device)
    assert found.difference_nm < 2 * found.noise_nm < 0.5 * found.predicted_nm


def test_the_scene_holds_maps_of_the_mount():
    design = MeasuredDesign.of(
        Setup(with_maps(small_scene(31), MirrorMap(heights=letter(), outside="nearest", factor=-2)))
    )
    trials = Trials.of(design, Budget(sources={"map.1": 0.1}, trials=4))
    scene, held = trial_scene(trials, 1)
    assert scene.mirror.map[0].factor == -2 * held["map.1"] == -2 * trials.values_of(1)["map.1"] != 0


def test_the_simulated_error_is_the_trials_within_the_rays_noise(device, trials):
    """96 nm, of which rays leave 1.2 nm, most of it in low orders, of which there are few: twice as much."""
    found = simulate_trial(trials, 3, rays_per_pixel=2**15, device=device)
    assert found.predicted_nm == pytest.approx(96, abs=1) and 0.8 < found.noise_nm < 2
    assert found.difference_nm < 2 * found.noise_nm
    assert found.left_out == ("noise.place_mm", "vibration.camera.x_mm")
    assert found.used.all() and simulated_facts(found)["difference_nm"] == found.difference_nm


def test_without_an_error_that_a_scene_holds_it_is_the_plain_test(device):
    """To the bit."""
    trials = small_trials(sources={"noise.place_mm": 1e-3}, pixels=31)
    found = simulate_trial(trials, 1, rays_per_pixel=256, device=device)
    assert not found.held and not found.simulated_mm.any() and not found.predicted_mm.any()
    plain = small_scene(31)
    stack = trace(plain, rays_per_pixel=256, seed=trials.budget.seed, device=device).images(LineScan(plain))
    for own, there in ((found.stack.x, stack.x), (found.stack.y, stack.y)):
        assert np.array_equal(own.flux_w, there.flux_w) and own.flux_w.any()
    assert not trials.heights_mm([(1, {})]).any()


def test_the_same_trial_again_has_the_same_bits(device, trials):
    first, second = (simulate_trial(trials, 1, rays_per_pixel=1024, device=device) for _ in range(2))
    assert np.array_equal(first.simulated_mm, second.simulated_mm)


def test_compensators_are_fitted_away_from_both(device):
    trials = small_trials(sources={"screen.z_mm": 0.1}, pixels=31, compensators=("screen.z_mm",))
    found = simulate_trial(trials, 3, rays_per_pixel=2**12, device=device)
    plain = simulate_trial(small_trials(sources={"screen.z_mm": 0.1}, pixels=31), 3, rays_per_pixel=2**12)
    assert found.predicted_nm < 1e-3 * plain.predicted_nm
    assert found.simulated_nm < 2 * found.noise_nm < 0.2 * plain.simulated_nm


def test_turns_are_several_tests(trials):
    with pytest.raises(ValueError, match=r"--images: must be left out with budget.mirror_turns = 3"):
        simulate_trial(small_trials(sources=SOURCES, pixels=31, mirror_turns=3), 0)
