"""The phases that the design's light makes, against its images under single lines."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import irtscots_cl as irt
from irtscots_cl.imaging.fringes import FringeScan, FringeSet
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.measurement.fringe_light import light_phases, places_of_light, places_with_harmonics
from irtscots_cl.measurement.harmonic_bias import harmonic_bias
from irtscots_cl.measurement.harmonics import gamma_harmonics
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.measurement.screen_coordinates import screen_coordinates
from irtscots_cl.measurement.screen_places import surface_from_places
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.measure_fringes import places_in_mm


@pytest.mark.needs_device
@pytest.mark.parametrize("levels", [0, 15])
def test_phases_and_modulation_are_those_of_the_light_under_single_lines(levels):
    """To 1e-5 rad: light curves line by line times what each line shows, summed by hand; the sphere itself."""
    scene = irt.load_scene("sphere")
    setup, fringes = Setup(scene), FringeSet.equal("x", (0.9, 2.46), 4)
    u_mm = design_points(setup)[2]
    found = light_phases(setup, fringes, u_mm, levels)
    scan = irt.trace(scene, estimator="analytic").images(irt.LineScan(scene)).x
    place = (np.arange(21) + 0.5) / 21
    centre = u_mm.ravel()[scan.pixels] / 4.2 + 0.5
    inner = setup.chief_rays.footprint.coverage.ravel()[scan.pixels] > 0.5
    for k, periods in enumerate(fringes.periods):
        shown = 0.5 + 0.5 * np.cos(2 * np.pi * periods * place - np.arange(4)[:, None] * np.pi / 2)
        shown = np.rint(shown * levels) / levels if levels else shown
        samples = (scan.mean_w()[:, :, None] * shown.T[scan.lines]).sum(1).T
        phase = np.arctan2(samples[1] - samples[3], samples[0] - samples[2])
        difference = found.difference_rad[k].ravel()[scan.pixels]
        gap = np.angle(np.exp(1j * (phase - 2 * np.pi * periods * centre - difference)))[inner]
        assert np.abs(gap).max() < 1e-5
        if not levels:
            lit = samples[:, inner]
            share = np.hypot(lit[1] - lit[3], lit[0] - lit[2]) / lit.mean(0) / 2
            np.testing.assert_allclose(found.modulation[k].ravel()[scan.pixels][inner], share, rtol=1e-5)


TWO, THREE = (0.9, 2.46), (0.9, 1.7, 2.9)


@cache
def traced(name, pixels=24):
    """(scene with a coarse camera, its transport, the design's set-up)."""
    scene = irt.load_scene(name)
    detector = scene.camera.detector
    coarse = replace(detector, pixels=(pixels, pixels), pitch_mm=detector.pitch_mm * detector.pixels[0] / pixels)
    scene = replace(scene, camera=replace(scene.camera, detector=coarse))
    return scene, irt.trace(scene, estimator="analytic"), Setup(scene.nominal())


def images(name, periods, steps, gamma=1.0, noise=0.0, seed=0, pixels=24):
    """Images over their brightest sample, with noise."""
    scene, run, _ = traced(name, pixels)
    sets = tuple(FringeSet.equal(axis, periods, steps) for axis in "xy")
    stack = run.images(FringeScan(scene, sets, gamma=gamma))
    frames = stack.frames / stack.frames.max()
    return replace(stack, frames=frames + noise * np.random.default_rng(seed).standard_normal(frames.shape))


def found_in(name, stack, pixels=24):
    """(coordinates before, after the light's phases, the latter, mask)."""
    setup = traced(name, pixels)[2]
    mask = setup.chief_rays.footprint.coverage >= 0.5
    raw = screen_coordinates(stack, mask=mask)
    return raw, *places_of_light(raw, setup), mask


def surface(name, found, mask, pixels=24):
    setup = traced(name, pixels)[2]
    places = places_in_mm(found, setup, mask)
    return surface_from_places(places, setup, method="cubic", pixel_average=False)


def error_nm(name, result, pixels=24):
    deviation = Setup(traced(name, pixels)[0]).chief_rays.surface.deviation_at(result.x_mm, result.y_mm)[0]
    off = remove_terms(result.x_mm, result.y_mm, result.deviation_mm - deviation, result.mask, "piston_tilt")
    return rms(off, result.mask) * 1e6


@pytest.mark.needs_device
@pytest.mark.parametrize("steps", [4, 16])
@pytest.mark.parametrize("periods", [TWO, THREE], ids=str)
@pytest.mark.parametrize("name", ["sphere", "sphere-deviated"])
def test_clean_fringes_are_as_good_as_fine_line_scans(name, periods, steps):
    """Within 1.2 x."""
    scene, run, setup = traced(name)
    fine = error_nm(name, measure_by("fine", run.images(irt.LineScan(scene)), setup))
    _, found, _, mask = found_in(name, images(name, periods, steps))
    assert error_nm(name, surface(name, found, mask)) < 1.2 * fine + 1e-9  # rounding


@pytest.mark.needs_device
@pytest.mark.parametrize("steps", [4, 5])
@pytest.mark.parametrize("periods", [TWO, THREE], ids=str)
def test_gamma_is_taken_out_to_less_than_a_nanometre(periods, steps):
    """With the blur of the light, by which the images' second harmonic alone tells a gamma of 1.9."""
    name = "sphere-deviated"
    raw, found, phases, mask = found_in(name, images(name, periods, steps, gamma=2.2))
    assert raw.x.survey.second[0].gamma < 2.0
    assert phases["x"].gamma.value == pytest.approx(2.2, abs=1e-3)
    clean = found_in(name, images(name, periods, steps))
    right, left = (surface(name, one, mask) for one in (found, places_with_harmonics(raw, phases, "upright")))
    known = error_nm(name, surface(name, clean[1], mask))
    assert error_nm(name, right) < known + 0.02  # nm; the bound is 1
    if steps == 4:  # at five the bias is an eighth
        assert error_nm(name, left) > known + 0.3


@pytest.mark.needs_device
def test_the_bias_that_harmonics_would_make_is_told():
    """Against the closed form, and the difference of phases with and without them."""
    name = "sphere-deviated"
    raw, found, phases, mask = found_in(name, images(name, TWO, 4, gamma=2.2))
    told = harmonic_bias(raw, phases, mask)["x"]
    assert told.closed_form_rad == pytest.approx((0.0106, 0.0106), abs=1e-4)
    assert 0.4 * 0.0106 < told.bias_rad[0] < 0.0106  # the light's blur
    ratios = gamma_harmonics(2.2)
    left = [phases["x"].modulation[0][mask].mean()]
    setup = traced(name)[2]
    place = (found.x.fraction - 0.5) * 4.2
    for k in (3, 5):
        light = light_phases(setup, FringeSet.equal("x", (0.9 * k,), 4), place)
        left.append(light.modulation[0][mask].mean())
    third, fifth = (ratios[k] * left[1 + i] / left[0] for i, k in enumerate((3, 5)))
    phase = 2 * np.pi * 0.9 * found.x.fraction[mask]
    expected = -(third - fifth) * np.sin(4 * phase)
    np.testing.assert_allclose(phases["x"].harmonics_rad[0][mask], expected, atol=3e-4)  # phases of blurred harmonics
    plain, _, linear, _ = found_in(name, images(name, TWO, 4))
    assert not harmonic_bias(plain, linear, mask)


@pytest.mark.needs_device
@pytest.mark.slow
def test_a_gammas_error_is_part_of_the_phases():
    """Noise lets gamma differ by its stated error: pulls over repeats."""
    name, pulls = "sphere-deviated", []
    for seed in range(20):
        _, _, phases, mask = found_in(name, images(name, TWO, 4, gamma=2.2, noise=0.003, seed=seed))
        gamma = phases["x"].gamma
        pulls.append((gamma.value - 2.2) / gamma.standard_error)
        assert 0 < np.nanmax(phases["x"].harmonics_error_rad[0][mask]) < 0.002
    # chance of failure 1e-6: 4.9 sigma of the mean, chi-square of 20
    assert abs(np.mean(pulls)) < 4.9 / np.sqrt(20) and 0.15 < np.mean(np.square(pulls)) < 3.5


@pytest.mark.needs_device
@pytest.mark.long
@pytest.mark.parametrize(("steps", "gamma"), [(3, 1.0), (4, 1.0), (4, 2.2), (5, 2.2), (16, 1.0)])
def test_heights_err_as_stated(steps, gamma):
    """1 % of noise: actual over stated error of heights within 10 %, slopes' pulls within 5 %, over 40 seeds."""
    name, pixels, actual, stated, pulls = "sphere-deviated", 45, [], [], []
    surface_true = Setup(traced(name, pixels)[0]).chief_rays.surface
    for seed in range(40):
        stack = images(name, THREE, steps, gamma, 0.01, seed, pixels)
        _, found, _, mask = found_in(name, stack, pixels)
        result = surface(name, found, mask, pixels)
        bars = error_bars(result, seed)
        actual.append(error_nm(name, result, pixels) ** 2)
        stated.append((rms(bars.height_mm, result.mask) * 1e6) ** 2)
        slope = surface_true.gradient(result.x_mm, result.y_mm)[0]
        pulls.append(np.mean(((result.slope_x - slope) / bars.slope_x)[result.mask] ** 2))
    # three steps' noise is known to some percent from the agreement of the series; ratio's own error 2 %
    assert np.sqrt(np.mean(actual) / np.mean(stated)) == pytest.approx(1, abs=0.1 + 0.06)
    assert np.sqrt(np.mean(pulls)) == pytest.approx(1, abs=0.05)
