"""Quadratics that stand for the inverse of a lens's distortion over a pixel, and the range of the weights they give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from real_setup import real_setup
from scenes import coarse, with_part

from irtscots_cl.opencl.structs import WEIGHT_ONE
from irtscots_cl.optics.camera_model import CameraModel
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.camera_intrinsics import Intrinsics
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.packing.image_maps import image_maps, stretches
from irtscots_cl.tracing.packing.sources import MIN_COSINE4, receivers, relative_flux


def all_pixels(model_of):
    columns, rows = model_of.camera.detector.pixels
    return (values.ravel() for values in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))


def quadratic(maps, s, t):
    terms = [np.ones_like(s), s, t, s * s, s * t, t * t]
    return [sum(c * term for c, term in zip(of, terms, strict=True)) for of in maps]


def worst_px(scene):
    """Largest distance in pixels of a quadratic from the exact inverse, in the pixels' corners and inside."""
    model, (row, column) = CameraModel.of(scene.camera), all_pixels(scene)
    maps, worst = image_maps(model, row, column), 0.0
    for s, t in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (0.5, 0.0), (0.0, 0.5), (0.2, -0.3)):
        found = model.pixel(*quadratic(maps, np.full(len(row), s), np.full(len(row), t)))
        worst = max(worst, np.abs(found[0] - row - t).max(), np.abs(found[1] - column - s).max())
    return worst


def test_a_quadratic_misses_the_inverse_by_less_than_its_docstring_says():
    plain = load_scene("sphere")
    strong = with_part(plain, "camera", intrinsics=Intrinsics(distortion=(-0.3, 0.1, 0.001, -0.001, 0.0)))
    angle = 0.037 / strong.camera.image_distance_mm  # 1 mrad
    assert worst_px(strong) < 0.3 / 5 * angle**2  # k1 / 10, and as much for the other terms
    # 3 mrad to a pixel and a distortion of 2 % with eight coefficients
    assert worst_px(real_setup()) < 2e-5


def test_the_stretch_is_the_cameras_and_its_bound_holds():
    scene = real_setup()
    model, (row, column) = CameraModel.of(scene.camera), all_pixels(scene)
    middle, most = stretches(model, image_maps(model, row, column))
    np.testing.assert_allclose(middle, model.stretch(row, column), rtol=2e-5)  # of a pixel's own change of 1e-3
    random = np.random.default_rng(1)
    for _ in range(20):
        s, t = random.uniform(-0.5, 0.5, (2, len(row)))
        assert (model.stretch(row + t, column + s) < most * (1 + 5e-5)).all()  # of the exact inverse, not the quadratic
    assert (most < 1.05 * middle).all()


@pytest.mark.parametrize("pixels", [2, 125])
def test_no_weight_exceeds_its_range(pixels):
    """A camera with a wide view in few pixels: the weights of a pixel's rays stay below 2^30, 64 times their unit.

    Of two pixels, each has its centre at a slope of 4, with cos^4 of 0.003, and the axis at its edge.
    """
    wide = with_part(coarse("sphere", pixels), "camera", focal_length_mm=3.0, intrinsics=None)
    distance = wide.camera.image_distance_mm
    detector = replace(wide.camera.detector, pitch_mm=16.0 * distance / pixels)  # 83 degrees to each side
    intrinsics = Intrinsics(distortion=(0.001, 0.0, 0.0, 0.0, 0.0))
    wide = with_part(wide, "camera", detector=detector, intrinsics=intrinsics)
    chief, number = ChiefRays(wide), np.arange(pixels**2)
    scale = receivers(chief, number, np.zeros((pixels**2, 2), int), "fp64")["weight_scale"]
    np.testing.assert_allclose(scale, WEIGHT_ONE / relative_flux(chief, number), rtol=1e-15)
    model, (row, column) = CameraModel.of(wide.camera), np.divmod(number, pixels)
    maps, weights = image_maps(model, row, column), []
    for s in np.linspace(-0.5, 0.5, 9):
        for t in np.linspace(-0.5, 0.5, 9):
            x, y = (v / distance for v in quadratic(maps, np.full(len(row), s), np.full(len(row), t)))
            by_s = maps[:, 1] + 2 * maps[:, 3] * s + maps[:, 4] * t
            by_t = maps[:, 2] + maps[:, 4] * s + 2 * maps[:, 5] * t
            area = (by_s[0] * by_t[1] - by_t[0] * by_s[1]) / model.pixel_area_mm2
            weights.append((1 + x**2 + y**2) ** -2 * area * scale)
    assert np.min(weights) > 0 and np.max(weights) <= WEIGHT_ONE / MIN_COSINE4
    # the limit is what keeps them: by their centres alone they would be ten times as large
    x, y = model.image_point(row, column)
    alone = WEIGHT_ONE / (1 + (x**2 + y**2) / distance**2) ** -2 / model.stretch(row, column)
    assert (np.max(weights * alone / scale) > 4 * WEIGHT_ONE / MIN_COSINE4) == (pixels == 2)


def test_without_distortion_the_flux_is_that_of_the_cosine_alone():
    plain = real_setup(distorted=False)
    chief, number = ChiefRays(plain), np.arange(50)
    x, y = chief.camera_model.image_point(*np.divmod(number, 90))
    cosine4 = (1 + (x**2 + y**2) / plain.camera.image_distance_mm**2) ** -2
    np.testing.assert_array_equal(relative_flux(chief, number), cosine4)
