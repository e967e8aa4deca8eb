"""Images of which little is stored: short light curves that hold all light, and the same surface from them."""

from __future__ import annotations

import dataclasses

import h5py
import numpy as np
import pytest
from scenes import coarse, with_part
from tracers import setup_of

from irtscots_cl.formats.sparse_hdf5 import stored_tiles
from irtscots_cl.imaging.image_files import read_images
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.lit_images import lit_curves
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.report.result_file import write_result
from irtscots_cl.tracing.trace import trace


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A wide screen whose middle alone is lit, its images, the surface, and the file of them."""
    scene = with_part(coarse("sphere-deviated", 25), "screen", pixels=(90, 70))
    detector = dataclasses.replace(scene.camera.detector, orientation="quarter-turn")
    scene = with_part(scene, "camera", detector=detector, look_at_mm=(20.0, -35.0, 0.0))
    stack = trace(scene, estimator="analytic").images(LineScan(scene))
    result = measure_by("likelihood", stack, setup_of(scene).nominal)
    path = tmp_path_factory.mktemp("files") / "result.h5"
    write_result(path, stack, result, {"scene": "a"})
    return scene, stack, result, path


def test_images_come_back_as_short_light_curves(written):
    scene, stack, _, path = written
    again = read_images(path, scene)
    for one, other in ((again.x, stack.x), (again.y, stack.y)):
        assert one.flux_w.shape[2] <= other.flux_w.shape[2]
        assert one.lines.min() >= 0 and one.lines.max() < len(one.positions_mm)
        for line in range(len(one.positions_mm)):
            np.testing.assert_array_equal(one.image(line), other.image(line))
        whole = one.of_all_lines()
        assert whole.flux_w.shape == (1, 25 * 25, len(one.positions_mm))
        assert whole.of_all_lines() is whole
        np.testing.assert_array_equal(whole.image(40), other.image(40))


@pytest.mark.parametrize("measure", ["paper", "likelihood"])
def test_the_surface_is_that_of_whole_images(written, measure):
    scene, _, _, path = written
    lit = read_images(path, scene)
    whole = ImageStack(lit.x.of_all_lines(), lit.y.of_all_lines())
    one, other = (measure_by(measure, stack, setup_of(scene).nominal) for stack in (lit, whole))
    np.testing.assert_array_equal(one.flags, other.flags)
    np.testing.assert_allclose(one.deviation_mm, other.deviation_mm, rtol=0, atol=1e-11)  # mm: rounding of 500 mm


def test_an_infinite_value_is_named_by_its_place_in_the_file(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        images = file.create_dataset("images/x", (40, 8, 8), "f8", chunks=(2, 4, 4))
        images[21, 6, 5] = np.inf
        with pytest.raises(ValueError, match=r"^images/x\[21, 6, 5\] = inf: must be"):
            lit_curves(images, stored_tiles(images), "images/x")


def test_light_at_the_last_line_stays_on_the_scan(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        images = file.create_dataset("images/x", (40, 2, 2), "f8", chunks=(2, 1, 1))
        images[39, 0, 0], images[10:16, 0, 1], images[0, 1, 1] = 5.0, np.arange(1.0, 7.0), 3.0
        first, curves = lit_curves(images, stored_tiles(images), "images/x")
        values = images[()].reshape(40, 4)
    assert curves.shape == (4, 6) and (first + 6 <= 40).all()
    for pixel in range(4):
        np.testing.assert_array_equal(curves[pixel], values[first[pixel] : first[pixel] + 6, pixel])
        assert np.count_nonzero(curves[pixel]) == np.count_nonzero(values[:, pixel])
