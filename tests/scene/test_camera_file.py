"""[camera.intrinsics] file: a scene's camera from another program's calibration, and back."""

from __future__ import annotations

import pytest

from irtscots_cl.formats.opencv_camera import OpenCvCamera, opencv_yaml
from irtscots_cl.scene.camera_file import intrinsics_from, opencv_camera
from irtscots_cl.scene.presets import load_scene, parse_scene, preset_text
from irtscots_cl.scene.validation import SceneError

CAMERA = OpenCvCamera(433.0, 432.0, 60.3, 63.1, (-0.1, 2.0, 1e-4, -2e-4), (125, 125))


def scene_file(folder, camera, keys=""):
    (folder / "lens").mkdir(exist_ok=True)
    (folder / "lens" / "cal.yml").write_text(opencv_yaml(camera))
    path = folder / "scene.toml"
    path.write_text(preset_text("sphere") + f'\n[camera.intrinsics]\nfile = "lens/cal.yml"\n{keys}')
    return path


def test_a_calibration_goes_into_a_scene_and_out_again(tmp_path):
    scene = load_scene(scene_file(tmp_path, CAMERA))
    assert scene.camera.intrinsics == intrinsics_from(CAMERA)
    assert opencv_camera(scene.camera) == CAMERA
    assert parse_scene(scene.to_toml()) == scene  # the values stand in the scene: the file is not needed again


def test_a_part_of_the_picture_with_joined_pixels(tmp_path):
    whole = OpenCvCamera(866.0, 866.0, 199.0, 150.0, (), (400, 300))
    scene = load_scene(scene_file(tmp_path, whole, "roi_px = [100, 50]\nbinning = [2, 2]\n"))
    assert (scene.camera.intrinsics.roi_px, scene.camera.intrinsics.binning) == ((100, 50), (2, 2))
    assert opencv_camera(scene.camera) == whole


def test_a_plain_camera_has_a_calibration_too():
    camera = load_scene("sphere").camera
    found = opencv_camera(camera)
    assert found.fx == found.fy == pytest.approx(camera.image_distance_mm / camera.detector.pitch_mm)
    assert (found.cx, found.cy, found.distortion, found.image_size_px) == (62.0, 62.0, (), (125, 125))


@pytest.mark.parametrize(
    ("camera", "keys", "message"),
    [
        (CAMERA, "fx = 430.0\n", "camera.intrinsics.fx: the file lens/cal.yml gives it; must stand in one of the two"),
        (CAMERA, "binning = [2, 2]\n", r"roi_px: must be given: the picture of .* has \[125, 125\] .* \[250, 250\]"),
        (OpenCvCamera(433.0, 432.0, 60.3, 63.1, (), (200, 125)), "", "roi_px: must be given: the picture of lens"),
        (CAMERA, "roi = [1, 1]\n", "camera.intrinsics.roi: unknown key"),
        (OpenCvCamera(4330.0, 432.0, 60.3, 63.1, (), (125, 125)), "", "camera.intrinsics.fx = 4330.0: must be within"),
        (OpenCvCamera(433.0, 432.0, 60.3, 63.1, (-30.0, 0, 0, 0), (125, 125)), "", "distortion .* must be one-to-one"),
    ],
)  # fmt: skip
def test_contradictions_are_refused(tmp_path, camera, keys, message):
    path = scene_file(tmp_path, camera, keys)
    with pytest.raises(SceneError, match=message) as caught:
        load_scene(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    path = scene_file(tmp_path, CAMERA)
    (tmp_path / "lens" / "cal.yml").unlink()
    with pytest.raises(
        SceneError, match=r"scene.toml: camera.intrinsics.file: .*lens/cal.yml: cannot be read: No such"
    ):
        load_scene(path)
    path.write_text(path.read_text().replace('"lens/cal.yml"', "7"))
    with pytest.raises(SceneError, match="camera.intrinsics.file = 7: must be the path of a camera calibration"):
        load_scene(path)
