"""Light curves by their model: sampling by lines on the paper's sphere, against many rays; and taking it away."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from synthetic import small_scene
from tracers import setup_of

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.centroids import centroids
from irtscots_cl.measurement.light_profiles import profile_centroids, sampled_centroids, sampling_error
from irtscots_cl.optics.pixel.response import PixelResponse
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

A, D = 0.5, 0.2  # the paper's aperture radius and line width [mm]
SLOPE_PER_MM = 1 / (2 * 4166.747 * np.cos(np.radians(3)))  # at the vertex of the paper's sphere


def line_sampling_error(chief, positions_mm, centre_mm, mask, k):
    """sampling_error on the detector's grid, NaN outside the mask."""
    light = setup_of(chief.scene).pixel_response
    error = np.full(mask.size, np.nan)
    error[light.pixels] = sampling_error(positions_mm, light, "uv"[k], centre_mm.ravel()[light.pixels])
    return np.where(mask, error.reshape(mask.shape), np.nan)


@pytest.fixture(scope="module")
def sphere():
    """ChiefRays of the paper's sphere, its mask, and the true centroids of its pixels along x and y."""
    chief = setup_of(load_scene("sphere")).chief_rays
    row, column = np.meshgrid(*(np.arange(n) for n in chief.shape), indexing="ij")
    _, u, v = chief.reverse(row, column)
    return chief, chief.footprint.coverage >= 0.5, (u, v)


@pytest.fixture(scope="module")
def sampling(sphere):
    chief, mask, centres = sphere
    pattern = LineScan(chief.scene)
    return [line_sampling_error(chief, pattern.positions_mm("xy"[k]), centres[k], mask, k) for k in (0, 1)]


def test_sampling_by_lines_costs_0_095_microradians_on_the_paper_s_sphere(sphere, sampling):
    _, mask, _ = sphere
    for error in sampling:
        assert rms(error, mask) * SLOPE_PER_MM * 1e6 == pytest.approx(0.095, abs=5e-4)  # the digits given
        np.testing.assert_array_equal(np.isfinite(error), mask)


def test_sampling_by_lines_costs_1_5_nanometres_on_the_paper_s_sphere(sphere, sampling):
    chief, mask, _ = sphere
    x, y = chief.footprint.x_mm, chief.footprint.y_mm
    heights = integrate_slopes(x, y, -sampling[0] * SLOPE_PER_MM, -sampling[1] * SLOPE_PER_MM, mask)
    error = rms(remove_terms(x, y, heights, mask, "piston_tilt"), mask) * 1e6
    assert 1.40 < error < 1.55  # 1.46 nm with rays, "about 1.5"; it varies a little with where the pixels see


@pytest.mark.parametrize("pixel", [(62, 62), (80, 55), (30, 90), (75, 75), (62, 20)])
def test_the_sampling_error_of_a_pixel_is_that_of_its_many_rays(sphere, sampling, pixel):
    chief, _, _ = sphere
    n, points = 12, 10_000
    step = (np.arange(n) + 0.5) / n - 0.5
    step_row, step_column = (s.ravel()[:, None] for s in np.meshgrid(step, step, indexing="ij"))
    radius = A * np.sqrt((np.arange(points) + 0.5) / points)
    # a sunflower, even over the disk, turned anew for each part of the pixel
    angle = np.arange(points) * np.pi * (3 - np.sqrt(5)) + np.arange(n * n)[:, None] * 4.7437
    _, *landing = chief.reverse(
        pixel[0] + step_row, pixel[1] + step_column, radius * np.cos(angle), radius * np.sin(angle)
    )
    for k, mm in enumerate(landing):
        brute = (np.rint(mm / D) * D - mm).mean()  # every ray counts for its line
        assert sampling[k][pixel] == pytest.approx(brute, abs=1.5e-5)  # of up to 1e-3 mm: the number of rays


def test_lines_finer_than_the_light_cost_nothing(sphere):
    chief, mask, centres = sphere
    fine = line_sampling_error(chief, np.arange(-2.5, 2.5, 0.01), centres[0], mask, 0)
    assert rms(fine, mask) < 1e-6  # mm; falls as the 5/2 power of the width, from 8e-4 mm at 0.2 mm


# --- taking it away -----------------------------------------------------------------------------------------

AXES = pytest.mark.parametrize("k", [0, 1], ids=["x", "y"])


