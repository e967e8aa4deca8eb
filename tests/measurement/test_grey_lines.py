"""Grey lines against sharp ones, from the same light."""

from __future__ import annotations

import numpy as np
import pytest
from pattern_folders import small_scene

import irtscots_cl as irt
from irtscots_cl.imaging.line_pictures import LineSet, line_values, scene_of_lines
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.imaging.pictures import Pictures
from irtscots_cl.measurement.grey_lines import grey_difference
from irtscots_cl.optics.setup import Setup


@pytest.mark.needs_device
@pytest.mark.parametrize("lines", [LineSet(1, 0.5), LineSet(1.75, 0.75, 0.25)])
def test_the_difference_is_that_of_traced_light(lines):
    """Of the design: grey lines are pictures on its screen, sharp ones lines of a screen with finer pixels."""
    scene = small_scene("sphere")
    frames = lines.series("x", 21)
    own, _ = scene_of_lines([f for axis in "xy" for f in lines.series(axis, 21)], scene)
    pictures = [np.broadcast_to(line_values(f.first_px[0], f.width_px, 21), (21, 21)) for f in frames]
    white = np.ones((1, 21, 21))
    coarse = irt.trace(scene, estimator="analytic")
    grey = coarse.images(Pictures(scene, np.stack(pictures)))
    sharp_scan = irt.trace(own, estimator="analytic").images(LineScan(own)).x
    sharp = np.stack([sharp_scan.image(k) for k in range(len(frames))])
    light = coarse.images(Pictures(scene, white))[0].ravel()
    setup = Setup(own)
    pixels = setup.pixel_light.pixels
    change, first = grey_difference(setup, "x", lines.parts, setup.pixel_light.means("u")[0])
    found = np.zeros((len(frames), len(pixels)))
    for k in range(change.shape[1]):
        found[first + k, np.arange(len(pixels))] = change[:, k]
    inner = setup.chief_rays.footprint.coverage.ravel()[pixels] > 0.99
    wanted = (grey - sharp).reshape(len(frames), -1)[:, pixels[inner]] / light[pixels[inner]]
    assert np.abs(wanted).max() > 1e-3
    np.testing.assert_allclose(found[:, inner], wanted, atol=2e-5)  # of a pixel's light
