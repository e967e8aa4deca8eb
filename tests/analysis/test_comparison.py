"""Errors against the truth, from results made to have known errors."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from freeform import ANNULAR, freeform
from scenes import coarse
from surfaces import exact

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.integration import separate_islands
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

ROUNDING = 1e-9  # relative: heights of up to 1e-3 mm and a fit of 45 terms


@pytest.fixture(scope="module")
def scene():
    return load_scene("sphere-deviated")


@pytest.fixture(scope="module")
def result(scene):
    return exact(scene)


def heights(comparison) -> list[float]:
    return [estimate.value for estimate in comparison.height_error_nm.values()]


def test_the_truth_has_no_error(scene, result):
    found = compare(result, scene)
    assert found.pixels_used == result.mask.sum()
    assert [e.value for e in found.slope_error_urad.values()] == [0.0, 0.0]
    assert list(found.height_error_nm) == ["piston", "piston_tilt", "piston_tilt_power"]
    assert max(heights(found)) < 1e-6  # nm: rounding of heights near 1000 nm
    assert np.isnan(found.height_standard_error_nm)
    assert all(np.isnan(e.standard_error) for e in found.slope_error_urad.values())


def test_slope_errors_are_in_microradians_and_by_axis(scene, result):
    found = compare(dataclasses.replace(result, slope_x=result.slope_x + 2e-6, slope_y=result.slope_y - 3e-7), scene)
    assert found.slope_error_urad["x"].value == pytest.approx(2.0, rel=ROUNDING)
    assert found.slope_error_urad["y"].value == pytest.approx(0.3, rel=ROUNDING)


@pytest.mark.parametrize(
    ("shape", "left"),
    [
        (lambda x, y: 0 * x + 1, (0, 0, 0)),
        (lambda x, y: (x - 2 * y) / 532, (1, 0, 0)),
        (lambda x, y: (x**2 + y**2) / 532**2, (1, 1, 0)),
        (lambda x, y: x * y / 532**2, (1, 1, 1)),
    ],
)
def test_each_height_error_says_what_was_removed(scene, result, shape, left):
    error = shape(result.x_mm, result.y_mm)
    scale = 7e-6 / np.nanstd(error) if np.nanstd(error) else 7e-6  # to 7 nm rms about the mean
    found = compare(dataclasses.replace(result, deviation_mm=result.deviation_mm + scale * error), scene)
    np.testing.assert_allclose(
        heights(found),
        np.multiply(left, 7.0),
        rtol=ROUNDING,
        atol=1e-6,  # nm: rounding
    )
    assert np.nanstd(found.error_mm) * 1e6 == pytest.approx(7.0 * left[1], rel=ROUNDING, abs=1e-6)  # the same


def test_the_error_bars_are_the_jackknife_s(scene, result):
    """Slope errors of 1.0, 1.1 and 0.9 urad with one replicate left out: sqrt(2/3 sum of squares)."""
    left = np.stack([result.slope_x + k * 1e-6 for k in (1.0, 1.1, 0.9)])
    deviation = np.stack([result.deviation_mm] * 3)
    noisy = dataclasses.replace(
        result,
        slope_x=result.slope_x + 1e-6,
        jackknife_slope_x=left,
        jackknife_slope_y=left,
        jackknife_deviation_mm=deviation,
    )
    found = compare(noisy, scene)
    assert found.slope_error_urad["x"].standard_error == pytest.approx(np.sqrt(2 / 3 * 0.02), rel=ROUNDING)
    assert found.height_standard_error_nm == pytest.approx(0.0, abs=1e-9)  # nm: equal maps
    assert all(row.standard_error_um < 1e-12 for row in found.zernike)  # um: the same


def test_the_scene_s_coefficients_come_out(scene, result):
    found = {row.noll: row for row in compare(result, scene).zernike}
    assert sorted(found) == list(range(1, 46))
    given = scene.mirror.zernike[0].coefficients_um
    for noll, row in found.items():
        assert row.input_um == given.get(noll, 0.0)
        assert row.output_um == pytest.approx(row.input_um, abs=1e-10)  # um: rounding of the fit
        assert np.isnan(row.standard_error_um)


def test_terms_of_every_ordering_are_reported_by_noll_and_added_up(scene):
    """Power is Noll 4 and OSA 4; Noll 60 is beyond the terms that are always fitted."""
    tables = (
        ZernikeTerms(radius_mm=532.0, ordering="noll", coefficients_um={4: 0.1, 60: 0.02}),
        ZernikeTerms(radius_mm=532.0, ordering="osa", coefficients_um={4: 0.2}),
    )
    deviated = dataclasses.replace(scene, mirror=dataclasses.replace(scene.mirror, zernike=tables))
    found = {row.noll: row for row in compare(exact(deviated), deviated).zernike}
    assert sorted(found) == [*range(1, 46), 60]
    assert found[4].input_um == pytest.approx(0.3, rel=1e-15)  # rounding of one sum
    assert found[4].output_um == pytest.approx(0.3, rel=ROUNDING)
    assert found[60].output_um == pytest.approx(0.02, rel=ROUNDING)


def test_an_unexpected_term_is_found_too(scene, result):
    extra = 1e-3 * 0.05 * zernike(7, result.x_mm / 532, result.y_mm / 532)
    found = compare(dataclasses.replace(result, deviation_mm=result.deviation_mm + extra), scene)
    assert found.zernike[6].input_um == 0.0
    assert found.zernike[6].output_um == pytest.approx(0.05, rel=1e-7)  # rounding of the fit


def test_too_few_pixels_for_all_terms_give_the_low_orders(scene):
    few = exact(scene, 7)
    assert few.mask.sum() < 45
    found = compare(few, scene)
    fitted = [row for row in found.zernike if np.isfinite(row.output_um)]
    assert [row.noll for row in fitted] == list(range(1, len(fitted) + 1)) and 6 <= len(fitted) < few.mask.sum()
    lost = {row.noll for row in found.zernike} - {row.noll for row in fitted}
    assert lost and lost <= set(scene.mirror.zernike[0].coefficients_um)
    assert "not separable by the pixels" in str(found)


def test_piston_is_compared_with_that_of_a_true_map_without_its_mean(scene, result):
    level = result.deviation_mm - np.nanmean(result.deviation_mm)
    row = compare(dataclasses.replace(result, deviation_mm=level), scene)
    piston, power = row.zernike[0], row.zernike[3]
    assert piston.input_um == 0 and abs(piston.expected_um) > 1e-4  # the mean over these pixels
    assert piston.output_um == pytest.approx(piston.expected_um, abs=1e-10)
    assert power.expected_um == pytest.approx(power.input_um, abs=1e-10)


def test_groups_of_islands_are_not_compared_in_height(scene, result):
    """Two halves, their pistons unknown: heights of the larger, slopes of both, own pistons in the map."""
    mask = result.mask & (np.abs(np.arange(31) - 16) > 3)
    islands = separate_islands(mask)
    level = islands.levelled(result.deviation_mm)
    found = compare(dataclasses.replace(result, mask=mask, islands=islands, deviation_mm=level), scene)
    assert islands.groups == 2 and found.pixels_used == mask.sum() > islands.main.sum()
    assert max(heights(found)) < 1e-6 and np.nanmax(np.abs(found.error_mm)) < 1e-12
    assert np.array_equal(np.isfinite(found.error_mm), mask)
    errors = [abs(row.output_um - row.expected_um) for row in found.zernike if np.isfinite(row.output_um)]
    assert len(errors) >= 6 and max(errors) < 1e-9


def test_an_estimate_is_printed_with_its_error_where_it_has_one():
    assert str(Estimate(0.123456, float("nan"))) == "0.1235"
    assert str(Estimate(0.123456, 0.00234)) == "0.1235 +- 0.002"


def test_a_comparison_prints_its_main_numbers_with_units(scene, result):
    text = str(compare(dataclasses.replace(result, slope_x=result.slope_x + 2e-6), scene))
    assert "slope error x [urad rms]  2\n" in text
    assert "[nm rms]" in text and "piston, tilt, power" in text
    assert len([line for line in text.splitlines() if line.strip()[:2] in ("6 ", "8 ", "9 ", "11", "29", "38")]) == 6


# --- mirrors whose deviation is not a sum of circular terms on one disk --------------------------------------


def ring_of(scene):
    return dataclasses.replace(scene.mirror, obscuration_mm=266.0, zernike=ANNULAR[:1])


def test_annular_terms_come_back_as_they_were_given(scene):
    ring = dataclasses.replace(scene, mirror=ring_of(scene))
    result = exact(ring)
    mask = result.mask & (np.hypot(result.x_mm, result.y_mm) > 133.0)
    found = {row.noll: row for row in compare(dataclasses.replace(result, mask=mask), ring, "annular").zernike}
    given = ANNULAR[0].coefficients_um
    for noll, row in found.items():
        assert row.input_um == given.get(noll, 0.0)
        assert noll == 1 or row.output_um == pytest.approx(row.input_um, abs=1e-9)  # um: rounding of the fit
    circular = {row.noll: row for row in compare(dataclasses.replace(result, mask=mask), ring).zernike}
    assert abs(circular[11].output_um - given[11]) > 0.01  # other terms: their inputs are not the table's numbers
    assert all(row.input_um == row.expected_um for row in circular.values())


@pytest.mark.slow
def test_measured_light_of_a_ring_gives_its_terms_back(scene):
    """Images of the closed form, measured with annular terms: what is left are the lines' and the integration's."""
    ring = coarse(dataclasses.replace(scene, mirror=ring_of(scene)), 61)
    run = trace(ring, estimator="analytic")
    result = reconstruct(run.images(LineScan(ring)), ring.nominal())
    found = compare(result, ring, "annular").zernike
    assert max(abs(row.output_um - row.input_um) for row in found if 4 <= row.noll <= 37) < 5e-3  # um
    assert max(abs(row.input_um) for row in found) == 0.3


def test_a_deviation_with_polynomials_is_expected_as_it_is_and_its_design_is_not(scene):
    """The coefficients that a fit of the true deviation has, not those of the Zernike table alone."""
    whole = dataclasses.replace(scene, mirror=dataclasses.replace(freeform().mirror, zernike=scene.mirror.zernike))
    result = exact(whole)
    comparison = compare(result, whole)
    assert max(heights(comparison)) < 1e-6 and comparison.zernike_fit.residual_nm < 200
    given = scene.mirror.zernike[0].coefficients_um
    rows = {row.noll: row for row in comparison.zernike}
    for row in rows.values():
        assert row.input_um == row.expected_um
        assert row.noll == 1 or row.output_um == pytest.approx(row.input_um, abs=1e-9)  # um: rounding
    assert abs(rows[6].input_um - given[6]) > 0.05  # the polynomial's astigmatism


def test_terms_on_two_disks_are_expected_as_their_sum(scene):
    tables = (*scene.mirror.zernike, ANNULAR[1])
    both = dataclasses.replace(scene, mirror=dataclasses.replace(scene.mirror, zernike=tables))
    rows = {row.noll: row for row in compare(exact(both), both).zernike}
    assert all(row.input_um == row.expected_um for row in rows.values())
    # power on a disk of 600 mm is (532 / 600)^2 of it on one of 532 mm; the fourth order's piece is small
    assert rows[4].input_um != 0 and abs(rows[6].input_um - scene.mirror.zernike[0].coefficients_um[6]) > 1e-3
