"""Refinement by a model: what it takes away from a measurement, when it stops, what it must leave alone.

Images are in closed form and without noise unless a test says otherwise; they come from other code than the model's
residuals, and images by rays close the circle.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from synthetic import small_scene, with_replicates

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement import refinement
from irtscots_cl.measurement.light_curves import Flag
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.reconstruction import Reconstruction, reconstruct
from irtscots_cl.measurement.refinement import MODEL_ORDER, PIXELS_PER_TERM, refine
from irtscots_cl.optics.setup import Setup
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.instrument import Detector
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

NM = 1e-6  # in mm
TOLERANCE_NM = 1e-3  # refine's own
PRESET = {6: 0.3266, 8: -0.1241, 9: 0.1057, 11: 0.0753}  # um, noll: as large as those of sphere-deviated


def images_of(scene: Scene) -> ImageStack:
    return trace(scene, estimator="analytic").images(LineScan(scene))


def with_zernikes(scene: Scene, noll_um: dict[int, float], diameter_mm: float | None = None) -> Scene:
    """The scene with this deviation instead of its own, on a mirror of another diameter."""
    diameter_mm = diameter_mm or scene.mirror.diameter_mm
    terms = (ZernikeTerms(diameter_mm / 2, "noll", noll_um),)
    return dataclasses.replace(scene, mirror=dataclasses.replace(scene.mirror, diameter_mm=diameter_mm, zernike=terms))


def truth_mm(result: Reconstruction, scene: Scene) -> np.ndarray:
    return Surface.of(scene.mirror).deviation_at(result.x_mm, result.y_mm)[0]


def height_rms_nm(result: Reconstruction, height_mm: np.ndarray, terms: str) -> float:
    return rms(remove_terms(result.x_mm, result.y_mm, height_mm, result.mask, terms), result.mask) / NM


def model_of(result: Reconstruction) -> Scene:
    return refinement.modelled(result, refinement.zernike_fit(result))


def error_nm(result: Reconstruction, scene: Scene, terms: str = "piston_tilt_power") -> float:
    return height_rms_nm(result, result.deviation_mm - truth_mm(result, scene), terms)


@pytest.fixture(scope="module")
def small():
    """Scene, images, and the `fine` measurement of 393 pixels of 43 mm: 0.8 nm of error, by averaging over pixels."""
    scene = small_scene("sphere-deviated", 25)
    stack = images_of(scene)
    return scene, stack, measure_by("fine", stack, scene.nominal())


@pytest.fixture(scope="module")
def refined(small):
    _, stack, before = small
    return refine(before, stack)


# --- what it takes away -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("light_curve", "method"),
    [
        ("centroid", "southwell"),
        ("chord", "southwell"),
        ("centroid", "cubic"),
        ("chord", "spline"),
        pytest.param("chord", "modal", marks=pytest.mark.slow),
    ],
)
def test_sampling_averaging_and_integration_errors_all_go(small, light_curve, method):
    """From the paper's measurement (10 nm) and from better ones, to the same surface."""
    scene, stack, _ = small
    before = reconstruct(stack, scene.nominal(), light_curve=light_curve, method=method)
    after = refine(before, stack)
    assert error_nm(before, scene) > 3  # nm: pixels of 43 mm average over a deviation with features of 100 mm
    assert error_nm(after, scene) < TOLERANCE_NM  # what a further round would change, all else is taken away


def test_what_is_left_is_the_power_of_a_piston_that_no_slope_tells(small, refined):
    """Deviation is measured with mean zero. Were its mean d, the sphere would be flatter by d, a power of rms
    d (D / 2 R)^2 / (4 sqrt 3)."""
    scene, _, _ = small
    mirror = scene.mirror
    mean_nm = np.mean(truth_mm(refined, scene)[refined.mask]) / NM
    power = abs(mean_nm) * (mirror.diameter_mm / 2 / mirror.radius_mm) ** 2 / (4 * np.sqrt(3))
    assert power > 2 * TOLERANCE_NM
    # r^2 of the mask's nodes, 4 % inside the rim, for that of the disk; the paraxial formula
    assert error_nm(refined, scene, "piston_tilt") == pytest.approx(power, rel=0.1)


