"""The measuring half on images without noise, made on the host: what it finds, what it refuses."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from synthetic import noise_free_stack, small_scene, with_replicates

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.maths.integration import integrate_slopes, node_graph
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement import surface_heights
from irtscots_cl.measurement.light_curves import Flag
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.mirror import ZernikeTerms

NM, URAD = 1e-6, 1e-6  # in mm, in rad


@pytest.fixture(scope="module")
def deviated():
    scene = small_scene("sphere-deviated")
    return scene, noise_free_stack(scene), reconstruct(noise_free_stack(scene), scene.nominal())


def slope_errors(result, scene):
    truth = Surface.of(scene.mirror).gradient(result.x_mm, result.y_mm)
    return [rms(found - true, result.mask) for found, true in zip((result.slope_x, result.slope_y), truth, strict=True)]


def height_error(result, scene, terms="piston_tilt"):
    truth = Surface.of(scene.mirror).deviation_at(result.x_mm, result.y_mm)[0]
    return rms(remove_terms(result.x_mm, result.y_mm, result.deviation_mm - truth, result.mask, terms), result.mask)


def refused(result):
    """Light curves that were refused, without the reasons that none had."""
    return {reason: count for reason, count in result.refused().items() if count}


def changed(stack, change_x, change_y=None):
    """The stack with change_x(flux) and change_y(flux) in place of its flux."""
    scans = (stack.x, change_x), (stack.y, change_y or change_x)
    return ImageStack(*(dataclasses.replace(scan, flux_w=change(scan.flux_w.copy())) for scan, change in scans))


def test_an_ideal_sphere_is_found_ideal():
    scene = small_scene("sphere")
    result = reconstruct(noise_free_stack(scene), scene)
    assert (
        max(slope_errors(result, scene)) < 0.05 * URAD  # 4 x 4 rays tell a rim pixel's footprint to 1/8 only
    )
    assert height_error(result, scene, "piston") < 0.5 * NM  # the same; with 16 x 16 rays 0.08 nm are left


def test_the_deviation_is_found(deviated):
    scene, _, result = deviated
    surface, x, y = Surface.of(scene.mirror), result.x_mm, result.y_mm
    assert max(slope_errors(result, scene)) < 0.05 * URAD  # as on the ideal sphere; pixels average over 29 mm
    height, slope_x, slope_y = surface.deviation_at(x, y)
    by_trapezoids = integrate_slopes(x, y, slope_x, slope_y, result.mask)
    error = remove_terms(x, y, result.deviation_mm - by_trapezoids, result.mask, "piston_tilt")
    assert rms(error, result.mask) < 2 * NM  # the slopes' error, smooth, over 1 m
    assert height_error(result, scene) < 5 * NM  # the trapezoids' own at 29 mm; 0.4 nm at 9.6 mm
    assert 350 * NM < rms(height, result.mask) < 420 * NM  # there was something to find


def test_the_result_hangs_together(deviated):
    scene, _, result = deviated
    design = Surface.of(scene.nominal().mirror)
    np.testing.assert_array_equal(result.mask, result.on_mirror)
    for name in (
        "x_mm",
        "y_mm",
        "centroid_x_mm",
        "centroid_y_mm",
        "slope_x",
        "slope_y",
        "height_mm",
        "deviation_mm",
    ):
        np.testing.assert_array_equal(np.isfinite(getattr(result, name)), result.mask, err_msg=name)
    np.testing.assert_array_equal(result.height_mm, design.sag(result.x_mm, result.y_mm) + result.deviation_mm)
    assert abs(np.nanmean(result.deviation_mm)) < 1e-6 * NM  # rounding of heights near 1 um
    assert result.jackknife_slope_x.shape == (0, 41, 41)
    assert np.isnan(result.height_standard_error_mm()).all()
    assert (result.pixels_used, refused(result)) == (int(result.mask.sum()), {})
    assert list(result.refused()) == ["empty", "clipped", "stray", "saturated", "masked"]


def test_axes_and_signs(deviated):
    """Columns grow with the mirror's x, rows with its y; slopes are of the surface that rises to its rim."""
    _, _, result = deviated
    row, column = result.mask.shape[0] // 2, result.mask.shape[1] // 2
    assert (np.diff(result.x_mm[row][result.mask[row]]) > 0).all()
    assert (np.diff(result.y_mm[:, column][result.mask[:, column]]) > 0).all()
    assert result.slope_x[row, column + 10] > 0.05 and result.slope_x[row, column - 10] < -0.05
    assert result.slope_y[row + 10, column] > 0.05 and result.slope_y[row - 10, column] < -0.05


