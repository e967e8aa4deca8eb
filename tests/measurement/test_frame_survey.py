"""Copies of frames, and the camera's ceiling, from the values alone."""

from __future__ import annotations

import math

import numpy as np

from irtscots_cl.measurement.frame_survey import survey_frames


def frames(count=6, ceiling=None, seed=1, top=4000):
    random = np.random.default_rng(seed)
    values = random.normal(np.linspace(0.2, 1.1, 5000) * top, 5.0, (count, 5000)).reshape(count, 50, 100)
    return np.clip(np.rint(values), 0, ceiling).astype(np.uint16)


def test_copies_are_found_by_their_values():
    some = frames()
    some[4] = some[1]
    assert survey_frames(some).copies == ((1, 4),)
    assert survey_frames(frames()).copies == ()
    assert survey_frames(np.zeros((3, 4, 5), np.uint16)).copies == ()  # black frames are alike without being copies


def test_a_ceiling_is_where_samples_pile_up():
    assert survey_frames(frames(ceiling=4095)).ceiling == 4095
    assert survey_frames(frames(ceiling=3000)).ceiling == 3000
    assert survey_frames(frames()).ceiling == math.inf
    assert survey_frames(frames().astype(float)).ceiling == math.inf  # floating point: not asked
