"""Predicted errors: counting noise, and both parts together."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import coarse, with_part
from synthetic import noise_free_stack, small_scene, with_replicates

from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.prediction import PredictedError, predict_error
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.tracing.trace import trace

SLOPE_PER_MM = 1 / (2 * 4166.747 * np.cos(np.radians(3)))  # at the vertex of the paper's sphere


def test_both_parts_add_as_squares():
    predicted = PredictedError((3e-6, 5e-6), (4e-6, 12e-6), 8e-6, 15e-6)
    np.testing.assert_allclose(predicted.slope, (5e-6, 13e-6), rtol=1e-14)  # rounding
    assert predicted.height_mm == pytest.approx(17e-6, rel=1e-14)  # rounding


def with_hits(stack: ImageStack, hits: float) -> ImageStack:
    return ImageStack(*(dataclasses.replace(s, hits=np.full(len(s.pixels), hits)) for s in (stack.x, stack.y)))


def test_the_noise_of_counting_goes_with_the_root_of_the_hits():
    scene = small_scene("sphere")
    stack = noise_free_stack(scene)
    result = reconstruct(stack, scene)
    few, many = (predict_error(result, with_hits(stack, hits)) for hits in (1e4, 1e6))
    np.testing.assert_allclose(
        few.ray_noise_slope,
        np.multiply(many.ray_noise_slope, 10),
        rtol=1e-12,  # rounding
    )
    assert few.ray_noise_height_mm == pytest.approx(10 * many.ray_noise_height_mm, rel=1e-12)  # rounding
    assert few.line_sampling_slope == many.line_sampling_slope
    # 0.2566 mm / sqrt(hits); these images spread light over a line more than the paper's, 0.2566 -> 0.265 mm
    np.testing.assert_allclose(few.ray_noise_slope, 0.2566 / 100 * SLOPE_PER_MM, rtol=0.06)


def test_the_noise_of_slopes_becomes_the_noise_of_heights_that_random_maps_have():
    scene = small_scene("sphere")
    stack = with_hits(noise_free_stack(scene), 1e4)
    result = reconstruct(stack, scene)
    predicted = predict_error(result, stack)
    slopes = np.random.default_rng(8).standard_normal((2, 400, *result.mask.shape)) * predicted.ray_noise_slope[0]
    heights = integrate_slopes(result.x_mm, result.y_mm, *slopes, result.mask)
    left = [rms(remove_terms(result.x_mm, result.y_mm, h, result.mask, "piston_tilt"), result.mask) for h in heights]
    spread = np.std(left) / np.mean(left)  # of one map; the prediction is from 32
    assert predicted.ray_noise_height_mm == pytest.approx(
        np.sqrt(np.mean(np.square(left))),
        rel=4 * spread / np.sqrt(32),  # 4 sigma, chance 6e-5
    )


@pytest.mark.slow
def test_sampling_by_few_lines_is_no_fault_of_the_slopes():
    """Light as wide as three to four lines: its centroids err more than noise makes them, and that is predicted."""
    scene = with_part(coarse("gmt-segment", 19), "camera", aperture_diameter_mm=3.125)
    scene = with_part(scene, "screen", pixels=(126, 94), pitch_mm=5.67)
    clean = trace(scene, estimator="analytic").images(LineScan(scene))
    for seed in range(2):
        stack = with_replicates(clean, 8, 0.01, seed)
        result = reconstruct(stack, scene.nominal())
        predicted = predict_error(result, stack, systematic=False)
        found = result.misfit(systematic=predicted.line_sampling)
        assert result.misfit().suspicious  # where the sampling is not known
        assert not found.suspicious and found.systematic > 3 * found.expected
        assert found.slope == pytest.approx(np.hypot(found.expected, found.systematic), rel=0.15)
        bent = dataclasses.replace(result, slope_x=result.slope_x - 1e-8 * result.y_mm)
        assert bent.misfit(systematic=predicted.line_sampling).suspicious  # 20 urad rms that no surface has


def test_images_from_a_lab_have_a_sampling_error_but_no_known_noise():
    scene = small_scene("sphere")
    stack = noise_free_stack(scene)
    predicted = predict_error(reconstruct(stack, scene), stack)
    assert np.isnan(predicted.ray_noise_slope).all() and np.isnan(predicted.height_mm)
    assert np.isnan(predicted.ray_noise_height_mm) and min(predicted.line_sampling_slope) > 0
