"""Mirrors that are no whole disks, simulated and measured: as well as disks, on the pixels that their outline has."""

from __future__ import annotations

import numpy as np
import pytest
from outlined import outline_of
from scenes import coarse, with_part

import irtscots_cl as irt
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.pipeline.measure import measure_by

DIAMETER = 1064.0
HEIGHT_NM = 0.6  # rms without piston and tilt; the disk's is 0.3 here: rays' noise, and a rim of few pixels


def measured(kind, folder, pixels=30):
    mirror = {} if kind is None else {"outline": outline_of(kind, DIAMETER, folder)}
    scene = with_part(coarse("sphere-deviated", pixels), "mirror", **mirror)
    smoothed = kind in (None, "hexagon")
    run = irt.trace(scene, sampler="sobol", smoothing=smoothed, rays_per_pixel=1024, replicates=2, seed=3)
    return scene, measure_by("fine", run.images(irt.LineScan(scene)), scene.nominal())


@pytest.mark.parametrize("kind", [pytest.param(None, marks=pytest.mark.slow), "hexagon"])
def test_a_hexagon_is_measured_as_well_as_a_disk(kind, tmp_path):
    scene, result = measured(kind, tmp_path)
    assert irt.compare(result, scene).height_error_nm["piston_tilt"].value < HEIGHT_NM
    coverage = ChiefRays(scene).footprint.coverage
    np.testing.assert_array_equal(result.mask, coverage >= 0.5)  # the outline, eroded by what is less than half of it


@pytest.mark.slow
def test_pieces_between_spiders_are_islands_with_errors_of_their_own(tmp_path):
    """What is known between them is told: three islands, each with the error of its piston."""
    scene, result = measured("spiders", tmp_path, 60)
    error = irt.compare(result, scene)
    assert result.islands is not None and len(result.islands.sizes) == 3
    assert error.height_error_nm["piston_tilt"].value < 15.0
