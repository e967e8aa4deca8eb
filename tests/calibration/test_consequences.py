"""What a fit means, against fits of data in which it is so."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from calibrations import fitted, measured, paraboloid

from irtscots_cl.calibration.bundle_adjustment import adjust
from irtscots_cl.calibration.consequences import candidates, fitted_scene, height_effects, widened
from irtscots_cl.calibration.heights import TERMS
from irtscots_cl.calibration.parameters import moved, zernike_names

SCENE = paraboloid(21)
POSES = "camera,screen"
TRUE = {"camera.x_mm": 0.2, "screen.z_mm": -0.2}


def test_draws_of_the_unknowns_have_the_fits_covariance():
    fit = fitted(measured(SCENE, TRUE), POSES)
    draws = widened(fit, (), draws=4000).errors_of_unknowns() / fit.errors
    expected = fit.covariance / np.outer(fit.errors, fit.errors)
    np.testing.assert_allclose(draws.T @ draws / 4000, expected, atol=0.1)  # 4.5 sigmas of 1 / sqrt(2000)


def test_parts_of_the_pixels_make_no_difference(monkeypatch):
    fit = fitted(measured(SCENE, TRUE), POSES)
    whole = widened(fit, candidates(fit), draws=2)
    monkeypatch.setattr("irtscots_cl.calibration.measured.AT_ONCE", 50)
    parts = widened(fit, candidates(fit), draws=2)
    for name, gain in whole.gains().items():
        assert parts.gains()[name] == pytest.approx(gain, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("name", ["camera.k1", "zernike.5_um", "screen.sag_2_0_mm"])
def test_what_a_further_unknown_explains(name):
    """Chi-square falls by the stated gain if the unknown joins the fit, with a prior that says nothing."""
    fit = fitted(measured(SCENE, TRUE | {name: 1e-3 if name != "camera.k1" else 0.02}), POSES)
    gain = widened(fit, (name,)).gains()[name]
    more = fit.problem.with_unknowns((name,))
    better = adjust(dataclasses.replace(more, sigmas=np.append(fit.problem.sigmas, 1e6 * more.scales[-1])))
    sums = [f.chi_square + np.sum((f.values / f.problem.sigmas) ** 2) for f in (fit, better)]
    assert sums[0] - sums[1] == pytest.approx(gain, rel=0.02, abs=0.02)


@pytest.mark.parametrize("noll", [4, 5, 7])
@pytest.mark.parametrize("unknowns", [POSES, f"{POSES},zernike.4-8"])
def test_mirror_terms_that_pass_for_geometry(noll, unknowns):
    """The fit of a mirror with the term is off by as much as stated; without noise in the data."""
    (name,), size = zernike_names([noll]), 0.02
    exact = measured(SCENE, {}, noise=1e-9)
    exact = dataclasses.replace(exact, errors_mm=np.full_like(exact.errors_mm, 1e-3))
    fit = fitted(exact, unknowns)
    wide = widened(fit, [n for n in zernike_names(TERMS) if n not in fit.names])
    stated = wide.error_by(name) * size
    with_term = measured(SCENE, {name: size}, noise=1e-9)
    with_term = dataclasses.replace(with_term, errors_mm=exact.errors_mm)
    again = fitted(with_term, unknowns)
    geometry = [k for k, n in enumerate(fit.names) if not n.startswith("zernike")]
    found = (again.values - fit.values)[geometry] / fit.errors[geometry]
    scale = np.abs(found).max()
    assert scale > 1e-3
    np.testing.assert_allclose(stated[geometry] / fit.errors[geometry], found, atol=0.03 * scale)


def test_heights_before_and_after():
    true = TRUE | {"camera.roll_rad": 1e-3, "screen.clocking_rad": -2e-3}
    m = measured(SCENE, true)
    fit = fitted(m, POSES)
    effects = height_effects(widened(fit, zernike_names(TERMS)))
    grid = effects.grid
    before, after, noise, draws = (
        np.sqrt(np.mean(grid.without(maps, "piston_tilt")[..., grid.mask] ** 2)) * 1e6
        for maps in (effects.before, effects.after, effects.noise_draws, effects.draws)
    )
    assert before > 50 and after < 10 and 0.3 < after / draws < 2
    assert draws < noise  # of a known mirror: low orders of the noise went into the geometry, and back
    np.testing.assert_allclose(effects.change, effects.after - effects.before)
    assert effects.taken[4][1] == pytest.approx(1, abs=0.01)  # power is the distance of camera and screen


def test_draws_for_images_too_large_to_keep_their_noise(monkeypatch):
    fit = fitted(measured(SCENE, TRUE), POSES)
    kept = height_effects(widened(fit, (), draws=400))
    monkeypatch.setattr("irtscots_cl.calibration.consequences.MOST_NOISE", 10)
    wide = widened(fit, (), draws=400)
    assert wide.noise_mm is None
    drawn = height_effects(wide)
    levels = [np.nanstd(e.grid.without(e.noise_draws, "piston_tilt")) for e in (kept, drawn)]
    assert levels[1] == pytest.approx(levels[0], rel=0.15)  # 400 draws of few independent numbers


def test_the_fitted_scene_has_the_fitted_geometry_and_the_designs_mirror():
    fit = fitted(measured(SCENE, TRUE), f"{POSES},zernike.4-6")
    values = dict(zip(fit.names, fit.values.tolist(), strict=True))
    geometry = {name: value for name, value in values.items() if not name.startswith("zernike")}
    assert fitted_scene(fit) == moved(SCENE, geometry) and fitted_scene(fit).mirror == SCENE.mirror