def test_two_rounds_of_height_are_needed_and_enough(deviated, monkeypatch):
    scene, stack, result = deviated
    found = {}
    for rounds in (1, 3):
        monkeypatch.setattr(surface_heights, "HEIGHT_ROUNDS", rounds)
        found[rounds] = reconstruct(stack, scene.nominal()).deviation_mm
    assert np.nanmax(np.abs(found[3] - result.deviation_mm)) < 0.01 * NM  # as HEIGHT_ROUNDS says
    assert np.nanmax(np.abs(found[1] - result.deviation_mm)) > 1 * NM  # Eq. 3 contains the height


def test_a_mirror_that_leans_has_its_shape():
    """A flat one by 0.2 mrad, of whose wide light a pixel then sees another part: power and astigmatism of 170 nm where
    that is not heeded. The piston, which no slope tells, leaves 7 nm."""
    design = small_scene("./examples/flat.toml")
    flat = dataclasses.replace(design, mirror=dataclasses.replace(design.mirror, zernike=()))
    tilt = ZernikeTerms(radius_mm=150.0, ordering="noll", coefficients_um={2: 15.0})
    leaning = dataclasses.replace(flat, mirror=dataclasses.replace(flat.mirror, zernike=(tilt,)))
    own, result = (reconstruct(noise_free_stack(scene), flat) for scene in (flat, leaning))
    shape = remove_terms(result.x_mm, result.y_mm, result.deviation_mm - own.deviation_mm, result.mask, "piston_tilt")
    assert rms(shape, result.mask) < 15 * NM


def test_only_the_design_is_known(deviated):
    scene, stack, result = deviated
    other = ZernikeTerms(radius_mm=600.0, ordering="fringe", coefficients_um={4: 3.0})
    other = dataclasses.replace(scene, mirror=dataclasses.replace(scene.mirror, zernike=(other,)))
    again = reconstruct(stack, other.nominal())
    for name in ("slope_x", "slope_y", "height_mm", "deviation_mm"):
        np.testing.assert_array_equal(getattr(again, name), getattr(result, name))
    assert again.nominal.mirror.zernike == ()


def test_a_dead_pixel_is_empty_and_its_neighbours_do_not_mind(deviated):
    scene, stack, result = deviated
    dead = (15, 22)

    def kill(flux):
        flux[:, dead[0] * 41 + dead[1]] = 0.0
        return flux

    without = reconstruct(changed(stack, lambda flux: flux, kill), scene.nominal())
    assert without.flags[dead] == Flag.EMPTY and not without.mask[dead] and without.on_mirror[dead]
    assert without.pixels_used == result.pixels_used - 1 and refused(without) == {"empty": 1}
    others = without.mask
    np.testing.assert_allclose(
        without.slope_x[others],
        result.slope_x[others],
        atol=1e-4 * URAD,  # through the heights
    )
    assert (
        rms(without.deviation_mm - result.deviation_mm, others) < 1 * NM  # one of about 1000 nodes; its mean
    )


ROW, COLUMN = np.mgrid[:41, :41]
DARK = {
    "cross": (ROW == 20) | (COLUMN == 20),
    "ring": np.abs(np.hypot(ROW - 20, COLUMN - 20) - 10) < 1,
    "30 % dead": np.random.default_rng(3).random((41, 41)) < 0.3,
    "50 % dead": np.random.default_rng(3).random((41, 41)) < 0.5,
}


def darkened(stack, dark):
    return changed(stack, lambda flux: np.where(dark.ravel()[None, :, None], 0.0, flux))


@pytest.mark.parametrize("name", DARK)
def test_parts_of_a_mirror_are_joined(deviated, name):
    scene, stack, clean = deviated
    result = reconstruct(darkened(stack, DARK[name]), scene.nominal())
    assert result.islands.groups == 1 < result.islands.count
    assert np.array_equal(result.height_mask, result.mask)
    assert height_error(result, scene) < height_error(clean, scene) + 0.5 * NM  # seen: 0.2 nm more at most
    assert abs(np.nanmean(result.deviation_mm)) < 1e-15  # mm


