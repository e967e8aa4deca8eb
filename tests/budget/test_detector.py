"""Error sources: the detector's samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_budget import small_scene, small_trials

from irtscots_cl.budget.detector import Quantisation, ReadNoise, SceneNoise
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.monte_carlo import monte_carlo
from irtscots_cl.budget.noise import PhotonNoise
from irtscots_cl.budget.source import Draw
from irtscots_cl.budget.sources import known_sources, source_of
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.validation import SceneError

FRINGES = ((3.0, 20.0), 5)


@pytest.fixture(scope="module", params=[None, FRINGES], ids=["lines", "fringes"])
def design(request):
    return MeasuredDesign.of(Setup(small_scene()), request.param)


def places(design, axis, samples):
    """Places [n] less the design's, of samples [n, k] over the brightest one: centroids, or phases by least squares."""
    screen, frames = design.setup.scene.screen, design.frames
    if design.fringes is None:
        own = frames.window(axis)
        place = (frames.numbers(axis) + 0.5) * screen.pitch_xy_mm[axis]
        middle = [np.sum(place * values, -1) / values.sum(-1) for values in (samples * own, frames.signal[axis])]
        return middle[0] - middle[1]
    periods, steps = FRINGES
    angle = 2 * np.pi * np.arange(steps) / steps
    columns = np.stack([np.ones(steps), np.cos(angle), np.sin(angle)], -1)
    width, found = screen.pixels[axis] * screen.pitch_xy_mm[axis], 0.0
    for k, p in enumerate(periods):
        _, cosine, sine = np.linalg.lstsq(columns, samples[:, k * steps : (k + 1) * steps].T)[0]
        phase = 2 * np.pi * p * (design.places_mm[axis] / width + 0.5)
        turn = np.angle((cosine + 1j * sine) * np.exp(-1j * phase))
        found = found + p**2 / np.square(periods).sum() * turn * width / (2 * np.pi * p)
    return found


def test_signals_and_additions_are_those_of_measured_samples(design):
    random = np.random.default_rng(4)
    for axis in range(2):
        signal = design.frames.signal[axis]
        assert np.abs(places(design, axis, signal)).max() < 1e-9
        added = 1e-4 * random.standard_normal(signal.shape)
        found = np.sum(design.frames.of_addition[axis] * added, -1)
        told = places(design, axis, signal + added)
        assert np.abs(told - found).max() < 0.02 * np.abs(told).max()
        assert 0.9 < signal.max() <= 1 + 1e-12


def test_rounding_to_whole_steps(design):
    """As measured from rounded samples, rms over pixels and several steps; pixels with like light err alike."""
    ratios = []
    for step in (1 / 37.3, 1 / 63.7, 1 / 100.3, 1 / 151.9):
        drawn = Quantisation().changes_mm(design, step, Draw(1, 0))
        for axis in range(2):
            told = places(design, axis, np.round(design.frames.signal[axis] / step) * step)
            ratios.append(np.sqrt(np.mean(told**2) / np.mean(drawn[axis] ** 2)))
    assert np.mean(ratios) == pytest.approx(1, abs=0.1)
    assert np.abs(np.array(ratios) - 1).max() < 0.3


def test_light_below_half_a_step_tells_no_place(design):
    """A step of more than twice the brightest sample leaves nothing; one of half of it leaves the brightest samples."""
    assert np.isnan(Quantisation().changes_mm(design, 2.1, Draw(1, 0))).all()
    changes = Quantisation().changes_mm(design, 0.5, Draw(1, 0))
    brightest = [signal.max(-1) for signal in design.frames.signal]
    assert np.array_equal(np.isfinite(changes), np.stack(brightest) >= 0.25)
    trials = small_trials(4, {"detector.quantisation": 2.1}, pixels=21)
    with pytest.raises(SceneError, match="4 of 4 trials cannot be measured"):
        monte_carlo(trials)