def test_slopes_and_heights_are_those_of_one_surface(small, refined):
    scene, _, before = small
    true_slopes = Surface.of(scene.mirror).gradient(refined.x_mm, refined.y_mm)
    for found, fine, true in zip(
        (refined.slope_x, refined.slope_y), (before.slope_x, before.slope_y), true_slopes, strict=True
    ):
        assert rms(fine - true, refined.mask) > 1e-8  # rad: averaging over pixels, to the fourth order
        assert rms(found - true, refined.mask) < 1e-10  # rad: the power that the piston leaves is 5e-11 at the rim
        np.testing.assert_array_equal(np.isfinite(found), refined.mask)
    design = Surface.of(scene.nominal().mirror)
    np.testing.assert_array_equal(refined.height_mm, design.sag(refined.x_mm, refined.y_mm) + refined.deviation_mm)
    assert abs(np.nanmean(refined.deviation_mm)) < 1e-6 * NM  # rounding of heights near 1 um
    for name in ("x_mm", "y_mm", "mask", "flags", "centroid_x_mm", "centroid_y_mm"):
        np.testing.assert_array_equal(getattr(refined, name), getattr(before, name), err_msg=name)


@pytest.mark.slow
def test_the_paper_s_sphere_comes_out_to_a_picometre():
    scene = load_scene("sphere-deviated")
    stack = images_of(scene)
    result = measure_by("refined", stack, scene.nominal())
    assert error_nm(measure_by("paper", stack, scene.nominal()), scene) > 1  # nm: sampling by lines
    assert error_nm(result, scene) < 1e-4  # nm: the last round's change is 5e-5
    assert error_nm(result, scene, "piston_tilt") < 1e-3  # nm: the power of a piston of 0.3 nm


def test_an_off_axis_segment_is_refined_with_the_same_zernikes():
    scene = load_scene("off-axis")
    camera = dataclasses.replace(  # its own small pixels, on a smaller mirror: large pixels' light is large
        scene.camera, detector=Detector(pixels=(25, 25), pitch_mm=scene.camera.detector.pitch_mm)
    )
    scene = dataclasses.replace(scene, camera=camera)
    scene = with_zernikes(scene, {noll: um / 10 for noll, um in PRESET.items()} | {29: 0.01}, diameter_mm=200.0)
    stack = images_of(scene)
    before = reconstruct(stack, scene.nominal())
    after = refine(before, stack)
    assert before.pixels_used > 280  # order 7 and all terms of the scene are in the model
    assert error_nm(before, scene) > 1  # nm: 15 pixels across hardly tell a term of order 7
    assert error_nm(after, scene, "piston_tilt") < TOLERANCE_NM  # a smaller mirror shows 30 times less of a piston


def test_images_by_rays_say_the_same_within_their_noise(device, small):
    """An independent road: a device traces the true mirror, and only the model is in closed form."""
    scene, _, before = small
    run = trace(scene, device=device, estimator="adjoint", smoothing=True, sampler="sobol", rays_per_pixel=16384)
    stack = run.images(LineScan(scene))
    fine = measure_by("fine", stack, scene.nominal())
    result = refine(fine, stack)
    stated = rms(result.height_standard_error_mm(), result.mask) / NM
    assert stated < 0.1 * error_nm(before, scene, "piston_tilt")  # else there was nothing to see
    assert error_nm(fine, scene, "piston_tilt") > 10 * stated
    # one run's ratio scatters by 9 % (the noise is in few low orders): 4 sigma, chance 6e-5
    assert error_nm(result, scene, "piston_tilt") == pytest.approx(stated, rel=0.36)


def test_a_thresholds_cut_is_undone(small):
    """Refinement takes the light curves whole, whatever the measurement before it cut off."""
    scene, stack, _ = small
    before = measure_by("fine", stack, scene.nominal(), threshold=0.1)
    assert error_nm(before, scene) > 2  # nm; 2.5 measured
    assert error_nm(refine(before, stack), scene) < TOLERANCE_NM


def test_what_is_finer_than_the_model_is_no_worse_than_before(small):
    """Noll 300 is of radial order 23, the model of 20: only the correction at the pixels' centres helps there."""
    scene = small_scene("sphere-deviated", 41)
    terms = ZernikeTerms(532.0, "noll", {6: 0.3, 300: 0.01})
    scene = dataclasses.replace(scene, mirror=dataclasses.replace(scene.mirror, zernike=(terms,)))
    stack = images_of(scene)
    before = measure_by("fine", stack, scene.nominal())
    assert error_nm(refine(before, stack), scene) < 1.5 * error_nm(before, scene)  # 1.3 measured, 2.2 without