@pytest.fixture(scope="module")
def deviated():
    """A deviated sphere's scene, and scans of its light curves in closed form, without noise."""
    return curves_of(small_scene("sphere-deviated", 25))


def curves_of(scene, pitch_mm=0.2):
    scene = dataclasses.replace(scene, screen=dataclasses.replace(scene.screen, pitch_mm=pitch_mm))
    stack = trace(scene, estimator="analytic").images(LineScan(scene))
    return scene, (stack.x, stack.y)


def errors(scene, scan, centroid_mm):
    """Of centroids [n], against those of the true mirror's light."""
    light, output = setup_of(scene).pixel_response, "uv"["xy".index(scan.axis)]
    np.testing.assert_array_equal(light.pixels, scan.pixels)
    return centroid_mm - light.means(output)[0]


def root_mean_square(values):
    return np.sqrt(np.mean(values**2))


def part_of(scan, chosen):
    """The scan of some of its pixels, in the order of the index array `chosen`."""
    values = {name: getattr(scan, name)[chosen] for name in ("pixels", "first_line", "hits")}
    return dataclasses.replace(scan, flux_w=scan.flux_w[:, chosen], **values)


@AXES
def test_the_light_s_own_profile_takes_the_sampling_error_away(deviated, k):
    scene, scans = deviated
    raw = centroids(scans[k], scans[k].mean_w())
    found = profile_centroids(scans[k], setup_of(scene).pixel_response, raw)
    assert root_mean_square(errors(scene, scans[k], raw)) > 3e-4  # mm: a line of 0.2 mm, light of 1 mm
    assert np.abs(errors(scene, scans[k], found)).max() < 1e-7  # mm: where the rounds stop


@AXES
def test_the_design_s_profile_takes_nine_tenths_of_the_sampling_error_away(deviated, k):
    """What the mirror's deviation adds to the profile is a part of a slope's change over a pixel of 43 mm."""
    scene, scans = deviated
    raw = centroids(scans[k], scans[k].mean_w())
    found = profile_centroids(scans[k], setup_of(scene.nominal()).pixel_response, raw)
    left, before = (root_mean_square(errors(scene, scans[k], c)) for c in (found, raw))
    assert 0.01 * before < left < 0.15 * before  # the pixel's image, 0.6 of the light, changes by tenths at most


@AXES
def test_sampled_centroids_are_those_of_the_scene_s_own_curves(deviated, k):
    scene, scans = deviated
    found = sampled_centroids(scans[k], setup_of(scene).pixel_response)
    raw = centroids(scans[k], scans[k].mean_w())
    np.testing.assert_allclose(found, raw, rtol=0, atol=1e-9)  # mm: rounding of light that is a small difference
    assert np.abs(errors(scene, scans[k], found)).max() > 1e-4  # they do have the sampling error


@pytest.mark.parametrize("threshold", [0.0, 0.05, 0.1, 0.3])
def test_sampled_centroids_know_the_threshold(deviated, threshold):
    scene, (scan, _) = deviated
    found = sampled_centroids(scan, setup_of(scene).pixel_response, threshold)
    raw = centroids(scan, scan.mean_w(), threshold)
    np.testing.assert_allclose(found, raw, rtol=0, atol=1e-9)  # mm: as without
    if threshold:
        assert (
            np.abs(found - sampled_centroids(scan, setup_of(scene).pixel_response)).max() > 1e-3
        )  # mm: samples are cut off


def test_the_profile_corrects_for_a_threshold(deviated):
    scene, (scan, _) = deviated
    raw = centroids(scan, scan.mean_w(), 0.1)
    before = root_mean_square(errors(scene, scan, raw))
    found = profile_centroids(scan, setup_of(scene).pixel_response, raw, 0.1)
    ignored = profile_centroids(scan, setup_of(scene).pixel_response, raw)
    # the cut moves with the light and jumps from line to line, so a round takes less away than without: 0.4 of it
    assert root_mean_square(errors(scene, scan, found)) < 0.4**4 * before
    assert root_mean_square(errors(scene, scan, ignored)) > 0.9 * before  # 5 um by the cut, 0.4 by sampling


