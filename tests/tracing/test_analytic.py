"""The analytic estimator against many rays, its radiometry and its bookkeeping."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from lopsided import lopsided
from scenes import SEQUENTIAL, with_part
from scenes import scene_of as any_scene
from significance import sidak_z
from synthetic import small_scene
from tracers import setup_of

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.opencl.structs import Fate
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.pixel.ray_map import RAYS
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.estimators.analytic import window_edges_mm
from irtscots_cl.tracing.results.transport import LineLight
from irtscots_cl.tracing.trace import trace

FAILURE_CHANCE = 1e-6  # of all statistical statements of this file together
REAL_SET_UPS = ("narrow-real", "narrow-points")  # distorted, bent, under glass, with a small aperture as narrow()
OTHERS = (*REAL_SET_UPS, "narrow-asphere", "freeform")
STATEMENTS = 2 * 2 * (len(SEQUENTIAL) + len(OTHERS)) * 2  # scenes, kinds of rays, axes, tests
CHANCE = FAILURE_CHANCE / STATEMENTS
BIAS = 1e-5  # of a light curve's peak: what the closed form may differ by
SMOOTHED, PLAIN = (True, 2**15), (False, 2**16)  # smoothing, rays per pixel: 3e8 and 6e8 rays in all
REAL_SMOOTHED = (True, 2**13)  # real set-ups have more pixels
REPLICATES = 8


def narrow():
    """The lopsided scene with an aperture so small that its rim is sharp enough for the closed form.

    Its light has reflectance, transmittance and a hole in its way, and a part of it falls beside the screen.
    """
    return with_part(lopsided(), "camera", aperture_diameter_mm=1.0)


def scene_of(name):
    if name == "narrow-asphere":  # its f/2 mirror bends light more than to second order over 2 mm
        return with_part(any_scene("asphere"), "camera", aperture_diameter_mm=1.0)
    return narrow() if name == "narrow" else any_scene(name)


@cache
def analytic(name) -> LineLight:
    return trace(scene_of(name), estimator="analytic")


# --- against rays ------------------------------------------------------------------------------------------


@cache
def differences(name, smoothing, rays, device):
    """{axis: (rows, columns, offsets from the light curve's peak, differences, variances)} of lit pixels' samples.

    Of pixels that see nothing but mirror; the mean of the rays less the closed form [n, window], and its variance from
    the scatter of the replicates, in the peak of the scene's brightest light curve.
    """
    exact = analytic(name)
    run = trace(
        scene_of(name), device=device, sampler="sobol", precision="fp64", smoothing=smoothing,
        rays_per_pixel=rays, replicates=REPLICATES, seed=4,
    )  # fmt: skip
    np.testing.assert_array_equal(run.windows.pixels, exact.windows.pixels)
    np.testing.assert_array_equal(run.windows.origins, exact.windows.origins)
    coverage = run_coverage(name)
    row, column = np.divmod(run.windows.pixels, scene_of(name).camera.detector.pixels[0])
    result = {}
    for axis in "xy":
        curve, of_rays = exact.line_flux_w(axis)[0], run.line_flux_w(axis)
        used = (coverage == 1) & (curve.sum(1) > 0)
        peak = curve.max()
        offset = np.arange(curve.shape[1]) - np.argmax(curve, axis=1)[:, None]
        difference = (of_rays.mean(0) - curve) / peak
        variance = of_rays.var(0, ddof=1) / REPLICATES / peak**2
        result[axis] = (row[used], column[used], offset[used], difference[used], variance[used])
    return result


def run_coverage(name):
    """Coverage of the pixels in the windows as counted by chief rays, without the closed form."""
    chief = setup_of(scene_of(name)).chief_rays
    return chief.footprint.coverage.ravel()[analytic(name).windows.pixels]


def mean_of(labels, difference, variance, least):
    """Mean difference and its standard error of the samples with equal labels, of labels with `least` samples.

    Pixels' rays are independent, so the variances of single samples add up; of many of them the mean is normal.
    """
    count = np.bincount(labels)
    enough = count >= least
    mean = np.bincount(labels, difference)[enough] / count[enough]
    return mean, np.sqrt(np.bincount(labels, variance)[enough]) / count[enough]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "smoothing", "rays"),
    [
        ("sphere-deviated", *PLAIN),
        *((name, *SMOOTHED) for name in (*SEQUENTIAL, "narrow-asphere", "freeform")),
        *((name, *REAL_SMOOTHED) for name in REAL_SET_UPS),
    ],
)
def test_light_curves_are_those_of_many_rays(device, name, smoothing, rays):
    """By place in the light curve, over all pixels: no line gets more or less light than it should."""
    if not device.has_fp64:
        pytest.skip("the device has no double precision")
    for _, _, offset, difference, variance in differences(name, smoothing, rays, device).values():
        mean, error = mean_of((offset - offset.min()).ravel(), difference.ravel(), variance.ravel(), 1000)
        limit = sidak_z(len(mean), CHANCE)
        assert len(mean) >= (3 if name in REAL_SET_UPS else 7)
        assert error.max() * limit < (2 if smoothing else 20) * BIAS  # so this tells something
        assert (np.abs(mean) < BIAS + limit * error).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", SEQUENTIAL)
def test_light_curves_are_those_of_many_rays_everywhere_on_the_detector(device, name):
    """In tiles of 20 x 20 pixels, and over all single samples together: unbiased estimates of the bias squared."""
    if not device.has_fp64:
        pytest.skip("the device has no double precision")
    for row, column, offset, difference, variance in differences(name, *SMOOTHED, device).values():
        tile = np.broadcast_to((row // 20 * 7 + column // 20)[:, None], offset.shape)
        label = tile * 64 + offset - offset.min()
        mean, error = mean_of(label.ravel(), difference.ravel(), variance.ravel(), 200)
        limit = sidak_z(len(mean), CHANCE)
        assert len(mean) > 100
        assert (np.abs(mean) < 2 * BIAS + limit * error).all()  # 2: the closed form is at its worst at the edges
        # the square of a mean of replicates less its variance is the bias squared, on average
        square = (difference**2 - variance).mean(1)
        scatter = square.std(ddof=1) / np.sqrt(len(square))
        assert square.mean() < BIAS**2 + sidak_z(1, CHANCE) * scatter  # pixels are independent, 9000 of them
        assert sidak_z(1, CHANCE) * scatter < (6 * BIAS) ** 2  # so this tells something


@pytest.mark.parametrize("name", ["narrow", "freeform", *REAL_SET_UPS])
def test_all_light_of_a_scene_is_that_of_its_rays(device, name):
    """Every factor of the flux, the hole, the dark pixels, of an asymmetric scene: pixels' whole flux."""
    exact = analytic(name)
    run = trace(
        scene_of(name), device=device, sampler="sobol", smoothing=True, rays_per_pixel=2**11, replicates=8, seed=3
    )
    np.testing.assert_array_equal(run.windows.pixels, exact.windows.pixels)
    for axis in "xy":
        curve, of_rays = exact.line_flux_w(axis)[0], run.line_flux_w(axis)
        lit = curve.sum(1) > 0
        assert lit.sum() > 3000
        ratio = of_rays[:, lit].sum((1, 2)) / curve[lit].sum()
        error = ratio.std(ddof=1) / np.sqrt(8)
        # 10 standard errors of eight replicates: Student's t with 7 degrees, failure chance 2e-5; 3e-6: cos^4
        assert abs(ratio.mean() - 1) < 10 * error + (3e-6 if name == "narrow" else BIAS)
        assert error < 1e-5  # the check means something
        profile = of_rays.mean(0)[lit] - curve[lit]
        assert np.sqrt(np.mean(profile**2)) < 3e-3 * curve.max()  # 1e-3: noise of 2048 rays, most of it at the rim


# --- radiometry --------------------------------------------------------------------------------------------


def test_absolute_flux_at_the_centre_of_the_paper_s_sphere():
    run = analytic("sphere")
    visible_pixel = np.flatnonzero(run.windows.pixels == 62 * 125 + 62)
    for axis in "xy":
        assert run.line_flux_w(axis)[0, visible_pixel].sum() == pytest.approx(4.168e-6, rel=1e-4)  # its digits


def test_radiance_reflectance_and_transmittance_scale_the_flux():
    plain = analytic("narrow")
    for part, changes, factor in [
        ("screen", {"radiance": 6.0}, 3.0),
        ("mirror", {"reflectance": 0.45}, 0.5),
        ("camera", {"transmittance": 0.2}, 0.25),
    ]:
        scaled = trace(with_part(narrow(), part, **changes), estimator="analytic")
        for axis in "xy":
            np.testing.assert_allclose(scaled.flux_w[axis], factor * plain.flux_w[axis], rtol=1e-14)  # rounding


@pytest.mark.parametrize("name", [*SEQUENTIAL, "narrow"])
def test_both_scans_get_all_of_a_pixel_s_light(name):
    run = analytic(name)
    x, y = (run.line_flux_w(axis)[0].sum(1) for axis in "xy")
    np.testing.assert_allclose(x, y, rtol=0, atol=4e-6 * x.max())  # 2.4e-6 of cut pixels: their cells differ
    assert all((run.flux_w[axis] >= 0).all() and np.isfinite(run.flux_w[axis]).all() for axis in "xy")


@pytest.mark.parametrize("name", ["sphere", "narrow"])
def test_windows_edges_are_those_of_the_lines(name):
    scene, run = scene_of(name), analytic(name)
    for k, axis in enumerate("xy"):
        edges = window_edges_mm(scene, run.windows, k)
        lines = run.windows.origins[:, k, None] + np.arange(edges.shape[1] - 1)
        middle = (edges[:, 1:] + edges[:, :-1]) / 2
        np.testing.assert_allclose(middle, LineScan(scene).positions_mm(axis)[lines], rtol=0, atol=1e-12)  # rounding
        np.testing.assert_allclose(np.diff(edges), scene.screen.pitch_mm, rtol=1e-12)  # the same


# --- bookkeeping -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*SEQUENTIAL, "narrow"])
def test_the_ledger_adds_up(name):
    run = analytic(name)
    ledger = dict(run.ledger)
    launched = ledger.pop("launched")
    assert launched == run.rays_total == RAYS * len(run.windows.pixels) and sum(ledger.values()) == launched
    assert set(ledger) == {fate.name.lower() for fate in Fate if fate != Fate.OFF_WINDOW}
    lit = run.flux_w["x"][0].sum(1) > 0
    assert ledger["detected"] == RAYS * lit.sum() > 0.95 * launched
    np.testing.assert_array_equal(lit, run.flux_w["y"][0].sum(1) > 0)
    dark = {"missed_mirror", "off_screen"}
    assert all(ledger[fate] == 0 for fate in ledger if fate not in dark | {"detected"})
    # pixels that see mirror at most through a part of the aperture; 16 x 16 rays overlook slivers
    assert 0 < ledger["missed_mirror"] / RAYS <= (run_coverage(name) == 0).sum()


def random_landings(scene, pixels, count):
    """Where light of the pixels lands: u, v [n, count] of random rays, NaN of those beside the mirror."""
    chief = ChiefRays(scene)
    generator = np.random.default_rng(3)
    row, column = (index[:, None] for index in np.divmod(pixels, chief.shape[1]))
    step = generator.uniform(-0.5, 0.5, (2, len(pixels), count))
    radius = scene.camera.aperture_diameter_mm / 2 * np.sqrt(generator.random((len(pixels), count)))
    angle = generator.uniform(0, 2 * np.pi, (len(pixels), count))
    points, u, v = chief.reverse(row + step[0], column + step[1], radius * np.cos(angle), radius * np.sin(angle))
    on = chief.surface.contains(points[..., 0], points[..., 1])
    return np.where(on, u, np.nan), np.where(on, v, np.nan)


def beyond_screen(scene, pixels, count=400):
    """How far [n] in mm the outermost of a pixel's random rays lands beyond the screen's edge; negative inside."""
    screen, farthest = scene.screen, np.full(len(pixels), -np.inf)
    for landing, offset, lines in zip(
        random_landings(scene, pixels, count), screen.centre_offset_mm, screen.pixels, strict=True
    ):
        beyond = np.abs(landing - offset) - lines / 2 * screen.pitch_mm
        farthest = np.maximum(farthest, np.max(beyond, axis=1, initial=-np.inf, where=np.isfinite(beyond)))
    return farthest


def test_light_cut_by_the_screen_s_edge_is_counted_and_not_given():
    scene, run = narrow(), analytic("narrow")
    beyond = beyond_screen(scene, run.windows.pixels)
    lit = run.flux_w["x"][0].sum(1) > 0
    assert (beyond > 0).sum() > 40
    assert not lit[beyond > 0].any()  # 400 rays and one of them beside the screen: no light curve
    cut = ~lit & (run_coverage("narrow") > 0)
    assert run.ledger["off_screen"] == RAYS * cut.sum()
    assert all((run.flux_w[axis][0][cut] == 0).all() for axis in "xy")
    whole = run_coverage("narrow") == 1
    assert (beyond[cut & whole] > -0.2).all()  # mm: how far 400 rays may stay from a corner's, of 0.9 mm lines


def test_all_light_of_the_off_axis_preset_is_on_the_screen():
    scene, run = load_scene("off-axis"), analytic("off-axis")
    assert beyond_screen(scene, run.windows.pixels).max() < -0.05  # mm: of every ray that the mirror sends
    assert run.ledger["off_screen"] == 0


def test_pixels_that_are_not_quadratic_are_counted_as_failed():
    wide = lopsided()  # its aperture is three times too wide
    less = with_part(wide, "camera", aperture_diameter_mm=wide.camera.aperture_diameter_mm / 1.5)
    run = trace(less, estimator="analytic")
    assert run.ledger["failed"] > 0.9 * run.rays_total and run.ledger["detected"] > 0
    dark = run.flux_w["x"][0].sum(1) == 0
    assert RAYS * dark.sum() == run.rays_total - run.ledger["detected"]


def test_without_any_closed_form_the_limit_is_named():
    with pytest.raises(ValueError, match="^scene lopsided: the light of none of the 3760 detector pixels") as caught:
        trace(lopsided(), estimator="analytic")
    # the camera is focused on the vertex, and the mirror is tilted to its view
    assert "the camera's defocus on the mirror, a blur of 0.037 of a pixel where 0.02 is allowed" in str(caught.value)


def test_a_camera_focused_off_the_mirror_is_named_by_each_command_that_needs_the_closed_form(irtscots, tmp_path):
    file = tmp_path / "mine.toml"
    camera = {"aperture_diameter_mm": 3.0, "focus_distance_mm": 3000.0}
    screen = {"pixels": (81, 81)}
    file.write_text(with_part(with_part(small_scene("sphere", 25), "camera", **camera), "screen", **screen).to_toml())
    for way in (("--estimator", "analytic"), ("--target-nm", "5")):
        code, out, err = irtscots("run", file, "--out", tmp_path / "out", "--quiet", *way)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert "its limit is the camera's defocus on the mirror, a blur of 0.02" in err, err
    assert not (tmp_path / "out").exists()


def test_a_dark_scene_is_refused():
    scene = with_part(load_scene("sphere"), "screen", centre_offset_mm=(30.0, 0.0))
    with pytest.raises(SceneError, match="scene sphere: screen.position_mm"):
        trace(scene, estimator="analytic")


def test_a_brightness_is_refused():
    run = analytic("sphere")
    with pytest.raises(ValueError, match="^brightness: the analytic .* must be None"):
        run.line_flux_w("x", np.ones((21, 21)))
    with pytest.raises(ValueError, match="brightness"):
        run.images(LineScan(run.scene, np.ones((21, 21))))


def test_one_replicate_without_noise():
    run = analytic("sphere")
    assert run.replicates == 1 and run.rays.tolist() == [RAYS]
    assert run.flux_w["x"].shape == (1, len(run.windows.pixels), run.windows.columns)
    assert run.flux_w["y"].shape == (1, len(run.windows.pixels), run.windows.rows)
    assert np.isinf(run.hits()).all()
    stack = run.images(LineScan(run.scene))
    for scan in (stack.x, stack.y):
        np.testing.assert_array_equal(scan.mean_w(), run.flux_w[scan.axis][0])
        assert np.isnan(scan.standard_error_w()).all()
    assert run.device["kind"] == "host" and run.options.estimator == "analytic" and run.options.precision == "fp64"
    assert run.seconds["kernels"] == 0 and run.seconds["trace"] > 0


def test_the_same_scene_gives_the_same_bits():
    first = trace(narrow(), estimator="analytic")
    second = trace(narrow(), estimator="analytic", seed=99, rays_per_pixel=8, replicates=2)  # which it has no use for
    for axis in "xy":
        np.testing.assert_array_equal(first.flux_w[axis], second.flux_w[axis])
    assert first.ledger == second.ledger and second.replicates == 1
