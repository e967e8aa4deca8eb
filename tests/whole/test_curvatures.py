"""The whole chain for mirrors that are not concave, or have a map: estimators agree, a deviation is recovered, and what
is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import coarse, scene_of, with_part
from significance import poisson_ratio_p, sidak_p, sidak_z
from tracers import setup_of

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.opencl.structs import WEIGHT_ONE
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.tracing.packing.scene import pack
from irtscots_cl.tracing.trace import trace

FAILURE_CHANCE = 1e-6  # of all statistical statements of this file together
NAMES = ("convex", "flat", "lopsided-convex", "sideways", "mapped")
STATEMENTS = 3 * len(NAMES) + 2 * 3
CHANCE = FAILURE_CHANCE / STATEMENTS


def large_pixels(name):
    """The scene with fewer and larger pixels of screen and detector, and an aperture that takes more light."""
    scene = scene_of(name)
    shrink = {"convex": 10, "flat": 10, "lopsided-convex": 3, "sideways": 8, "mapped": 10}[name]
    screen = scene.screen
    screen = replace(screen, pixels=tuple(n // shrink for n in screen.pixels), pitch_mm=screen.pitch_mm * shrink)
    scene = with_part(replace(scene, screen=screen), "camera", aperture_diameter_mm=25.0)
    detector, fewer = scene.camera.detector, {"lopsided-convex": 2}.get(name, 4)
    detector = replace(detector, pixels=tuple(n // fewer for n in detector.pixels), pitch_mm=detector.pitch_mm * fewer)
    return with_part(scene, "camera", detector=detector)


@pytest.mark.parametrize("name", NAMES)
def test_forward_and_adjoint_rays_agree_in_every_bin(device, name):
    """Given a bin's sum the forward count is binomial; the adjoint scatters at most as Poisson."""
    scene = large_pixels(name)
    pixels = int(np.prod(scene.screen.pixels))
    rays = 2**28 // pixels, 4096
    forward = trace(scene, device=device, estimator="forward", rays_per_pixel=rays[0], replicates=1, seed=31)
    adjoint = trace(scene, device=device, estimator="adjoint", rays_per_pixel=rays[1], replicates=1, seed=32)
    np.testing.assert_array_equal(forward.windows.origins, adjoint.windows.origins)
    shape = forward.counts.shape[1:]
    of_forward = np.broadcast_to(rays[0] / forward.unit_w, shape)
    of_adjoint = np.broadcast_to(rays[1] / (adjoint.unit_w * WEIGHT_ONE), shape)
    share = of_forward / (of_forward + of_adjoint)
    first = forward.counts[0].astype(np.int64)
    second = np.rint(adjoint.counts[0] / WEIGHT_ONE).astype(np.int64)
    lit = first + second > 0
    p = poisson_ratio_p(first[lit], second[lit], share[lit])
    assert len(p) > 1000 and first.sum() > 20_000
    assert p.min() > sidak_p(len(p), CHANCE)
    contrast = first * (1 - share) - second * share
    variance = (first + second) * share * (1 - share)
    z = contrast.sum((1, 2)) / np.sqrt(np.maximum(variance.sum((1, 2)), 1e-30))
    enough = (first + second).sum((1, 2)) * share.mean((1, 2)) > 25
    assert np.abs(z[enough]).max() < sidak_z(int(enough.sum()), CHANCE)
    assert abs(contrast.sum() / np.sqrt(variance.sum())) < sidak_z(1, CHANCE)


@pytest.mark.parametrize("name", ["convex", "flat", "mapped"])
def test_light_curves_in_closed_form_are_those_of_many_rays(device, name):
    """By place in the light curve, over all pixels that see nothing but mirror: to 1e-5 of the peak."""
    if not device.has_fp64:
        pytest.skip("the device has no double precision")
    scene = scene_of(name)
    exact = trace(scene, estimator="analytic")
    run = trace(scene, device=device, sampler="sobol", precision="fp64", smoothing=True, rays_per_pixel=2**13,
                replicates=8, seed=4)  # fmt: skip
    np.testing.assert_array_equal(run.windows.origins, exact.windows.origins)
    whole = setup_of(scene).chief_rays.footprint.coverage.ravel()[exact.windows.pixels] == 1
    for axis in "xy":
        curve, of_rays = exact.line_flux_w(axis)[0], run.line_flux_w(axis)
        used = whole & (curve.sum(1) > 0)
        assert used.sum() > 6000
        difference = (of_rays - curve)[:, used] / curve.max()
        offset = (np.arange(curve.shape[1]) - np.argmax(curve, axis=1)[:, None])[used]
        places = [k for k in range(-6, 7) if np.sum(offset == k) > 500]
        assert len(places) >= 3
        for k in places:
            means = difference[:, offset == k].mean(1)  # of replicates
            error = means.std(ddof=1) / np.sqrt(8)
            # 10 standard errors of eight replicates: Student's t with 7 degrees, failure chance 2e-5
            assert abs(means.mean()) < 1e-5 + 10 * error
            assert error < 1e-5  # so this tells something