def test_parts_too_far_from_each_other_have_heights_of_their_own(deviated):
    scene, stack, _ = deviated
    result = reconstruct(darkened(with_replicates(stack, 4, 0.01), np.abs(COLUMN - 20) <= 8), scene.nominal())
    assert (result.islands.count, result.islands.groups) == (2, 2)
    assert result.height_mask.sum() < result.pixels_used == result.mask.sum()
    assert max(slope_errors(result, scene)) < 0.5 * URAD
    error = result.height_standard_error_mm()
    assert np.array_equal(np.isfinite(error), result.height_mask)
    truth = Surface.of(scene.mirror).deviation_at(result.x_mm, result.y_mm)[0]
    left = result.levelled(result.deviation_mm - truth)
    assert rms(left, result.mask) < 10 * NM  # both parts, each with its own piston; 100 nm of noise without
    assert np.array_equal(np.isfinite(left), result.mask)


def test_what_joining_may_have_wrong_is_part_of_the_standard_error(deviated):
    scene, stack, _ = deviated
    result = reconstruct(darkened(with_replicates(stack, 4, 1e-6), np.abs(COLUMN - 20) <= 1), scene.nominal())
    assert (result.islands.count, result.islands.groups) == (2, 1)
    alone = dataclasses.replace(result, islands=None).height_standard_error_mm()
    both = result.height_standard_error_mm()
    assert rms(both, result.mask) > 10 * rms(alone, result.mask)
    assert rms(both, result.mask) < result.islands.error_mm[1] < 20 * NM


def test_images_read_the_wrong_way_round_have_slopes_of_no_surface(deviated):
    scene, stack, right = deviated
    assert not right.misfit().suspicious and right.misfit().slope < 0.05 * URAD
    flip = lambda flux: flux.reshape(*flux.shape[:1], 41, 41, -1)[:, ::-1].reshape(flux.shape)  # noqa: E731
    turned = lambda flux: flux.reshape(*flux.shape[:1], 41, 41, -1).swapaxes(1, 2).reshape(flux.shape)  # noqa: E731
    exchanged = ImageStack(
        dataclasses.replace(stack.x, flux_w=stack.y.flux_w), dataclasses.replace(stack.y, flux_w=stack.x.flux_w)
    )
    for name, wrong in (
        ("rows upside down", changed(stack, flip)),
        ("one scan upside down", changed(stack, flip, lambda flux: flux)),
        ("transposed", changed(stack, turned)),
        ("exchanged", exchanged),
    ):
        found = reconstruct(wrong, scene.nominal()).misfit()
        print(name, found.slope / URAD, found.limit / URAD)
        assert found.slope > 20 * right.misfit().slope
        assert found.suspicious or name == "rows upside down"  # those slopes are nearly a surface's


def test_noise_is_expected_to_leave_a_misfit(deviated):
    scene, stack, right = deviated
    noisy = reconstruct(with_replicates(stack, 8, 0.01), scene.nominal()).misfit()
    assert noisy.slope > 5 * right.misfit().slope
    assert noisy.slope == pytest.approx(noisy.expected, rel=0.15)  # the jackknife of 8: 4 % of the mean of 1000 pixels
    assert not noisy.suspicious


def test_a_pixel_that_one_replicate_alone_saw_has_no_error_bar_and_counts_as_empty(deviated):
    scene, stack, result = deviated
    pixel = (15, 22)

    def only_first(flux):
        flux[1:, pixel[0] * 41 + pixel[1]] = 0.0
        return flux

    found = reconstruct(changed(with_replicates(stack, 3, 0.0), only_first), scene.nominal())
    assert found.flags[pixel] == Flag.EMPTY and not found.mask[pixel]
    assert found.pixels_used == result.pixels_used - 1 and refused(found) == {"empty": 1}


@pytest.mark.parametrize("screen", [(13, 21), (21, 13)])
def test_pixels_whose_light_reaches_past_the_screen_are_left_out(screen):
    scene = small_scene("sphere-deviated")
    scene = dataclasses.replace(scene, screen=dataclasses.replace(scene.screen, pixels=screen))
    result = reconstruct(noise_free_stack(scene), scene.nominal())
    refused = result.refused()
    assert refused["clipped"] > 100 and result.pixels_used > 500  # the spot is 2.9 mm, the screen 2.6 mm
    assert result.pixels_used + refused["clipped"] + refused["empty"] == result.on_mirror.sum()
    assert (result.flags[result.on_mirror & ~result.mask] == Flag.CLIPPED).all()
    assert max(slope_errors(result, scene)) < 0.05 * URAD  # as without clipping: what is left is whole
    # the short screen cuts the light of pixels at the mirror's edge in that direction
    cut = np.where(result.on_mirror & ~result.mask)
    middle = result.mask.shape[0] // 2
    assert np.abs(cut[1 if screen[0] < screen[1] else 0] - middle).min() > 3


