"""Fringe images from transport maps, and the places that they give, against chief rays."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import irtscots_cl as irt
from irtscots_cl.optics.setup import Setup

PERIODS = (0.9, 3.0)


def sets_of(periods=PERIODS, steps=4):
    return tuple(irt.FringeSet.equal(axis, periods, steps) for axis in "xy")


@pytest.fixture(scope="module")
def scene():
    return irt.load_scene("sphere")


@pytest.fixture(scope="module")
def run(scene):
    return irt.trace(scene, estimator="analytic")


@pytest.mark.needs_device
def test_frames_are_the_light_curves_times_the_pattern(scene, run):
    """Every frame by hand: from the images under single lines."""
    stack, lines = run.images(irt.FringeScan(scene, sets_of())), run.images(irt.LineScan(scene))
    number = 0
    for fringes in stack.sets:
        scan = getattr(lines, fringes.axis)
        under_lines = np.stack([scan.image(k) for k in range(21)])
        for shown in fringes.values((np.arange(21) + 0.5) / 21):
            np.testing.assert_allclose(stack.frames[number], np.tensordot(shown, under_lines, 1), rtol=1e-9, atol=1e-22)
            number += 1
        np.testing.assert_allclose(stack.white, under_lines.sum(0), rtol=1e-9, atol=1e-22)
    assert number == 16 and not stack.dark.any() and stack.unit == "W"


@pytest.mark.needs_device
def test_the_phase_is_that_of_the_light_s_fourier_component(scene, run):
    """Not that of its centroid: with four steps, to rounding."""
    stack, lines = run.images(irt.FringeScan(scene, sets_of())), run.images(irt.LineScan(scene))
    found = irt.screen_coordinates(stack)
    for axis in "xy":
        scan = getattr(lines, axis)
        place = (scan.lines + 0.5) / 21
        for k, periods in enumerate(PERIODS):
            component = np.full(scan.shape, np.nan, complex)
            component.ravel()[scan.pixels] = (scan.mean_w() * np.exp(2j * np.pi * periods * place)).sum(1)
            gap = np.angle(np.exp(1j * found.axes[axis].phase_rad[k][found.mask]) / component[found.mask])
            assert np.nanmax(np.abs(gap)) < 1e-5  # maps are kept in float32, corrected for no harmonic
            modulation = np.abs(component[found.mask]) / stack.white[found.mask]
            np.testing.assert_allclose(found.axes[axis].modulation[k][found.mask], modulation, rtol=1e-4)


@pytest.mark.needs_device
@pytest.mark.parametrize("steps", [4, 5, 8])
def test_places_are_those_of_the_chief_rays(scene, run, steps):
    """The bias of fringes on a sphere: below 1 um on the screen, whose pixels have 200 um.

    Line scans differ from the mean chief ray by 0.8 um rms, by the steps of their lines.
    """
    chief = Setup.of(scene).chief_rays
    found = irt.screen_coordinates(run.images(irt.FringeScan(scene, sets_of(steps=steps))))
    inner = chief.footprint.coverage > 0.999
    assert found.mask[inner].all() and found.notes == ()
    for axis, place in (("x", chief.footprint.u_mm), ("y", chief.footprint.v_mm)):
        ours = found.axes[axis]
        error_mm = (ours.fringes.position_mm(ours.fraction, 21, 0.2) - place)[inner]
        assert np.sqrt(np.mean(error_mm**2)) < 0.001
        assert abs(np.mean(error_mm)) < 1e-4
        assert np.nanmax(ours.wrong) < 1e-9


@pytest.mark.needs_device
def test_rays_agree_with_the_closed_form_within_their_noise(scene, run):
    rays = irt.trace(scene, estimator="adjoint", rays_per_pixel=1024, replicates=4, seed=3)
    pattern = irt.FringeScan(scene, sets_of())
    exact, mean = run.images(pattern).frames, rays.images(pattern).frames
    each = np.stack([rays.fringe_images(pattern, r).frames for r in range(4)])
    np.testing.assert_allclose(each.mean(0), mean, rtol=1e-9, atol=1e-22)  # equal numbers of rays
    bright = exact > 0.2 * exact.max()
    error = each.std(0, ddof=1)[bright] / 2
    pull = (mean - exact)[bright] / np.sqrt(np.mean(error**2))
    assert 0.8 < np.std(pull) < 1.3 and abs(np.mean(pull)) < 0.05


@pytest.mark.needs_device
def test_fringes_beyond_what_the_blur_lets_through_are_named(scene, run):
    """Seven periods lie beyond the first zero of the aperture's blur: their phase is turned by half a period."""
    found = irt.screen_coordinates(run.images(irt.FringeScan(scene, sets_of((0.9, 7.0)))))
    assert len(found.notes) == 2 and all("what the blur lets through" in note for note in found.notes)


@pytest.mark.needs_device
def test_fringes_of_another_screen_are_refused(run):
    screen = dataclasses.replace(run.scene.screen, pixels=(22, 21))
    with pytest.raises(ValueError, match=r"the pattern's screen has \(22, 21\) pixels, the transport's \(21, 21\)"):
        run.images(irt.FringeScan(dataclasses.replace(run.scene, screen=screen), sets_of()))
