"""The choice of patterns: predicted nm against simulated tests, bounds, ranks, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from designed import CAMERA, fringe_scatter_nm, line_scatter_nm, setup_of, wide_sphere

import irtscots_cl as irt
from irtscots_cl.measurement.pattern_design.choice import design_patterns
from irtscots_cl.measurement.pattern_design.lines import line_errors
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.screen_response import ScreenResponse


@pytest.fixture(scope="module")
def sphere():
    return design_patterns(setup_of("sphere", 31), frames=42, camera=CAMERA)


def named(found, name):
    return next(one for one in found.sets if one.name == name)


def test_is_public():
    assert irt.design_patterns is design_patterns


@pytest.mark.parametrize("name", ["2 x 4 steps, geometric", "3 x 5 steps, beats"])
def test_predicted_nm_are_those_of_simulated_fringes(sphere, name):
    """12 tests: about 100 degrees of freedom, 7 % of one sigma with the prediction's draws; 20 % fails in 1 of 200."""
    one = named(sphere, name)
    times = one.used // one.frames
    nm, _ = fringe_scatter_nm(
        setup_of("sphere", 31), sphere.seen.usable, one.fringes.periods, one.fringes.steps, times, 12
    )
    assert nm == pytest.approx(one.nm_frames * np.sqrt(42 / one.used), rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["4 x 4 steps, geometric", "2 x 8 steps, geometric", "3 x 5 steps, geometric",
                                  "3 x 6 steps, beats", "3 x 3 steps, beats"])  # fmt: skip
def test_predicted_nm_within_a_tenth(sphere, name):
    one = named(sphere, name)
    times = one.used // one.frames
    nm, sigma = fringe_scatter_nm(
        setup_of("sphere", 31), sphere.seen.usable, one.fringes.periods, one.fringes.steps, times, 20
    )
    scale = np.sqrt(42 / one.used)
    assert abs(nm / (one.nm_frames * scale) - 1) < 0.1
    assert nm > one.nm_bound * scale * (1 - 3 * sigma - 0.03)  # no set beats its bound; 3 %: of the heights' draws


@pytest.mark.slow
@pytest.mark.parametrize("name", ["3 x 5 steps, beats", "2 x 8 steps, geometric"])
def test_predicted_nm_of_many_periods_within_a_tenth(name):
    """Orders are told by ratios of periods up to 7, or by beats alone."""
    setup = wide_sphere(31)
    found = design_patterns(setup, frames=32, camera=CAMERA)
    one = named(found, name)
    assert one.fringes.periods[-1] > 5
    times = one.used // one.frames
    nm, sigma = fringe_scatter_nm(setup, found.seen.usable, one.fringes.periods, one.fringes.steps, times, 20)
    scale = np.sqrt(32 / one.used)
    assert abs(nm / (one.nm_frames * scale) - 1) < 0.1
    assert nm > one.nm_bound * scale * (1 - 3 * sigma - 0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("setup", "lines"), [(setup_of("sphere", 31), (1, 1)), (wide_sphere(31), (5, 5))])
def test_predicted_nm_of_line_scans_within_a_tenth(setup, lines):
    found = design_patterns(setup, frames=42, camera=CAMERA)
    one = next(s for s in found.sets if s.lines == lines)
    longer = line_errors(found.seen, CAMERA, *lines).longer
    nm, sigma = line_scatter_nm(setup, found.seen.usable, *lines, longer, 20)
    scale = np.sqrt(42 / one.frames)
    assert abs(nm / (one.nm_frames * scale) - 1) < 0.1
    assert nm > one.nm_bound * scale * (1 - 3 * sigma - 0.03)


def test_nothing_is_below_the_bounds(sphere):
    for one in sphere.sets:
        assert one.nm_frames >= one.nm_bound * (1 - 1e-9)
        assert one.nm_light >= sphere.bound_light_nm
        if one.fringes:
            assert one.nm_frames >= sphere.bound_frames_nm
    assert sphere.bound_light_nm <= sphere.bound_frames_nm


def test_fringes_are_equal_at_equal_frames_light_and_time(sphere):
    one = named(sphere, "2 x 8 steps, geometric")
    assert one.nm_frames == one.nm_light == one.nm_time
    lines = next(s for s in sphere.sets if s.lines == (1, 1))
    assert lines.frames == 42 and lines.nm_light > lines.nm_time > lines.nm_frames  # a line needs a longer exposure
    # the middle line of 0.2 mm has this share of the light of a disk with a radius of 0.5 mm
    share = 2 / np.pi * (0.2 * np.sqrt(1 - 0.2**2) + np.arcsin(0.2))
    assert (lines.nm_light / lines.nm_frames) ** 2 == pytest.approx(1 / share, rel=0.03)


def test_the_best_fits_and_leaves_residuals(sphere):
    assert sphere.best.lines == (1, 1) and sphere.best.used == 42
    assert sphere.best_fringes.fringes.steps > 3
    small = design_patterns(setup_of("sphere", 31), frames=10, camera=CAMERA)
    assert small.best.fringes.periods == (0.9,) and small.best.fringes.steps == 5 and small.best.used == 10
    assert all(one.used == 0 for one in small.sets if one.lines)


def test_noise_scales_the_heights(sphere):
    """Without noise of light, heights are in proportion to the read noise over the electrons."""
    dark = replace(CAMERA, shot=False, step_e=0.0)
    one, other = (
        design_patterns(setup_of("sphere", 31), camera=replace(dark, read_noise_e=read)).best_fringes
        for read in (10.0, 20.0)
    )
    assert one.fringes == other.fringes and other.nm_frames == pytest.approx(2 * one.nm_frames, rel=1e-6)
    assert one.nm_rounding == 0.0
    rounded = design_patterns(setup_of("sphere", 31), camera=replace(dark, read_noise_e=10.0, step_e=20.0)).best_fringes
    # variance 100 and 20^2 / 12 more
    assert rounded.nm_frames == pytest.approx(one.nm_frames * np.sqrt(1 + 1 / 3), rel=1e-6)
    assert rounded.nm_rounding == pytest.approx(one.nm_frames / np.sqrt(3), rel=1e-6)


def test_the_scenes_own_tables_are_used():
    scene = setup_of("sphere", 31).scene
    noise = DetectorNoise(electrons_at_peak=500.0, shot_noise=True, read_noise_e=4.0, bits=8, gain_e_per_dn=3.0)
    camera = replace(scene.camera, detector=replace(scene.camera.detector, noise=noise))
    screen = replace(scene.screen, response=ScreenResponse(gamma=2.2))
    found = design_patterns(replace(scene, camera=camera, screen=screen))
    assert (found.camera.electrons, found.camera.read_noise_e, found.camera.step_e) == (500.0, 4.0, 3.0)
    assert found.gamma == 2.2
    bias = {one.fringes.steps: one.bias_nm for one in found.sets if one.fringes and len(one.fringes.periods) == 1}
    assert bias[3] > 10 * bias[4] > 10 * bias[5] > 0  # the second, the third less fifth, the fourth and sixth harmonic


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"frames": 5}, "frames = 5: must be from 6"),
        ({"limit": 0.5}, "ambiguity = 0.5: must be above 0 and below 0.5"),
        ({"read_noise_e": -1.0}, "read_noise = -1: must be from 0"),
        ({"electrons": 2e4, "full_well_e": 1e4}, "at most as many"),
    ],
)
def test_refused(given, text):
    with pytest.raises(ValueError, match=text):
        design_patterns(setup_of("sphere", 31), **given)
