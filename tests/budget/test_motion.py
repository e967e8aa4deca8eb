"""Error sources: motion while frames are taken."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.geometry import geometry_derivative
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw
from irtscots_cl.budget.sources import source_of
from irtscots_cl.optics.setup import Setup


@pytest.fixture(scope="module", params=[None, ((1.0, 8.0), 8)], ids=["lines", "fringes"])
def design(request):
    return MeasuredDesign.of(Setup(small_scene()), request.param)


def test_vibration_averages_over_the_frames_of_a_pixel(design):
    """Variance of a place: that of a frame times the sum of the squared weights."""
    source = source_of("vibration.screen.x_mm", design.setup.scene)
    draws = np.stack([source.changes_mm(design, 1e-3, Draw(1, k))[0] for k in range(400)])
    told = 1e-3 * np.abs(geometry_derivative(design, "screen.x_mm")[0])
    told = told * np.sqrt(np.sum(design.frames.of_shift[0] ** 2, -1))
    ratio = np.sqrt(np.mean(draws**2, 0)) / told
    assert (
        abs(ratio.mean() - 1) < 0.05 and np.abs(ratio - 1).max() < 0.25
    )  # 400 draws: 3.5 %, 4.4 sigma and frames shared


def test_drift_is_a_move_that_grows_with_time(design):
    """x frames come first: on average the part stands at -1/4 of the drift then, and at +1/4 in the y frames. The place
    by fringes is that of the finest series, which comes last."""
    source = source_of("drift.screen.x_mm", design.setup.scene)
    moved = source.changes_mm(design, 0.1, Draw(0, 0))
    own = geometry_derivative(design, "screen.x_mm")
    share = moved[0] / (0.1 * own[0])
    assert share.min() > -0.5 and share.max() < 0
    assert share.mean() == pytest.approx(-0.25 if design.fringes is None else -0.5 + 11.5 / 31, abs=0.02)


def test_names_and_units(design):
    scene = design.setup.scene
    assert source_of("vibration.camera.tilt_x_rad", scene).unit == "rad"
    assert source_of("vibration.camera.tilt_x_rad", scene).kind.is_random
    assert not source_of("drift.camera.x_mm", scene).kind.is_random
