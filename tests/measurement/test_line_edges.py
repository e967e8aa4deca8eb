"""Lines of a scan that are wider or narrower than their distance: their edges, and mirrors measured with them."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from noisy_images import images_of
from scenes import coarse, with_part
from tracers import setup_of

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.centroids import centroids, poisson_error
from irtscots_cl.measurement.light_curves import whole_range
from irtscots_cl.measurement.light_profiles import profile_centroids
from irtscots_cl.measurement.line_edges import line_edges, on_lines, uncovered
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.prediction import predict_error
from irtscots_cl.scene.screen_shape import ScanLines
from irtscots_cl.tracing.trace import trace

SCREEN = {"pixels": (42, 42), "pitch_mm": 0.1}  # the preset's 21 lines of 0.2 mm, halved


@cache
def scene_of(lines, pixels: int = 25, name: str = "sphere-deviated"):
    table = None if lines is None else ScanLines(*lines)
    return with_part(coarse(name, pixels), "screen", **SCREEN, lines=table)


@cache
def light_of(lines, pixels: int = 25, name: str = "sphere-deviated"):
    """Light curves without noise."""
    scene = scene_of(lines, pixels, name)
    return trace(scene, estimator="analytic").images(LineScan(scene))


def measured(lines, how: str, pixels: int = 25):
    return measure_by(how, light_of(lines, pixels), setup_of(scene_of(lines, pixels)).nominal)


# --- edges --------------------------------------------------------------------------------------------------


def test_edges_of_lines_that_touch_are_shared_and_others_come_in_pairs():
    first = np.array([3, -1])
    np.testing.assert_array_equal(line_edges(first, 2, 1.0), [[2.5, 3.5, 4.5], [-1.5, -0.5, 0.5]])
    np.testing.assert_array_equal(line_edges(first, 2, 0.5), [[2.75, 3.25, 3.75, 4.25], [-1.25, -0.75, -0.25, 0.25]])
    np.testing.assert_array_equal(line_edges(first, 2, 3.0), [[1.5, 4.5, 2.5, 5.5], [-2.5, 0.5, -1.5, 1.5]])
    between = np.arange(3.0)[None]
    np.testing.assert_array_equal(on_lines(between, 2.0), [[0.0, 2.0]])
    np.testing.assert_array_equal(on_lines(between, 1.0), between)


@pytest.mark.parametrize(
    ("width", "distance"), [(1, 1), (0.5, 0.5), (2, 1), (1 / 3, 2 / 3), (1.5, 0.5), (5 / 3, 2 / 3)]
)
def test_the_largest_distance_of_successive_edges(width, distance):
    edges = np.sort(line_edges(np.array([0]), 20, width)[0])
    inner = edges[(edges > 5) & (edges < 14)]
    assert uncovered(width) == pytest.approx(np.diff(inner).max()) == pytest.approx(distance)


@pytest.mark.parametrize("width", [0.5, 1.0, 2.0, 3.0])
def test_the_range_in_which_all_lines_there_could_be_are_there(width):
    scan = dataclasses.replace(light_of(None).x, line_width=width)
    pitch, count = 0.1, len(scan.positions_mm)
    first, last = whole_range(scan, pitch)
    edges = scan.positions_mm[0] + pitch * line_edges(np.array([-9]), count + 18, width)[0]
    pairs = edges.reshape(-1, 2) if width != 1.0 else np.stack([edges[:-1], edges[1:]], -1)
    missing = np.concatenate([pairs[:9], pairs[-9:]])  # the lines that an endless scan would have
    assert missing[missing < 0].max() == pytest.approx(first)
    assert missing[missing > 0].min() == pytest.approx(last)


# --- measuring ----------------------------------------------------------------------------------------------


def test_a_table_of_plain_lines_measures_the_same_bits():
    for how in ("paper", "likelihood"):
        plain, table = measured(None, how), measured((1, 1, 0), how)
        np.testing.assert_array_equal(plain.deviation_mm, table.deviation_mm)


def test_two_pixels_to_a_line_and_to_a_step_are_a_screen_of_larger_pixels():
    large = coarse("sphere-deviated", 25)  # 21 x 21 pixels of 0.2 mm
    whole = measure_by("likelihood", trace(large, estimator="analytic").images(LineScan(large)), large.nominal())
    halved = measured((2, 2, 0), "likelihood")
    np.testing.assert_allclose(halved.deviation_mm, whole.deviation_mm, atol=1e-9)  # 1e-3 nm


# Floors without noise in nm rms, piston and tilt removed: what the averaging over 41 x 41 pixels and the sampling by
# lines leave. Plain lines of 0.1 mm: paper 4.1, fine 0.19, likelihood 0.03.
FLOORS = {
    (1, 2, 0): {"paper": 4.3, "fine": 0.21, "likelihood": 0.05},
    (2, 1, 0): {"paper": 9.7, "fine": 1.0, "likelihood": 0.45},
    (3, 2, 1): {"paper": 24.5, "fine": 1.1, "likelihood": 1.9},
}


@pytest.mark.parametrize("lines", FLOORS)
def test_the_mirror_comes_out_within_the_floor_of_its_lines(lines):
    scene = scene_of(lines, 41)
    for how, floor in FLOORS[lines].items():
        result = measured(lines, how, 41)
        error = compare(result, scene).height_error_nm["piston_tilt"].value
        assert result.pixels_used > 1000 and error < floor, (how, error)


@pytest.mark.parametrize("lines", [(1, 2, 0), (2, 1, 0)])
def test_plain_centroids_err_as_predicted(lines):
    """Sampling by lines with gaps costs more, and the prediction knows it: from the images alone."""
    result = measured(lines, "paper", 41)
    actual = compare(result, scene_of(lines, 41)).height_error_nm["piston_tilt"].value
    predicted = predict_error(result, light_of(lines, 41)).height_mm * 1e6
    assert predicted == pytest.approx(actual, rel=0.03)  # of 4 and 9 nm


def test_profiles_of_wrong_lines_would_show():
    """Images under lines with gaps, measured as if the lines touched: the correction makes it worse, not better."""
    scene, stack = scene_of((2, 1, 0), 41), light_of((2, 1, 0), 41)
    wide = with_part(scene, "screen", lines=ScanLines(2, 2, 0))
    positions = [LineScan(wide).positions_mm(a) for a in "xy"]
    touching = ImageStack(
        *(
            dataclasses.replace(scan, positions_mm=p, line_width=1.0)
            for scan, p in zip((stack.x, stack.y), positions, strict=True)
        )
    )
    error = compare(measure_by("fine", touching, wide.nominal()), scene).height_error_nm["piston_tilt"].value
    assert error > 5  # 0.9 nm with the right width


@pytest.mark.parametrize("lines", [(1, 2, 0), (2, 1, 1), (3, 2, 0)])
def test_the_profile_gives_the_light_s_own_centroid_back(lines):
    """Sampled centroids minus the sampling error, against the means of the light in closed form: 1e-5 of a pixel."""
    setup = setup_of(scene_of(lines, 25, "sphere")).nominal
    for scan, output in zip((light_of(lines, 25, "sphere").x, light_of(lines, 25, "sphere").y), "uv", strict=True):
        light = setup.pixel_light
        plain = centroids(scan, scan.mean_w())
        found = profile_centroids(scan, light, plain)
        truth = dict(zip(light.pixels, light.means(output)[0], strict=True))
        expected = np.array([truth[p] for p in scan.pixels])
        first, last = whole_range(scan, LineScan(scene_of(lines)).spacing_mm(scan.axis))
        extent = light.extent(output)
        inside = (extent[0] - extent[1] > first) & (extent[0] + extent[1] < last) & np.isfinite(expected)
        assert inside.sum() > 200
        assert np.abs(found - expected)[inside].max() < 1e-5  # mm; lines are 0.1 mm wide
        if lines != (1, 2, 0):
            assert np.abs(plain - expected)[inside].max() > 1e-4


def test_counting_errors_of_overlapping_lines_are_those_of_the_rays():
    """Every ray under two lines: its centroid, the mean of both, is its column's; the spread over the lines is none."""
    rays = 5000.0
    single, double = (light_of(lines, 25, "sphere").x for lines in ((1, 1, 0), (1, 2, 0)))
    one, two = (
        poisson_error(dataclasses.replace(scan, hits=np.full(len(scan.pixels), rays)), scan.mean_w())
        for scan in (single, double)
    )
    middle = np.isfinite(one + two) & (np.abs(centroids(single, single.mean_w())) < 1.2)  # all lines are there
    np.testing.assert_allclose(two[middle], one[middle], rtol=1e-6)


def test_noisy_images_under_wide_lines_pull_as_their_errors_say():
    """Pulls of the likelihood's centroids have the variance 1: 0.05 of it is 4 sigma for 1000 pulls and more."""
    for lines in ((1, 2, 0), (2, 1, 0)):
        scene = scene_of(lines)
        clean, noisy = (measure_estimates(scene, images) for images in (None, images_of(scene).noisy(0.003, 5)))
        for one, other in zip(clean, noisy, strict=True):
            good = (one.flags == 0) & (other.flags == 0)
            pulls = ((other.centroid_mm[0] - one.centroid_mm[0]) / other.error_mm)[good]
            assert good.sum() > 300
            assert np.var(pulls) == pytest.approx(1.0, abs=5 * np.sqrt(2 / good.sum()))  # 5 sigma


def measure_estimates(scene, noisy):
    from irtscots_cl.measurement.scan_estimates import estimate_centroids

    images = images_of(scene) if noisy is None else noisy
    stack = images.stack()
    width = LineScan(scene).line_width
    stack = ImageStack(*(dataclasses.replace(scan, line_width=width) for scan in (stack.x, stack.y)))
    return estimate_centroids(stack, setup_of(scene).nominal, "likelihood")
