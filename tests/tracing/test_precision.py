"""Whether single precision is enough: what the rays say, and the refusal."""

from __future__ import annotations

import dataclasses

import pytest

from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.presets import load_scene, sequential_presets
from irtscots_cl.tracing.checks import precision as module
from irtscots_cl.tracing.checks.precision import MAX_SLOPE_URAD, check_precision_of_scene, rounding_slope_urad


@pytest.mark.parametrize("name", sequential_presets())
def test_presets_are_far_from_the_bound_in_single_precision(name, device):
    error = rounding_slope_urad(Setup(load_scene(name)), device, "fp32")
    assert 1e-4 < error < 0.02  # urad; 0.006 measured: a few of the 24 bits
    check_precision_of_scene(load_scene(name), device, "fp32", name)


def far_from_the_vertex():
    """A flat of 20 m, looked at from 0.4 m at a place 4 m from its vertex: a float has steps of 0.24 um there."""
    scene, x = load_scene("sphere"), 4e3
    mirror = Mirror(radius_mm=1e12, diameter_mm=2e4)
    screen = dataclasses.replace(scene.screen, position_mm=(x + 20, 0.0, 400.0), look_at_mm=(x, 0.0, 0.0))
    camera = dataclasses.replace(scene.camera, position_mm=(x - 20, 0.0, 400.0), look_at_mm=(x, 0.0, 0.0),
                                 focus_distance_mm=400.0)  # fmt: skip
    return dataclasses.replace(scene, mirror=mirror, screen=screen, camera=camera)


def test_double_precision_is_exact_and_never_refused(device):
    if not device.has_fp64:
        pytest.skip("the device has no double precision")
    assert rounding_slope_urad(Setup(far_from_the_vertex()), device, "fp64") < 1e-6  # urad: 2^-53 of 4 m over 0.4 m
    check_precision_of_scene(far_from_the_vertex(), device, "fp64", "far.toml")


def test_a_scene_that_single_precision_cannot_resolve_is_refused(device):
    error = rounding_slope_urad(Setup(far_from_the_vertex()), device, "fp32")
    assert error > MAX_SLOPE_URAD
    with pytest.raises(ValueError, match=r"--precision = 'fp32': far\.toml: .* urad rms per ray, .*; must be fp64"):
        check_precision_of_scene(far_from_the_vertex(), device, "fp32", "far.toml")


def test_a_ray_lost_to_overflow_counts_as_infinite_error(device, monkeypatch):
    probe = module.PathProbe

    class Lost(probe):
        def __call__(self, *given):
            paths = super().__call__(*given)
            paths.landing[0, len(paths.on_mirror) // 2] = float("nan")
            return paths

    monkeypatch.setattr(module, "PathProbe", Lost)
    assert rounding_slope_urad(Setup(load_scene("sphere")), device, "fp32") == float("inf")
