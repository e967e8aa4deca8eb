"""Zernike coefficients of a measured deviation: pulls of all terms, annular terms, errors without replicates."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from surfaces import exact

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.maths.integration import integrate, integrate_slopes
from irtscots_cl.maths.zernike.annular import annular_zernike
from irtscots_cl.measurement.coefficients import coefficient_noise, coefficients, terms_disk
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.presets import load_scene

NOISE_RAD = 1e-6


@pytest.fixture(scope="module")
def scene():
    return load_scene("sphere-deviated")


def measured(result, scene, noise, method="cubic"):
    """The result with the heights of its true slopes and these errors [2, maps, rows, columns]."""
    slopes = Surface.of(scene.mirror).deviation_at(result.x_mm, result.y_mm)[1:]
    p, q = (slope + n for slope, n in zip(slopes, noise, strict=True))
    found = integrate(result.x_mm, result.y_mm, p, q, result.mask, method)
    own = result.setup.chief_rays.surface.gradient(result.x_mm, result.y_mm)
    return dataclasses.replace(
        result, method=method, deviation_mm=found.z_mm[0], jackknife_deviation_mm=found.z_mm[1:],
        slope_x=own[0] + p[0], slope_y=own[1] + q[0], islands=found.islands,
    )  # fmt: skip


@pytest.mark.parametrize("gaps", [False, True])
def test_pulls_of_all_terms_have_a_standard_deviation_of_1(scene, gaps):
    """Slope noise through integration and fit, piston included: what is compared is the true deviation's own fit."""
    result = exact(scene, 25)
    if gaps:
        mask = result.mask & (np.random.default_rng(5).random(result.mask.shape) > 0.25)
        result = dataclasses.replace(result, mask=mask)
    noise = NOISE_RAD * np.random.default_rng(1).standard_normal((2, 2000, *result.mask.shape))
    noise[:, 0] = 0.0  # so that the islands are joined as without noise
    result = measured(result, scene, noise)
    assert not gaps or (result.islands.count > 3 and result.islands.groups == 1)
    fit = coefficients(result, scene.mirror, noise_errors=False).fit
    found = fit.coefficients(result.estimates("deviation_mm")[1:, result.mask] * 1e3)
    expected = np.array([row.expected_um for row in compare(result, scene).zernike])
    sizes = np.full(result.mask.shape, NOISE_RAD)
    stated = coefficient_noise(result, fit, sizes, sizes, draws=3000)
    pulls = (found - expected) / stated
    print(f"means {np.abs(pulls.mean(0)).max():.2f}, deviations {pulls.std(0).min():.3f} to {pulls.std(0).max():.3f}")
    # 2000 pulls and 3000 draws: 2 %; 45 terms
    assert 0.93 < pulls.std(0).min() < pulls.std(0).max() < 1.07
    assert np.abs(pulls.mean(0)).max() < 0.3  # 0.022 by chance; the rest are the errors of cubics on 25 nodes
    # the scene's own piston of 0 is not that of a map with a mean of 0
    assert abs(expected[0]) > (1 if gaps else 5) * stated[0]


def test_pulls_hold_where_the_mask_differs_from_seed_to_seed(scene):
    """Pixels at the rim come and go with the noise of their light, and the mean of the true deviation with them."""
    whole, pulls, plain = exact(scene, 17), [], []
    rim = whole.mask & (np.hypot(whole.x_mm, whole.y_mm) > 0.85 * scene.mirror.diameter_mm / 2)
    for seed in range(60):
        random = np.random.default_rng(seed)
        mask = whole.mask & ~(rim & (random.random(rim.shape) < 0.15))
        noise = NOISE_RAD * random.standard_normal((2, 1, *mask.shape))
        result = measured(dataclasses.replace(whole, mask=mask), scene, noise)
        if result.islands.count > 1:
            continue
        rows = compare(result, scene).zernike
        sizes = np.full(mask.shape, NOISE_RAD)
        stated = coefficient_noise(result, coefficients(result, scene.mirror, noise_errors=False).fit, sizes, sizes)
        pulls.append((rows[0].output_um - rows[0].expected_um) / stated[0])
        plain.append((rows[0].output_um - rows[0].input_um) / stated[0])
    assert len(pulls) > 40
    assert np.std(pulls) == pytest.approx(1.0, abs=0.35)  # 40 pulls: 11 %, 64 draws: 9 %; 2.5 sigma
    assert np.std(plain) > 1.7 * np.std(pulls)


