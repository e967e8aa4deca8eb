"""Images in files that lie in any of the eight orientations, and under lines of any width: written and read back."""

from __future__ import annotations

import dataclasses

import h5py
import numpy as np
import pytest
from scenes import coarse, with_part
from tracers import setup_of

from irtscots_cl.imaging.image_files import read_images
from irtscots_cl.imaging.orientation import TRANSPOSED
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.report.result_file import write_result
from irtscots_cl.scene.instrument import ORIENTATIONS, Detector
from irtscots_cl.scene.screen_shape import ScanLines
from irtscots_cl.tracing.trace import trace

# The same written out, of an array [rows, columns]: what a file of each word holds of an upright one.
LIES = {
    "upright": lambda a: a,
    "rows-reversed": lambda a: np.flipud(a),
    "columns-reversed": lambda a: np.fliplr(a),
    "half-turn": lambda a: np.rot90(a, 2),
    "transposed": lambda a: np.transpose(a),
    "quarter-turn": lambda a: np.rot90(a, -1),
    "three-quarter-turn": lambda a: np.rot90(a, 1),
    "transposed-half-turn": lambda a: np.rot90(np.transpose(a), 2),
}


def scene_of(orientation: str, pixels=(23, 15), lines=None):
    """A deviated mirror off the middle of a detector that need not be square."""
    scene = coarse("sphere-deviated", 25)
    detector = Detector(pixels=pixels, pitch_mm=scene.camera.detector.pitch_mm, orientation=orientation)
    scene = with_part(scene, "camera", detector=detector, look_at_mm=(20.0, -35.0, 0.0))
    return with_part(scene, "screen", lines=lines)


def measured(orientation: str, pixels):
    scene = scene_of(orientation, pixels)
    stack = trace(scene, estimator="analytic").images(LineScan(scene))
    return scene, stack, measure_by("paper", stack, setup_of(scene).nominal)


@pytest.mark.parametrize("pixels", [(23, 15), (19, 19)])
@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_images_and_maps_lie_in_the_file_as_the_scene_says_and_come_back(tmp_path, orientation, pixels):
    scene, stack, result = measured(orientation, pixels)
    assert result.pixels_used > 150
    write_result(tmp_path / "result.h5", stack, result, {"scene": "a"})
    lies = LIES[orientation]
    with h5py.File(tmp_path / "result.h5") as file:
        assert file.attrs["orientation"] == orientation
        columns, rows = pixels[::-1] if orientation in TRANSPOSED else pixels
        assert file["images/x"].shape == (21, rows, columns) and file["mask"].shape == (rows, columns)
        for name, values in (("mirror/y_mm", result.y_mm), ("deviation_nm", result.deviation_mm * 1e6),
                             ("mask", result.mask), ("centroid/x_mm", result.centroid_x_mm),
                             ("slope/y_rad", result.slope_y)):  # fmt: skip
            np.testing.assert_array_equal(file[name][()], lies(values))
        for line in (7, 10):
            np.testing.assert_array_equal(file["images/y"][line], lies(stack.y.image(line)))
    again = read_images(tmp_path / "result.h5", scene)
    assert again.x.shape == (pixels[1], pixels[0])
    for line in (8, 12):
        np.testing.assert_array_equal(again.x.image(line), stack.x.image(line))
    found = measure_by("paper", again, setup_of(scene).nominal)
    np.testing.assert_array_equal(found.mask, result.mask)
    np.testing.assert_allclose(found.deviation_mm, result.deviation_mm, atol=1e-12)  # other sums of the same samples


def test_without_a_scene_images_are_upright(tmp_path):
    _, stack, result = measured("upright", (23, 15))
    write_result(tmp_path / "result.h5", stack, result, {})
    with h5py.File(tmp_path / "result.h5") as file:
        np.testing.assert_array_equal(read_images(tmp_path / "result.h5").x.image(9), file["images/x"][9])


@pytest.mark.parametrize("orientation", TRANSPOSED)
def test_images_with_rows_and_columns_exchanged_are_refused_with_the_words_to_set(tmp_path, orientation):
    scene, stack, result = measured(orientation, (23, 15))
    write_result(tmp_path / "result.h5", stack, result, {})
    upright = scene_of("upright")
    with pytest.raises(
        ValueError, match=r"images of \(23, 15\) and \(23, 15\) .*, \(15, 23\); rows and columns"
    ) as caught:
        measure_by("paper", read_images(tmp_path / "result.h5", upright), upright.nominal())
    text = str(caught.value)
    assert f'camera.detector.orientation (now "upright") is one of {", ".join(TRANSPOSED)}' in text
    other = dataclasses.replace(scene)  # and the other way round: told transposed, files are not
    write_result(tmp_path / "upright.h5", *measured("upright", (23, 15))[1:], {})
    with pytest.raises(ValueError, match="is one of upright, rows-reversed, columns-reversed, half-turn$"):
        measure_by("paper", read_images(tmp_path / "upright.h5", other), other.nominal())


@pytest.mark.parametrize("lines", [(2, 1, 0), (1, 2, 0), (2, 3, 1)])
def test_the_width_of_lines_is_the_scene_s_and_a_file_of_others_is_refused(tmp_path, lines):
    table = ScanLines(*lines)
    scene = scene_of("rows-reversed", lines=table)
    stack = trace(scene, estimator="analytic").images(LineScan(scene))
    result = measure_by("paper", stack, scene.nominal())
    write_result(tmp_path / "result.h5", stack, result, {})
    again = read_images(tmp_path / "result.h5", scene)
    assert again.x.line_width == again.y.line_width == lines[1] / lines[0]
    found = measure_by("paper", again, scene.nominal())
    np.testing.assert_allclose(found.deviation_mm, result.deviation_mm, atol=1e-12)
    wider = with_part(scene, "screen", lines=ScanLines(lines[0], lines[1] + 1, lines[2]))
    with pytest.raises(ValueError, match="/lines/x_mm: its lines are .* mm wide, those of scene sphere-deviated"):
        read_images(tmp_path / "result.h5", wider)
    with pytest.raises(ValueError, match=r"lines of the x scan are 1 times as wide as far apart.*\[screen.lines\]"):
        measure_by("paper", dataclasses.replace(again, x=dataclasses.replace(again.x, line_width=1.0)), scene.nominal())


@pytest.mark.parametrize(("told", "unit"), [("W", "W"), ("DN", "DN"), (None, "DN")])
def test_images_are_in_the_file_s_unit_and_a_camera_s_counts_where_it_tells_none(tmp_path, told, unit):
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        for axis in "xy":
            file[f"images/{axis}"] = np.ones((3, 4, 5), np.uint16)
            file[f"lines/{axis}_mm"] = np.arange(3.0)
            if told:
                file[f"images/{axis}"].attrs["unit"] = told
    stack = read_images(tmp_path / "lab.h5")
    assert (stack.x.unit, stack.y.unit) == (unit, unit)
