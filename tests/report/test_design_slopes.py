"""Slopes less the design's."""

from __future__ import annotations

import numpy as np
from synthetic import noise_free_stack, small_scene

from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.report.design_slopes import slopes_from_design


def test_they_are_the_slopes_less_a_sphere_s_at_the_same_points():
    scene = small_scene(pixels=21)
    result = reconstruct(noise_free_stack(scene), scene.nominal())
    x, y, mask = result.x_mm, result.y_mm, result.mask
    depth = np.sqrt(abs(scene.mirror.radius_mm) ** 2 - x**2 - y**2)
    for axis, slope, place in (("x", result.slope_x, x), ("y", result.slope_y, y)):
        off = slopes_from_design(result)[axis]
        np.testing.assert_allclose(off[mask], (slope - place / depth)[mask], atol=1e-12)  # rounding of 0.13 rad
        assert np.isnan(off[~mask]).all() and np.nanmax(np.abs(off)) < 1e-4