def test_an_even_error_of_one_step_has_the_rms_of_its_12th_root():
    """Fringes, nearly all of whose samples have light: by the sum of the squares of the weights."""
    design = MeasuredDesign.of(Setup(small_scene()), FRINGES)
    draws = np.stack([Quantisation().changes_mm(design, 1e-3, Draw(2, k)) for k in range(60)])
    weight = np.stack([np.sqrt(np.sum(weights**2, -1)) for weights in design.frames.of_addition])
    ratio = np.sqrt(np.mean(draws**2, 0)) / weight / 1e-3
    assert ratio.mean() == pytest.approx(1 / np.sqrt(12), rel=0.01)
    periods, steps = FRINGES  # in closed form: amplitude 1/2 of the peak, sqrt(2 / N) over it, by the squared periods
    width, squares = 21 * 0.2, np.square(periods)
    told = np.sqrt(2 / steps) / 0.5 * width / (2 * np.pi) / np.sqrt(squares.sum())
    assert weight == pytest.approx(told, rel=1e-9)


def test_read_noise_is_that_of_noisy_samples(design):
    random, rms = np.random.default_rng(5), 1e-3
    drawn = ReadNoise().changes_mm(design, rms, Draw(1, 1))
    for axis in range(2):
        signal = design.frames.signal[axis]
        told = np.stack([places(design, axis, signal + rms * random.standard_normal(signal.shape)) for _ in range(8)])
        # 1000 pixels: 2.2 % of one draw's rms, 4 sigma
        assert drawn[axis].std() == pytest.approx(told.std(), rel=0.1)


def scene_with(**noise):
    scene = small_scene()
    detector = replace(scene.camera.detector, noise=DetectorNoise(**noise))
    return replace(scene, camera=replace(scene.camera, detector=detector))


def test_shot_noise_of_the_scene_is_that_of_its_electrons():
    """Of lines: the light's width over the root of the electrons of the whole light curve."""
    design = MeasuredDesign.of(Setup(scene_with(electrons_at_peak=10000.0, shot_noise=True)))
    found = SceneNoise().changes_mm(design, 1.0, Draw(1, 0))
    electrons = 10000.0 / design.frames.brightest
    told = PhotonNoise().changes_mm(design, electrons**-0.5, Draw(1, 0))
    assert found.std() == pytest.approx(told.std(), rel=0.1)
    averaged = scene_with(electrons_at_peak=10000.0, shot_noise=True, frames_averaged=4)
    less = SceneNoise().changes_mm(MeasuredDesign.of(Setup(averaged)), 1.0, Draw(1, 0))
    assert np.abs(2 * less - found).max() < 1e-12


def test_read_noise_and_rounding_of_the_scene():
    design = MeasuredDesign.of(Setup(scene_with(electrons_at_peak=10000.0, read_noise_e=20.0)))
    assert SceneNoise().changes_mm(design, 1.0, Draw(1, 0)).std() == pytest.approx(
        ReadNoise().changes_mm(design, 20.0 / 10000.0, Draw(1, 0)).std(), rel=0.1
    )
    rounded = MeasuredDesign.of(Setup(scene_with(electrons_at_peak=10000.0, bits=8, gain_e_per_dn=40.0)))
    assert SceneNoise().changes_mm(rounded, 1.0, Draw(1, 0)).std() == pytest.approx(
        ReadNoise().changes_mm(rounded, 40.0 / np.sqrt(12) / 10000.0, Draw(1, 0)).std(), rel=0.1
    )


def test_only_scenes_with_noise_have_that_source():
    noisy, plain = scene_with(electrons_at_peak=1e4, shot_noise=True), small_scene()
    assert "detector.noise" in known_sources(noisy) and source_of("detector.noise", noisy).kind.is_random
    assert "detector.noise" not in known_sources(plain)
    with pytest.raises(SceneError, match=r"budget.sources.'detector.noise': unknown source"):
        source_of("detector.noise", plain)
