"""Equations of gains: noise of the light in them does not add up over pixels."""

from __future__ import annotations

import numpy as np
from fringe_stacks import SETS, disk, fringe_stack

from irtscots_cl.measurement.fringe_fit import FrameFit
from irtscots_cl.measurement.fringe_samples import FringeLight, frame_samples

COUNT = 16


def equations(seed, **options):
    light = FringeLight.of([np.asarray(s) for one in SETS for s in one.steps_rad])
    samples = frame_samples(fringe_stack(seed=seed, seen=0.3, **options), disk())
    sigma = np.sqrt(1.5**2 + samples.values.mean(0) / 4)
    fit = FrameFit.of(light, samples, sigma, np.ones(COUNT))
    return fit, *fit.by_instrument(samples, sigma)


def test_scores_of_equal_frames_are_zero_within_their_scatter():
    """Means over 24 seeds of 16 scores: 4.5 standard errors have a chance of 1e-4. The own light's are beyond."""
    pulls, own = [], []
    for seed in range(24):
        fit, _, scores = equations(seed)
        pulls.append(scores.sum(1) / np.sqrt(np.square(scores).sum(1)))
        part = fit.light.part(fit.values) * fit.left
        own.append(part.sum(1) / np.sqrt(np.square(part).sum(1)))
    mean = np.abs(np.mean(pulls, 0)).max() * np.sqrt(24)
    assert mean < 4.5 < np.abs(np.mean(own, 0)).max() * np.sqrt(24)


def test_equations_give_the_small_gain_of_a_frame_back():
    gains = np.ones(COUNT)
    gains[3] = 1.01
    _, normal, scores = equations(1, gains=gains, light=1e5)
    assert 0.0085 < scores[3].sum() / normal[3, 3] < 0.0115
