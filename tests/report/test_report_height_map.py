"""A result as a map: what a notebook writes is what the command line writes."""

import numpy as np
import pytest
from synthetic import small_scene

import irtscots_cl as irt


@pytest.fixture(scope="module")
def result(device):
    scene = small_scene("sphere-deviated", 25)
    run = irt.trace(scene, device=device, rays_per_pixel=64, replicates=4, seed=1)
    return irt.reconstruct(run.images(irt.LineScan(scene)), scene.nominal())


def test_quantities(result):
    deviation, height = irt.height_map(result), irt.height_map(result, "height")
    assert deviation.pitch_mm == height.pitch_mm and deviation.kind == "surface"
    assert "+ towards camera" in deviation.comment[0] and "interpolated from" in deviation.comment[1]
    # the design's sphere is what lies between, at the map's own places
    x, y = height.positions_mm()
    radius = result.nominal.mirror.radius_mm
    sphere = radius - np.sqrt(radius**2 - x**2 - y**2)
    both = deviation.valid & height.valid
    assert both.sum() > 200
    np.testing.assert_allclose((height.heights_mm - deviation.heights_mm)[both], sphere[both], atol=1e-4)
    error = irt.height_map(result, "standard-error")
    assert (error.heights_mm[error.valid] >= 0).mean() > 0.95
    with pytest.raises(ValueError, match="quantity = 'slope': must be one of deviation, height, standard-error"):
        irt.height_map(result, "slope")


def test_it_is_written_and_read_by_public_names(result, tmp_path):
    given = irt.height_map(result)
    notes = irt.write_map(tmp_path / "part.dat", given)
    assert any("632.8 nm is written as its unit" in note for note in notes)
    found = irt.open_map(tmp_path / "part.dat")
    np.testing.assert_array_equal(found.valid, given.valid)
    assert np.nanmax(np.abs(found.heights_mm - given.heights_mm)) < 0.005e-6  # half a count
    assert isinstance(found, irt.HeightMap) and found.pitch_mm == pytest.approx(given.pitch_mm, rel=1e-6)
