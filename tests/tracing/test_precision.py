"""Whether single precision is enough: the height that its rounding adds up to, and the refusal."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest
from scenes import SEQUENTIAL, coarse, large_segment

from irtscots_cl.analysis.error_terms import rounding_height_nm
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.checks import precision as module
from irtscots_cl.tracing.checks.precision import (
    SMALL_NM,
    SUSPECT_NM,
    RoundingWarning,
    check_precision_of_scene,
    ray_noise_nm,
    rounding_error,
    rounding_scale_nm,
)
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.trace import trace


@pytest.mark.parametrize("name", SEQUENTIAL)
def test_presets_lose_little_in_single_precision(name, device):
    setup = Setup(load_scene(name))
    found = rounding_error(setup, device, "fp32")
    assert 1e-4 < found.ray_urad < 0.02  # urad; 0.006 measured: a few of the 24 bits
    assert 0.002 < found.height_nm < 0.5  # nm; 0.02 and 0.17 measured
    check_precision_of_scene(setup, device, "fp32", name)


def patch():
    """A flat of 20 m, looked at from 0.4 m at a place 4 m from its vertex: a float has steps of 0.24 um there."""
    scene, x = load_scene("sphere"), 4e3
    mirror = Mirror(radius_mm=1e12, diameter_mm=2e4)
    screen = dataclasses.replace(scene.screen, position_mm=(x + 20, 0.0, 400.0), look_at_mm=(x, 0.0, 0.0))
    camera = dataclasses.replace(scene.camera, position_mm=(x - 20, 0.0, 400.0), look_at_mm=(x, 0.0, 0.0),
                                 focus_distance_mm=400.0)  # fmt: skip
    return dataclasses.replace(scene, mirror=mirror, screen=screen, camera=camera)


@pytest.mark.parametrize("scene", [coarse("off-axis", 41), large_segment(41)], ids=["off-axis", "segment"])
def test_the_height_is_the_one_that_the_same_rays_lose_in_a_measurement(device, scene):
    """Two traces of the same rays in both precisions, measured: every pixel counts, not one in a few."""
    if not device.has_fp64:
        pytest.skip("the device has no double precision")
    setup = Setup(scene)
    options = TraceOptions("adjoint", "philox", "fp32")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RoundingWarning)
        stack = trace(setup, device=device, rays_per_pixel=64).images(LineScan(scene))
        lost = rounding_height_nm(reconstruct(stack, setup.nominal), setup, options, device)
    found = rounding_error(setup, device, "fp32")
    assert found.noise_nm < 0.2 * found.height_nm
    assert found.height_nm == pytest.approx(lost, rel=0.2)  # 1 to 5 % measured; one pixel in four is looked at


def test_a_large_mirror_loses_more_height_than_its_rays_tell(device):
    small, large = (rounding_error(Setup(scene), device, "fp32") for scene in (load_scene("sphere"), large_segment()))
    assert large.ray_urad < small.ray_urad  # the old measure: no reason to refuse
    assert large.height_nm > 20 * small.height_nm


def test_rays_of_a_small_patch_are_coarse_and_cost_no_height(device):
    found = rounding_error(Setup(patch()), device, "fp32")
    assert found.ray_urad > 0.1
    assert found.height_nm < 0.1
    check_precision_of_scene(patch(), device, "fp32", "patch.toml")


def test_double_precision_is_exact_and_never_refused(device):
    if not device.has_fp64:
        pytest.skip("the device has no double precision")
    assert rounding_error(Setup(patch()), device, "fp64").ray_urad < 1e-6  # 2^-53 of 4 m over 0.4 m
    check_precision_of_scene(large_segment(), device, "fp64", "segment.toml", 2**24, False)


def test_rounding_that_rules_over_the_ray_noise_is_refused(device):
    setup = Setup(large_segment())
    rounding = rounding_error(setup, device, "fp32").height_nm
    assert rounding > SMALL_NM
    many = int(16384 * (4 * ray_noise_nm(setup, 16384) / rounding) ** 2)  # ray noise of a quarter of the rounding
    message = r"precision = 'fp32': segment\.toml: rounding would add .* nm rms to the height, .*; must be fp64"
    with pytest.raises(ValueError, match=message):
        check_precision_of_scene(setup, device, "fp32", "segment.toml", many)
    check_precision_of_scene(setup, device, "fp32", "segment.toml", many // 100)


def test_the_ray_noise_is_that_of_a_measurement(device):
    """Scatter of the height between replicates of a trace, against lengths alone."""
    scene = coarse("sphere", 25)
    stack = trace(scene, device=device, rays_per_pixel=4096, replicates=8).images(LineScan(scene))
    result = reconstruct(stack, scene)
    scatter = np.sqrt(np.nanmean(result.height_standard_error_mm() ** 2)) * 1e6
    assert ray_noise_nm(Setup(scene), 4096) == pytest.approx(scatter, rel=0.35)  # low orders of eight maps: 20 %


def test_a_trace_warns_where_it_loses_height(device):
    assert rounding_scale_nm(Setup(large_segment())) > SUSPECT_NM
    with pytest.warns(RoundingWarning, match=r"precision fp32: segment: rounding adds .* nm rms to the height"):
        trace(large_segment(), device=device, rays_per_pixel=8)


def test_a_trace_looks_at_no_ray_where_lengths_exclude_a_loss(device, monkeypatch):
    monkeypatch.setattr(module, "PathProbe", None)
    for name in SEQUENTIAL:
        assert rounding_scale_nm(Setup(load_scene(name))) < SUSPECT_NM
    trace(coarse("sphere", 9), device=device, rays_per_pixel=8)


def test_a_ray_lost_to_overflow_counts_as_infinite_error(device, monkeypatch):
    probe = module.PathProbe

    class Lost(probe):
        def __call__(self, *given):
            paths = super().__call__(*given)
            paths.landing[0, len(paths.on_mirror) // 2] = float("nan")
            return paths

    monkeypatch.setattr(module, "PathProbe", Lost)
    found = rounding_error(Setup(load_scene("sphere")), device, "fp32")
    assert found.height_nm == found.ray_urad == float("inf")
    with pytest.raises(ValueError, match="must be fp64"):
        check_precision_of_scene(load_scene("sphere"), device, "fp32", "sphere")