def test_a_pixel_that_the_model_has_no_light_for_keeps_its_slopes(small, monkeypatch):
    scene, stack, _ = small
    pixel = (12, 15)
    wrong = _changed(stack, pixel, lambda flux: np.roll(flux, 1, -1))  # a slope that no smooth model has
    before = reconstruct(wrong, scene.nominal(), method="cubic")
    valid = refinement.PixelLight.valid
    monkeypatch.setattr(
        refinement.PixelLight, "valid", lambda light: valid(light) & (light.pixels != pixel[0] * 25 + pixel[1])
    )
    after = refine(before, wrong)
    for name in ("slope_x", "slope_y"):
        assert getattr(after, name)[pixel] == pytest.approx(getattr(before, name)[pixel], abs=1e-12)  # rad: rounding


# --- rounds -------------------------------------------------------------------------------------------------


def test_a_refinement_says_whether_it_has_converged(small):
    _, stack, before = small
    assert before.converged is None
    once, through = refine(before, stack, rounds=1), refine(before, stack)
    assert once.updates_nm[-1] > TOLERANCE_NM and once.converged is False
    assert through.updates_nm[-1] < TOLERANCE_NM and through.converged is True


def test_updates_fall_from_round_to_round(small):
    scene, stack, _ = small
    result = refine(reconstruct(stack, scene.nominal()), stack, rounds=6, tolerance_nm=1e-6)
    updates = np.array(result.updates_nm)
    assert len(updates) == 6 and updates[0] > 3
    assert (updates[1:] < updates[:-1] / 5).all()  # Gauss-Newton; the second differences are a tenth of the first


def test_an_update_is_the_change_of_its_round(small, refined):
    _, stack, before = small
    one = refine(before, stack, rounds=1)
    change = height_rms_nm(before, one.deviation_mm - before.deviation_mm, "piston_tilt")
    assert one.updates_nm == pytest.approx((change,), rel=1e-9)  # rounding
    np.testing.assert_allclose(one.updates_nm, refined.updates_nm[:1], rtol=1e-9)  # rounding


@pytest.mark.parametrize("tolerance_nm", [1.0, 0.1, 0.01, 1e-3])
def test_it_stops_at_the_first_round_within_tolerance(small, tolerance_nm):
    _, stack, before = small
    updates = refine(before, stack, rounds=9, tolerance_nm=tolerance_nm).updates_nm
    assert updates[-1] < tolerance_nm and all(update >= tolerance_nm for update in updates[:-1])
    assert len(updates) <= 4


def test_it_stops_after_the_rounds_it_is_given(small):
    _, stack, before = small
    assert refine(before, stack, rounds=0) is before
    two = refine(before, stack, rounds=2, tolerance_nm=0.0)
    assert len(two.updates_nm) == 2
    more = refine(two, stack, rounds=1, tolerance_nm=0.0)
    assert more.updates_nm[:2] == two.updates_nm and len(more.updates_nm) == 3  # the whole story is kept


# --- what it may know ---------------------------------------------------------------------------------------


def test_only_the_images_and_the_design_are_known(small, refined):
    scene, stack, _ = small
    claimed = with_zernikes(scene, {4: 3.0, 7: -1.0})
    again = measure_by("refined", stack, claimed.nominal())
    for name in ("slope_x", "slope_y", "height_mm", "deviation_mm"):
        np.testing.assert_array_equal(getattr(again, name), getattr(refined, name), err_msg=name)
    assert refined.nominal == scene.nominal()  # the model is not taken for the design


def test_the_model_is_the_measured_deviation(small):
    """Of a result that is the truth, the model has the truth's coefficients."""
    scene, _, before = small
    exact = dataclasses.replace(before, deviation_mm=np.where(before.mask, truth_mm(before, scene), np.nan))
    (given,), (found,) = scene.mirror.zernike, model_of(exact).mirror.zernike
    for noll, um in found.coefficients_um.items():
        assert um == pytest.approx(given.coefficients_um.get(noll, 0.0), abs=1e-9)  # um: rounding of the fit
    design = dataclasses.replace(model_of(exact), mirror=scene.nominal().mirror)
    assert design == scene.nominal()  # but for the deviation it is the nominal scene


