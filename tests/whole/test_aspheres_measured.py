"""An aspheric mirror, simulated and measured back: its terms belong to the design, its deviation is what is found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import coarse, scene_of

import irtscots_cl as irt
from irtscots_cl.optics.surface import Surface

RAYS = 1024  # smoothed, of a lattice: 3 nm of noise at 40 pixels across


def measured(scene, nominal, device):
    run = irt.trace(scene, device=device, rays_per_pixel=RAYS, sampler="sobol", smoothing=True, seed=1)
    return irt.reconstruct(run.images(irt.LineScan(scene)), nominal)


@pytest.fixture(scope="module")
def scene():
    return coarse(scene_of("asphere"), 40)


@pytest.mark.slow
def test_a_mirror_as_designed_measures_as_0(device, scene):
    design = scene.nominal()
    report = irt.compare(measured(design, design, device), design)
    assert report.pixels_used > 1000
    height = report.height_error_nm["piston_tilt"]
    assert height.value < 10  # nm, of terms of 78 um
    assert max(abs(row.output_um) for row in report.zernike if row.noll > 3) < 0.01


@pytest.mark.slow
def test_the_deviation_comes_back(device, scene):
    report = irt.compare(measured(scene, scene.nominal(), device), scene)
    found = {row.noll: (row.input_um, row.output_um) for row in report.zernike}
    for noll, value in scene.mirror.zernike[0].coefficients_um.items():
        assert found[noll][0] == value
        assert found[noll][1] == pytest.approx(value, abs=0.01)  # um; pixels of 10 mm blur term 29
    assert report.height_error_nm["piston_tilt"].value < 30


@pytest.mark.slow
def test_without_the_terms_in_the_design_they_are_the_deviation(device, scene):
    """The measurement takes the design from the nominal scene: the conic's finds the terms as a deviation."""
    made = scene.nominal()
    conic = replace(made, mirror=replace(made.mirror, asphere=None))
    result = measured(made, conic, device)
    x, y = result.x_mm, result.y_mm
    terms = Surface.of(made.mirror).departure_at(np.where(result.mask, x, 0.0), np.where(result.mask, y, 0.0))[0]
    left = (result.deviation_mm - terms)[result.mask]
    basis = np.stack([np.ones_like(left), x[result.mask], y[result.mask]], -1)
    left = left - basis @ np.linalg.lstsq(basis, left, rcond=None)[0]
    # the points that pixels see are a few um off the conic's: some parts in a thousand of the 78 um
    assert np.std(left) < 0.01 * np.std(terms[result.mask])