@AXES
def test_a_pixel_without_a_model_keeps_its_centroid(deviated, k):
    scene, scans = deviated
    light, lost = setup_of(scene.nominal()).pixel_response, 200
    residual = light.maps.residual.copy()
    residual[:, lost] = 1.0  # mm: far from quadratic
    partial = PixelResponse(light.chief, light.pixels, dataclasses.replace(light.maps, residual=residual))
    raw = centroids(scans[k], scans[k].mean_w())
    found, whole = (profile_centroids(scans[k], known, raw) for known in (partial, light))
    others = np.arange(len(raw)) != lost
    assert found[lost] == raw[lost] != whole[lost]
    np.testing.assert_allclose(found[others], whole[others], rtol=0, atol=1e-12)  # mm: rounding
    sampled = sampled_centroids(scans[k], partial)
    np.testing.assert_array_equal(np.isnan(sampled), ~others)


def test_a_scene_without_any_model_is_left_as_it_is(deviated):
    scene, (scan, _) = deviated
    light = setup_of(scene.nominal()).pixel_response
    none = PixelResponse(light.chief, light.pixels, dataclasses.replace(light.maps, residual=light.maps.residual + 1.0))
    raw = centroids(scan, scan.mean_w())
    np.testing.assert_array_equal(profile_centroids(scan, none, raw), raw)
    assert np.isnan(sampled_centroids(scan, none)).all()


@AXES
def test_scan_and_model_may_know_different_pixels_in_any_order(deviated, k):
    scene, scans = deviated
    light, count = setup_of(scene.nominal()).pixel_response, len(scans[k].pixels)
    random = np.random.default_rng(2)
    chosen, modelled = random.permutation(count)[:300], random.permutation(count)[:300]
    scan = part_of(scans[k], chosen)
    partial = PixelResponse.of(light.chief, light.pixels[modelled])
    raw = centroids(scan, scan.mean_w())
    found, sampled = profile_centroids(scan, partial, raw), sampled_centroids(scan, partial)
    both = np.isin(scan.pixels, partial.pixels)
    assert 100 < both.sum() < 300
    whole = profile_centroids(scans[k], light, centroids(scans[k], scans[k].mean_w()))[chosen]
    np.testing.assert_allclose(found[both], whole[both], rtol=0, atol=1e-9)  # mm: other cells, to rounding
    np.testing.assert_array_equal(found[~both], raw[~both])
    whole = sampled_centroids(scans[k], light)[chosen]
    np.testing.assert_allclose(sampled[both], whole[both], rtol=0, atol=1e-9)  # mm: the same
    assert np.isnan(sampled[~both]).all()


def test_a_curve_without_light_stays_without_a_centroid(deviated):
    scene, (scan, _) = deviated
    dark = dataclasses.replace(scan, flux_w=scan.flux_w.copy())
    dark.flux_w[:, 7] = 0.0
    found = profile_centroids(dark, setup_of(scene.nominal()).pixel_response, centroids(dark, dark.mean_w()))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found)), [7])


@pytest.mark.parametrize(
    ("pitch_mm", "part"),
    [
        (0.4, 0.05),  # of the sampling error; as at 0.2 mm
        (1.0, 0.05),  # the same, though two lines hold all the light
        (1.6, 0.8),  # more than the light's 1.2 mm: some pixels light one line, whose centre tells nothing
        (5.0, 1.05),  # nearly all light one line
    ],
)
def test_lines_wider_than_the_light_do_no_harm(pitch_mm, part):
    scene, scans = curves_of(small_scene("sphere-deviated", 25), pitch_mm)
    for scan in scans:
        raw = centroids(scan, scan.mean_w())
        found = profile_centroids(scan, setup_of(scene.nominal()).pixel_response, raw)
        assert np.isfinite(found).all()
        assert root_mean_square(errors(scene, scan, found)) < part * root_mean_square(errors(scene, scan, raw))
        # the light is on the lines that it lights: half a line and its own reach, of 0.6 mm and the pixel's image
        assert np.abs(errors(scene, scan, found)).max() < pitch_mm / 2 + 1.2


def test_a_single_line_takes_the_screen_s_pitch(deviated):
    """Its positions have no distance to take the pitch from."""
    scene, _ = deviated
    light = setup_of(scene.nominal()).pixel_response
    centre = light.means("u")[0]
    positions = LineScan(scene).positions_mm("x")
    np.testing.assert_allclose(
        sampling_error(positions[10:11], light, "u", centre),
        sampling_error(positions, light, "u", centre),
        rtol=0,
        atol=1e-9,  # mm: the lines go on at the same pitch beyond those of the scan; rounding
    )
