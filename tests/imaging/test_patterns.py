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
