"""Line scans of a transport map made by hand: which light belongs to which line."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.opencl.structs import WEIGHT_ONE
from irtscots_cl.optics.screen_windows import Windows
from irtscots_cl.scene.instrument import Detector, Screen
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.screen_shape import ScanLines
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.results.transport import Transport

ROUNDING = 1e-12  # relative: sums of a few float64 numbers
COLUMNS, ROWS = 7, 5  # of the screen


def some_scene():
    scene = load_scene("sphere")
    screen = Screen(
        position_mm=scene.screen.position_mm,
        pixels=(COLUMNS, ROWS),
        pitch_mm=0.3,
        centre_offset_mm=(0.4, -1.1),
    )
    camera = dataclasses.replace(scene.camera, detector=Detector(pixels=(4, 3), pitch_mm=0.037))
    return dataclasses.replace(scene, screen=screen, camera=camera)


def some_transport(estimator: str = "forward", seed: int = 1) -> Transport:
    """Five of 12 detector pixels, windows of 2 rows and 3 columns, two replicates of unequal size."""
    random = np.random.default_rng(seed)
    counts = random.integers(0, 1000, (2, 5, 2, 3)).astype(np.uint64)
    origins = np.array([[0, 0], [4, 3], [2, 1], [3, 0], [1, 2]], np.int32)
    unit_w = random.uniform(1e-9, 2e-9, (5, 1, 1) if estimator == "adjoint" else (5, 2, 3))
    return Transport(
        some_scene(),
        TraceOptions(estimator),
        {},
        Windows(np.array([0, 2, 5, 7, 11]), origins, 2, 3),
        counts,
        unit_w,
        np.array([100, 300]),
        {"launched": 0},
        {},
    )


def on_screen(transport: Transport) -> np.ndarray:
    """Mean flux [detector pixel, screen row, screen column] of all rays, entry by entry."""
    flux = np.zeros((12, ROWS, COLUMNS))
    unit = np.broadcast_to(transport.unit_w, transport.counts.shape[1:])
    for n, pixel in enumerate(transport.windows.pixels):
        column, row = transport.windows.origins[n]
        for k in range(2):
            for m in range(3):
                count = sum(int(c) for c in transport.counts[:, n, k, m])
                flux[pixel, row + k, column + m] = count * unit[n, k, m] / transport.rays.sum()
    return flux


def images_of(scan) -> np.ndarray:
    return np.stack([scan.image(line) for line in range(len(scan.positions_mm))])


@pytest.mark.parametrize("estimator", ["forward", "adjoint"])
def test_an_x_scan_lights_columns_and_a_y_scan_rows(estimator):
    transport = some_transport(estimator)
    stack, flux = transport.images(LineScan(some_scene())), on_screen(transport)
    np.testing.assert_allclose(images_of(stack.x), flux.sum(1).T.reshape(COLUMNS, 3, 4), rtol=ROUNDING)
    np.testing.assert_allclose(images_of(stack.y), flux.sum(2).T.reshape(ROWS, 3, 4), rtol=ROUNDING)
    assert (stack.x.axis, stack.y.axis) == ("x", "y")


def test_both_scans_bring_all_light_to_every_pixel():
    transport = some_transport()
    stack, total = transport.images(LineScan(some_scene())), on_screen(transport).sum((1, 2)).reshape(3, 4)
    for scan in (stack.x, stack.y):
        np.testing.assert_allclose(images_of(scan).sum(0), total, rtol=ROUNDING)


def test_replicates_weights_and_rays_come_from_the_transport():
    forward, adjoint = some_transport("forward"), some_transport("adjoint")
    for transport, one in ((forward, 1), (adjoint, WEIGHT_ONE)):
        scan = transport.images(LineScan(some_scene())).x
        np.testing.assert_array_equal(scan.weights, [100.0, 300.0])
        np.testing.assert_allclose(scan.hits, transport.counts.astype(float).sum((0, 2, 3)) / one, rtol=ROUNDING)
        second = transport.counts[1].astype(float) * transport.unit_w / 300
        np.testing.assert_allclose(scan.flux_w[1], second.sum(1), rtol=ROUNDING)


def test_lines_stand_at_the_centres_of_the_screen_s_columns_and_rows():
    pattern = LineScan(some_scene())
    expected = {
        "x": np.array([-0.9, -0.6, -0.3, 0, 0.3, 0.6, 0.9]) + 0.4,
        "y": np.array([-0.6, -0.3, 0, 0.3, 0.6]) - 1.1,
    }
    for axis, places in expected.items():
        np.testing.assert_allclose(pattern.positions_mm(axis), places, atol=1e-15)  # rounding of numbers near 1


def test_the_images_are_linear_in_the_brightness():
    transport, random = some_transport(), np.random.default_rng(4)
    first, second = random.uniform(0, 1, (2, ROWS, COLUMNS))
    stacks = [transport.images(LineScan(some_scene(), b)) for b in (first, second, first + second)]
    for axis in ("x", "y"):
        one, other, both = (images_of(getattr(stack, axis)) for stack in stacks)
        np.testing.assert_allclose(one + other, both, rtol=ROUNDING)
    np.testing.assert_allclose(
        images_of(stacks[0].x), (on_screen(transport) * first).sum(1).T.reshape(-1, 3, 4), rtol=ROUNDING
    )


def test_no_brightness_is_brightness_one_and_brightness_zero_is_dark():
    transport = some_transport()
    plain = transport.images(LineScan(some_scene()))
    ones = transport.images(LineScan(some_scene(), np.ones((ROWS, COLUMNS))))
    dark = transport.images(LineScan(some_scene(), np.zeros((ROWS, COLUMNS))))
    for axis in ("x", "y"):
        np.testing.assert_array_equal(getattr(ones, axis).flux_w, getattr(plain, axis).flux_w)
        assert not getattr(dark, axis).flux_w.any()


@pytest.mark.parametrize(
    ("brightness", "message"),
    [
        (np.ones((COLUMNS, ROWS)), r"brightness has shape \(7, 5\), must be \(5, 7\): the screen"),
        (np.ones(ROWS), r"brightness has shape \(5,\), must be \(5, 7\): the screen"),
        (np.full((ROWS, COLUMNS), -0.1), "brightness must be finite and not negative"),
        (np.full((ROWS, COLUMNS), np.nan), "brightness must be finite and not negative"),
        (np.full((ROWS, COLUMNS), np.inf), "brightness must be finite and not negative"),
    ],
)
def test_a_brightness_that_no_screen_can_have_is_refused(brightness, message):
    with pytest.raises(ValueError, match=message):
        LineScan(some_scene(), brightness)


def test_a_pattern_of_another_screen_is_refused():
    with pytest.raises(ValueError, match=r"the pattern's screen has \(21, 21\) pixels, the transport's \(7, 5\)"):
        some_transport().images(LineScan(load_scene("sphere")))


# --- lines that are wider or narrower than their distance ---------------------------------------------------

LINES = [(1, 1, 0), (1, 2, 0), (2, 1, 0), (1, 3, 0), (1, 1, 2), (1, 2, 1)]  # step, width, first


def with_lines(step: int, width: int, first: int):
    scene = some_scene()
    lines = ScanLines(step_px=step, width_px=width, first_px=first)
    return dataclasses.replace(scene, screen=dataclasses.replace(scene.screen, lines=lines))


@pytest.mark.parametrize("lines", LINES)
@pytest.mark.parametrize("estimator", ["forward", "adjoint"])
def test_a_line_lights_the_columns_that_the_table_says(estimator, lines):
    """Frame k is the sum of the single columns first + k step ... + width - 1, and no others."""
    step, width, first = lines
    transport, pattern = some_transport(estimator), LineScan(with_lines(*lines))
    stack, flux = transport.images(pattern), on_screen(transport)
    for scan, of_screen, count in ((stack.x, flux.sum(1), COLUMNS), (stack.y, flux.sum(2), ROWS)):
        starts = [s for s in range(first, count, step) if s + width <= count]
        expected = np.stack([of_screen[:, s : s + width].sum(1).reshape(3, 4) for s in starts])
        np.testing.assert_allclose(images_of(scan), expected, rtol=ROUNDING, atol=ROUNDING * expected.max())
        middle = (np.array(starts) + (width - 1) / 2 - (count - 1) / 2) * 0.3
        np.testing.assert_allclose(scan.positions_mm, middle + (0.4, -1.1)["xy".index(scan.axis)], atol=1e-14)
        assert scan.line_width == pattern.line_width == width / step
        assert pattern.spacing_mm(scan.axis) == pytest.approx(0.3 * step)


@pytest.mark.parametrize("window", [1, 3, 8, 29])
@pytest.mark.parametrize("lines", [(3, 2, 1), (2, 3, 0), (5, 1, 2), (1, 9, 0), (4, 4, 3), (6, 5, 9)])
def test_windows_of_single_columns_become_windows_of_lines(lines, window):
    step, width, first = lines
    scene = with_lines(1, 1, 0)
    table = ScanLines(step_px=step, width_px=width, first_px=first)
    scene = dataclasses.replace(scene, screen=dataclasses.replace(scene.screen, pixels=(29, 29), lines=table))
    pattern = LineScan(scene)
    random = np.random.default_rng(window)
    origins = random.integers(0, 29 - window + 1, 40)
    single = random.uniform(0, 1, (2, 40, window))
    whole = np.zeros((2, 40, 29))
    for n, origin in enumerate(origins):
        whole[:, n, origin : origin + window] = single[:, n]
    curves, firsts = pattern.joined("x", single, origins)
    count = len(pattern.positions_mm("x"))
    found = np.zeros((2, 40, count))
    for n, line in enumerate(firsts):
        assert 0 <= line <= count - curves.shape[-1]
        found[:, n, line : line + curves.shape[-1]] = curves[:, n]
    starts = [s for s in range(first, 29, step) if s + width <= 29]
    expected = np.stack([whole[..., s : s + width].sum(-1) for s in starts], -1)
    np.testing.assert_allclose(found, expected, rtol=ROUNDING, atol=ROUNDING)


def test_a_table_of_plain_lines_changes_no_bit():
    plain, table = (some_transport().images(LineScan(s)) for s in (some_scene(), with_lines(1, 1, 0)))
    for axis in ("x", "y"):
        one, other = getattr(plain, axis), getattr(table, axis)
        np.testing.assert_array_equal(images_of(one), images_of(other))
        np.testing.assert_array_equal(one.positions_mm, other.positions_mm)
        assert one.line_width == other.line_width == 1.0


def test_brightness_is_of_single_screen_pixels_also_under_wide_lines():
    brightness = np.random.default_rng(3).uniform(0, 1, (ROWS, COLUMNS))
    transport = some_transport()
    stack = transport.images(LineScan(with_lines(1, 2, 0), brightness))
    of_screen = (on_screen(transport) * brightness).sum(1)
    expected = np.stack([of_screen[:, s : s + 2].sum(1).reshape(3, 4) for s in range(COLUMNS - 1)])
    np.testing.assert_allclose(images_of(stack.x), expected, rtol=ROUNDING, atol=ROUNDING * expected.max())


def test_rays_between_the_lines_do_not_count_as_hits():
    transport = some_transport()
    whole, half = (transport.images(LineScan(with_lines(*lines))).x.hits for lines in ((1, 2, 0), (2, 1, 0)))
    np.testing.assert_allclose(half, whole / 2, rtol=ROUNDING)
    np.testing.assert_array_equal(whole, transport.hits())