def test_errors_without_replicates_come_from_the_misfit(scene):
    result = exact(scene, 25)
    noise = NOISE_RAD * np.random.default_rng(2).standard_normal((2, 1, *result.mask.shape))
    result = measured(result, scene, noise)
    assert result.white_slope_noise() == pytest.approx(NOISE_RAD, rel=0.15)  # 350 loops: 4 %
    found = coefficients(result, scene.mirror)
    sizes = np.full(result.mask.shape, NOISE_RAD)
    np.testing.assert_allclose(found.standard_error_um, coefficient_noise(result, found.fit, sizes, sizes), rtol=0.15)
    assert found.error_source == "misfit"
    assert coefficients(result, scene.mirror, noise_errors=False).error_source == "none"
    three = dataclasses.replace(result, **{
        f"jackknife_{name}": np.stack([getattr(result, name)] * 3) for name in ("slope_x", "slope_y", "deviation_mm")
    })  # fmt: skip
    assert coefficients(three).error_source == "replicates"


def test_joined_islands_add_their_stated_errors(scene):
    result = exact(scene, 25)
    mask = result.mask & (np.abs(np.arange(25) - 12) > 1)
    noise = np.zeros((2, 1, *mask.shape))
    result = measured(dataclasses.replace(result, mask=mask), scene, noise)
    assert (result.islands.count, result.islands.groups) == (2, 1)
    three = dataclasses.replace(result, **{
        f"jackknife_{name}": np.stack([getattr(result, name)] * 3) for name in ("slope_x", "slope_y", "deviation_mm")
    })  # fmt: skip
    found = coefficients(three, scene.mirror)
    step_um = result.islands.error_mm[1] * 1e3
    assert 0.2 * step_um < found.standard_error_um[1] < step_um  # the step between the halves is seen as tilt in x
    assert found.standard_error_um[2] < 0.1 * found.standard_error_um[1]
    error = three.height_standard_error_mm()
    assert 0 < np.nanmax(error) <= result.islands.error_mm[1]


def test_annular_terms_of_an_obscured_mirror(scene):
    mirror = dataclasses.replace(scene.mirror, obscuration_mm=0.7 * scene.mirror.diameter_mm)
    assert terms_disk(mirror, "annular") == (532.0, 0.7) and terms_disk(mirror, "circular") == (532.0, 0.0)
    result = exact(scene, 61)
    radius = np.hypot(result.x_mm, result.y_mm)
    result = dataclasses.replace(result, mask=result.mask & (radius >= 0.7 * 532))
    x, y = result.x_mm / 532, result.y_mm / 532
    given = {4: 0.05, 11: -0.1, 22: 0.02}
    wanted = 1e-3 * sum(c * annular_zernike(j, x, y, 0.7) for j, c in given.items())
    result = dataclasses.replace(result, deviation_mm=np.where(result.mask, wanted, np.nan))
    found = coefficients(result, mirror, "annular", noise_errors=False)
    for noll, um in zip(found.fit.nolls, found.um, strict=True):
        assert um == pytest.approx(given.get(noll, 0.0), abs=1e-10)
    assert not found.fit.dropped and found.fit.condition < 5 and found.residual_nm < 1e-6
    disk = coefficients(result, mirror, noise_errors=False)
    assert disk.fit.dropped and 10 * disk.fit.condition < disk.fit.condition_all


@pytest.mark.parametrize("factor", [2.0, 3.8])
def test_a_disk_far_larger_than_the_pupil(scene, factor):
    """Coefficients of the terms that are left are what the same fit gives for the truth, not microns."""
    terms = ZernikeTerms(532.0 * factor, "noll", {4: 0.1, 6: 0.3266, 11: 0.05})
    wide = dataclasses.replace(scene, mirror=dataclasses.replace(scene.mirror, zernike=(terms,)))
    result = exact(wide, 41)
    slopes = Surface.of(wide.mirror).deviation_at(result.x_mm, result.y_mm)[1:]
    heights = integrate_slopes(result.x_mm, result.y_mm, *slopes, result.mask)
    rows = compare(dataclasses.replace(result, deviation_mm=heights), wide).zernike
    fitted = [row for row in rows if np.isfinite(row.output_um)]
    assert 1 <= len(fitted) < 11
    assert all(abs(row.output_um - row.expected_um) < 1e-3 for row in fitted)  # um: trapezoids, inflated 10 times
    lost = [row.noll for row in rows if not np.isfinite(row.output_um)]
    assert lost == [noll for noll in (4, 6, 11) if noll > len(fitted)]
    assert all(abs(row.output_um) < 1.0 for row in fitted)


def test_an_unknown_kind_is_refused(scene):
    with pytest.raises(ValueError, match="^zernike = 'square': must be one of circular, annular$"):
        coefficients(exact(scene, 9), kind="square")