@pytest.mark.parametrize(
    ("name", "measure", "limit_nm"),
    [
        ("flat", "fine", 4.0),
        ("convex", "fine", 6.0),
        pytest.param("flat", "refined", 0.05, marks=pytest.mark.slow),
        pytest.param("convex", "refined", 0.05, marks=pytest.mark.slow),
    ],
)
def test_a_deviation_is_recovered(name, measure, limit_nm):
    """Without noise; a deviation of 400 nm rms seen at 20 degrees. Heights without piston and tilt, as predicted."""
    scene = coarse(scene_of(name), 40)
    stack = trace(scene, estimator="analytic").images(LineScan(scene))
    found = compare(measure_by(measure, stack, scene.nominal()), scene)
    assert found.height_error_nm["piston_tilt"].value < limit_nm


def test_a_flat_mirror_has_a_kernel_of_its_own_and_a_convex_one_the_spheres():
    kinds = {name: pack(ChiefRays(scene_of(name)), "fp32").choices["surface"] for name in NAMES}
    assert kinds == {"convex": "sphere", "flat": "flat", "lopsided-convex": "off_axis", "sideways": "flat",
                     "mapped": "sphere"}  # fmt: skip


# --- what is refused ---------------------------------------------------------------------------------------


def test_a_screen_that_reaches_below_the_mirror_cannot_be_followed_forward(device):
    scene = with_part(large_pixels("sideways"), "screen", pixels=(35, 20))  # down to z = -100
    with pytest.raises(ValueError, match="pixels of the screen are at z = -100 mm; must be above the whole mirror"):
        trace(scene, device=device, estimator="forward", rays_per_pixel=8)
    trace(scene, device=device, estimator="adjoint", rays_per_pixel=8)


def test_light_wider_than_the_screen_is_named_where_no_pixel_can_be_used(device):
    """A ball of 20 mm in large pixels: each of them sees more of the screen's plane than the screen has."""
    scene = scene_of("convex")
    ball = replace(scene.mirror, radius_mm=-10.0, diameter_mm=18.0, zernike=())
    camera = replace(scene.camera, detector=replace(scene.camera.detector, pixels=(9, 9), pitch_mm=0.1))
    scene = replace(scene, mirror=ball, camera=camera)
    stack = trace(scene, device=device, rays_per_pixel=512).images(LineScan(scene))
    with pytest.raises(ValueError, match="a pixel sees .* mm of the screen's plane at a time and the screen has 875 x"):
        reconstruct(stack, scene)


def test_pixels_whose_light_passes_the_screen_are_left_out(device):
    """A screen that stands beside a convex mirror: the rays of the other half of the mirror run away from it."""
    scene = scene_of("convex")
    screen = replace(scene.screen, position_mm=(700.0, 0.0, 800.0), look_at_mm=(0.0, 0.0, 800.0))
    camera = replace(scene.camera, position_mm=(0.0, 0.0, 1000.0))
    mirror = Mirror(radius_mm=-300.0, diameter_mm=200.0)
    scene = coarse(replace(scene, mirror=mirror, screen=screen, camera=camera), 50)
    run = trace(scene, device=device, rays_per_pixel=512)
    assert run.ledger["off_screen"] > run.ledger["detected"]
    found = reconstruct(run.images(LineScan(scene)), scene)
    assert 50 < found.pixels_used < 0.5 * found.on_mirror.sum() and found.x_mm[found.mask].min() > 20.0
    assert np.isfinite(found.deviation_mm[found.height_mask]).all()
    assert np.isnan(found.setup.chief_rays.corners[1]).any()
