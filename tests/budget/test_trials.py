"""Trials: values by quantiles of a Sobol sequence; the same trial again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_budget import SOURCES, small_scene, small_trials

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw
from irtscots_cl.budget.sources import known_sources, source_of
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.validation import SceneError


def test_values_have_the_distributions():
    trials = small_trials(trials=1024)
    for name, values in trials.values.items():
        given = trials.budget.sources[name]
        assert values.std() == pytest.approx(given.sigma, rel=0.02)  # Sobol points fill evenly
        assert abs(values.mean()) < 0.01 * given.sigma


def test_what_is_set_up_anew_for_each_measurement_has_the_spread_of_a_mean():
    given = {"camera.x_mm": {"uniform": 0.3, "set_ups": 4}, "screen.x_mm": {"uniform": 0.3}}
    values = small_trials(trials=1024, sources=given).values
    assert values["camera.x_mm"].std() == pytest.approx(0.3 / np.sqrt(12), rel=0.02)
    assert np.abs(values["camera.x_mm"]).max() > 0.75 * 0.3  # all four at one end, nearly
    assert values["screen.x_mm"].std() == pytest.approx(0.3 / np.sqrt(3), rel=0.02)


def test_a_trial_is_the_same_alone_and_among_many():
    few, many = small_trials(trials=8), small_trials(trials=64)
    assert few.values_of(5) == many.values_of(5)
    assert np.array_equal(few.changes_mm(5), many.changes_mm(5))
    together = many.heights_mm([(number, None) for number in range(3, 9)])
    assert np.array_equal(few.heights_mm([(5, None)])[0], together[2])


def test_sources_come_in_any_order():
    turned = dict(reversed(SOURCES.items()))
    assert np.array_equal(small_trials().changes_mm(3), small_trials(sources=turned).changes_mm(3))


def test_other_seeds_are_other_trials():
    assert small_trials(seed=1).values_of(0)["camera.x_mm"] != small_trials(seed=2).values_of(0)["camera.x_mm"]


def test_an_unknown_source_is_one_line():
    with pytest.raises(SceneError, match=r"^sphere: budget.sources.'camera.w_mm': unknown source; did you mean camera"):
        small_trials(sources={"camera.w_mm": 0.1})


def test_what_does_not_stay_is_another_draw_in_every_exposure():
    """All processes that there are, of a scene with noise of its own, and vibration."""
    scene = small_scene(31)
    noise = DetectorNoise(electrons_at_peak=1e4, shot_noise=True)
    detector = replace(scene.camera.detector, noise=noise)
    scene = replace(scene, camera=replace(scene.camera, detector=detector))
    sources = [*known_sources(scene).values(), source_of("vibration.camera.x_mm", scene)]
    again = [source for source in sources if not source.kind.stays]
    assert len(again) >= 8 and all(source.kind.is_random for source in again)
    design = MeasuredDesign.of(Setup(scene))
    for source in again:
        first, other = (source.changes_mm(design, source.usual, Draw(1, 2, repeat)) for repeat in (0, 1))
        assert not np.array_equal(first, other), source.name