# --- the model's order --------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 2, 3, 5, 8, MODEL_ORDER])
def test_few_pixels_lower_the_model_s_order(order):
    """As many terms as have PIXELS_PER_TERM pixels each, at most MODEL_ORDER, at least piston and tilt."""
    terms = (order + 1) * (order + 2) // 2
    lower = max(order * (order + 1) // 2, 3)
    enough = terms * PIXELS_PER_TERM
    assert [_terms(_flat(pixels)) for pixels in (enough - 1, enough)] == [lower, terms]


def test_many_pixels_do_not_raise_it_without_end(monkeypatch):
    monkeypatch.setattr(refinement, "MODEL_ORDER", 3)
    assert _terms(_flat(1000)) == 10


def _terms(result: Reconstruction) -> int:
    return len(model_of(result).mirror.zernike[0].coefficients_um)


def _flat(pixels: int) -> Reconstruction:
    """A measured flat deviation on so many pixels, anywhere on the mirror."""
    scene = small_scene("sphere")
    x_mm, y_mm = np.random.default_rng(4).uniform(-300, 300, (2, 1, pixels))
    zero, no = np.zeros((1, pixels)), np.zeros((0, 1, pixels))
    yes, flags = np.ones((1, pixels), bool), np.zeros((1, pixels), int)
    return Reconstruction(
        Setup(scene), "chord", "cubic", False, x_mm, y_mm, yes, yes, flags, *[zero] * 6, *[no] * 3
    )  # fmt: skip


def test_a_few_pixels_are_refined_without_harm():
    """Nine pixels, three terms: the model is a tilted plane, and what it lacks is left to the differences."""
    scene = small_scene("sphere-deviated", 5)
    stack = images_of(scene)
    before = reconstruct(stack, scene.nominal())
    after = refine(before, stack)
    assert before.pixels_used == 9 and _terms(after) == 3
    assert after.updates_nm[-1] < TOLERANCE_NM  # it converges
    assert error_nm(after, scene) < 1.2 * error_nm(before, scene)  # it cannot know better


def test_the_model_s_order_says_what_is_freed_from_averaging(small, monkeypatch):
    """The deviation has terms up to order 8. A model without the highest leaves them averaged over the pixels."""
    scene, stack, _ = small
    for order, below_nm, above_nm in ((8, TOLERANCE_NM, 0.0), (6, 10.0, 1.0)):
        monkeypatch.setattr(refinement, "MODEL_ORDER", order)
        left = error_nm(refine(reconstruct(stack, scene.nominal()), stack), scene)
        assert above_nm < left < below_nm  # nm: as above; 1/24 of the second differences of 60 nm of order 8


def test_structure_finer_than_the_model_is_kept(monkeypatch):
    """A term that the model has no room for comes out by the differences alone, averaged over the pixels."""
    scene = with_zernikes(small_scene("sphere-deviated", 41), PRESET | {37: 0.03})  # order 8
    stack = images_of(scene)
    monkeypatch.setattr(refinement, "MODEL_ORDER", 5)
    result = refine(reconstruct(stack, scene.nominal(), method="cubic"), stack)
    assert _terms(result) == 21  # of 45 up to order 8
    # nm, of 30: pixels of 29 mm average 1/24 of the second differences away, (29 mm x 8 / 532 mm)^2 / 24 and less
    assert error_nm(result, scene) < 0.1 * 30


# --- noise --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def noisy(small):
    """Four measurements of 8 replicates with 1 % of noise in each sample: (before, after) refinement."""
    scene, stack, _ = small
    pairs = []
    for seed in range(4):
        exposed = with_replicates(stack, 8, 0.01, seed)
        before = measure_by("fine", exposed, scene.nominal())
        pairs.append((before, refine(before, exposed)))
    return pairs


def test_error_bars_survive_and_are_the_scatter_of_repeated_measurements(noisy, refined):
    actual, stated = [], []
    for _, after in noisy:
        assert after.jackknife_deviation_mm.shape == after.jackknife_slope_x.shape == (8, 25, 25)
        error = after.deviation_mm - refined.deviation_mm
        actual.append(height_rms_nm(after, error, "piston_tilt") ** 2)
        stated.append((rms(after.height_standard_error_mm(), after.mask) / NM) ** 2)
    # one run's ratio scatters by 9 %: 4 sigma of the ratio of four, chance 6e-5
    assert np.sqrt(np.mean(stated) / np.mean(actual)) == pytest.approx(1, abs=4 * 0.09 / np.sqrt(4))


def test_noise_is_not_amplified(noisy):
    """The same noise in before and after, so their ratio has no scatter of its own."""
    for before, after in noisy:
        bars = [rms(result.height_standard_error_mm(), result.mask) for result in (before, after)]
        assert 0.85 < bars[1] / bars[0] < 1.02  # taking averages away amplifies noise by 7 % here, a model does not


def test_a_replicate_left_out_is_the_measurement_without_it(small, noisy):
    scene, stack, _ = small
    exposed, (_, after) = with_replicates(stack, 8, 0.01, 0), noisy[0]
    without = ImageStack(
        *(dataclasses.replace(s, flux_w=s.flux_w[1:], weights=s.weights[1:]) for s in (exposed.x, exposed.y))
    )
    own = measure_by("refined", without, scene.nominal())
    difference = height_rms_nm(own, own.deviation_mm - after.jackknife_deviation_mm[0], "piston_tilt")
    spread = height_rms_nm(own, after.deviation_mm - after.jackknife_deviation_mm[0], "piston_tilt")
    # one model for all replicates: what it frees from averaging differs by the noise in the model
    assert 0 < difference < 0.3 * spread


def test_a_single_replicate_has_no_error_bar(refined):
    assert refined.jackknife_deviation_mm.shape == (0, 25, 25)
    assert np.isnan(refined.height_standard_error_mm()).all()


# --- pixels that cannot be used -----------------------------------------------------------------------------


def _changed(stack: ImageStack, pixel: tuple[int, int], change) -> ImageStack:
    """The stack with change(curve [window]) in place of one pixel's x light curve."""

    def scan_of(scan: Scan) -> Scan:
        flux, k = scan.flux_w.copy(), np.flatnonzero(scan.pixels == pixel[0] * scan.shape[1] + pixel[1])[0]
        flux[:, k] = change(flux[:, k])
        return dataclasses.replace(scan, flux_w=flux)

    return ImageStack(scan_of(stack.x), stack.y)


def test_a_dead_and_a_saturated_pixel_are_left_out_and_the_others_refined(small, refined):
    scene, stack, _ = small
    dead, hot = (12, 15), (8, 9)
    peak = max(scan.flux_w.max() for scan in (stack.x, stack.y))
    broken = _changed(_changed(stack, dead, lambda flux: 0 * flux), hot, lambda flux: flux + 2 * peak)
    broken = broken.saturating_at(1.5 * peak)
    result = measure_by("refined", broken, scene.nominal())
    assert result.flags[dead] == Flag.EMPTY and result.flags[hot] == Flag.SATURATED
    assert not result.mask[dead] and not result.mask[hot] and result.pixels_used == refined.pixels_used - 2
    assert np.isnan(result.deviation_mm[dead]) and np.isnan(result.slope_x[hot])
    assert error_nm(result, scene) < TOLERANCE_NM  # as with all pixels


def test_a_pixel_with_a_wrong_light_curve_stays_where_it_is(small, refined):
    """A light curve moved by half a line: the model does not have it, its neighbours hardly mind."""
    scene, stack, _ = small
    pixel = (12, 15)
    wrong = _changed(stack, pixel, lambda flux: (flux + np.roll(flux, 1, -1)) / 2)
    result = measure_by("refined", wrong, scene.nominal())
    moved = result.slope_x[pixel] - refined.slope_x[pixel]
    # half a line of 0.2 mm over twice the distance to the screen, towards lower slopes; the model takes up a few %,
    # and taking averages over pixels away would raise a lone value by 4 / 24
    assert moved == pytest.approx(-0.1 / (2 * 4166.747), rel=0.25)
    assert result.updates_nm[-1] < result.updates_nm[0]
    far = result.mask.copy()
    far[pixel[0] - 3 : pixel[0] + 4, pixel[1] - 3 : pixel[1] + 4] = False
    slopes = result.slope_x - refined.slope_x
    assert rms(slopes, far) < abs(moved) / 50  # one of 393 pixels


@pytest.mark.parametrize(("half_gap", "groups"), [(0, 1), (6, 2)])
def test_parts_of_a_mirror_are_refined_with_pistons_of_their_own(half_gap, groups):
    """Unknown pistons must not look like a step to the model: that would tilt it by microradians."""
    scene = small_scene()
    dark = np.abs(np.arange(41 * 41) % 41 - 20) <= half_gap
    whole = images_of(scene)
    scans = []
    for scan in (whole.x, whole.y):
        scans.append(dataclasses.replace(scan, flux_w=np.where(dark[scan.pixels, None], 0.0, scan.flux_w)))
    stack = ImageStack(*scans)
    result = measure_by("refined", stack, scene.nominal())
    assert result.islands.count == 2 and result.islands.groups == groups
    left = result.levelled(result.deviation_mm - truth_mm(result, scene))
    assert rms(left, result.mask) < 0.1 * NM
    for group in range(1, groups + 1):
        assert abs(np.mean(result.deviation_mm[result.islands.group_map == group])) < 1e-15  # mm
    assert result.updates_nm[-1] < 0.1