def test_min_coverage_says_which_rim_pixels_are_used(deviated):
    scene, stack, result = deviated
    coverage = ChiefRays(scene.nominal()).footprint.coverage
    for least in (0.05, 0.5, 1.0):
        found = reconstruct(stack, scene.nominal(), min_coverage=least)
        np.testing.assert_array_equal(found.on_mirror, coverage >= least)
    assert result.pixels_used == (coverage >= 0.5).sum()  # the default


def test_a_threshold_takes_a_background_away(deviated):
    scene, stack, _ = deviated
    bright = changed(stack, lambda flux: flux + 0.01 * flux.max())
    assert min(slope_errors(reconstruct(bright, scene.nominal()), scene)) > 1 * URAD
    found = reconstruct(bright, scene.nominal(), threshold=0.05)
    assert max(slope_errors(found, scene)) < 0.5 * URAD  # the feet below the threshold are cut off


def test_the_jackknife_s_height_error_is_the_scatter_of_repeated_measurements(deviated):
    scene, stack, result = deviated
    actual, stated = [], []
    for seed in range(6):
        noisy = reconstruct(with_replicates(stack, 8, 0.01, seed), scene.nominal())
        assert noisy.jackknife_deviation_mm.shape == (8, 41, 41)
        error = noisy.deviation_mm - result.deviation_mm
        error = remove_terms(result.x_mm, result.y_mm, error, result.mask, "piston_tilt")
        actual.append(rms(error, result.mask) ** 2)
        stated.append(rms(noisy.height_standard_error_mm(), result.mask) ** 2)
    # one run's rms scatters by 8 %, the stated one by 4 %: 4 sigma of the ratio of six, chance 6e-5
    assert np.sqrt(np.mean(stated) / np.mean(actual)) == pytest.approx(1, abs=4 * np.hypot(0.08, 0.04) / np.sqrt(6))


@pytest.mark.parametrize("method", ["southwell", "cubic"])
def test_maps_by_iteration_one_by_one_are_those_of_the_factor(deviated, method, monkeypatch):
    scene, stack, _ = deviated
    stack = with_replicates(stack, 4, 0.01)
    direct = reconstruct(stack, scene.nominal(), method=method)
    monkeypatch.setattr(node_graph, "_DIRECT_NODES", 0)
    monkeypatch.setattr(surface_heights, "MANY_VALUES", 1)
    found = reconstruct(stack, scene.nominal(), method=method)
    np.testing.assert_allclose(found.deviation_mm, direct.deviation_mm, rtol=0, atol=1e-5 * NM)
    error = direct.height_standard_error_mm()
    np.testing.assert_allclose(
        found.height_standard_error_mm(), error, rtol=1e-4
    )  # residuals of 1e-7, smooth parts more


def test_replicates_of_one_measurement_have_its_result(deviated):
    scene, stack, result = deviated
    same = reconstruct(with_replicates(stack, 3, 0.0), scene.nominal())
    np.testing.assert_allclose(same.deviation_mm, result.deviation_mm, atol=1e-6 * NM)  # rounding of the mean
    assert np.nanmax(same.height_standard_error_mm()) < 1e-6 * NM  # the same


@pytest.mark.parametrize(
    ("stack_of", "message"),
    [
        (
            lambda s: ImageStack(_cut(s.x, rows=40), s.y),
            r"images of \(40, 41\) and \(41, 41\) .* do not fit; must be of the scene's detector, \(41, 41\)",
        ),
        (
            lambda s: ImageStack(_cut(s.x, lines=20), s.y),
            "20 images in the x scan, but the scene's screen has 21 lines",
        ),
        (
            lambda s: ImageStack(s.x, _cut(s.y, lines=3)),
            "3 images in the y scan, but the scene's screen has 21 lines",
        ),
        (
            lambda s: changed(s, np.zeros_like),
            r"0 of the 1049 detector pixels on the mirror have a usable light curve in both scans \(1049 empty, ",
        ),
        (
            lambda s: changed(s, np.zeros_like, lambda f: f),
            r"0 of the 1049 detector pixels on the mirror have a usable light curve in both scans",
        ),
    ],
)
def test_what_cannot_be_measured_is_refused(deviated, stack_of, message):
    scene, stack, _ = deviated
    with pytest.raises(ValueError, match=message) as caught:
        reconstruct(stack_of(stack), scene.nominal())
    assert str(caught.value).isprintable()


def _cut(scan: Scan, lines: int = 21, rows: int = 41) -> Scan:
    images = np.stack([scan.image(line)[:rows] for line in range(lines)])
    return Scan.from_images(scan.axis, scan.positions_mm[:lines], images)
