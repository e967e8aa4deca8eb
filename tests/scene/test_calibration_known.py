"""The table [calibration.known]: what is taken, and what is refused in one line."""

from __future__ import annotations

import tomllib

import pytest
from loaded_modules import loaded_modules
from refusals import BASE

from irtscots_cl.scene.calibration_known import Calibration, Knowledge, distance_ends
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError

TEXT = """
"camera.x_mm" = 0.5
camera.y_mm = 1
screen.tilt_x_rad = { sigma = 1e-4, source = "autocollimator" }
"camera to screen" = { mm = 436.1, sigma = 0.05, source = "laser tracker" }
"""


def scene_with(text: str) -> Scene:
    return Scene.from_dict({**BASE, **tomllib.loads(f"[calibration.known]\n{text}")}, "my.toml")


def test_numbers_tables_and_names_without_quotes():
    known = scene_with(TEXT).calibration.known
    assert known == {
        "camera.x_mm": Knowledge(sigma=0.5),
        "camera.y_mm": Knowledge(sigma=1.0),
        "screen.tilt_x_rad": Knowledge(sigma=1e-4, source="autocollimator"),
        "camera to screen": Knowledge(sigma=0.05, mm=436.1, source="laser tracker"),
    }


def test_toml_text_loads_back_to_an_equal_scene():
    scene = scene_with(TEXT)
    again = Scene.from_dict(tomllib.loads(scene.to_toml()))
    assert again == scene and hash(again) == hash(scene) and scene.nominal().calibration == scene.calibration


def test_a_scene_says_nothing_by_default():
    assert Scene.from_dict(BASE).calibration is None and "calibration" not in Scene.from_dict(BASE).to_toml()


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('"camera.x_mm" = -0.5', "calibration.known.'camera.x_mm'.sigma = -0.5: must be a finite number above 0"),
        ('"camera.x_mm" = inf', "calibration.known.'camera.x_mm'.sigma = inf: must be a finite number above 0"),
        ('"camera.x_mm" = "a"', "calibration.known.'camera.x_mm' = 'a': must be a number, or a table"),
        ('"camera.x_mm" = { sigma = 1.0, sorce = "x" }', "calibration.known.'camera.x_mm'.sorce: unknown key; did "),
        ('"camera.x_mm" = { sigma = 1.0, mm = 5.0 }', "calibration.known.'camera.x_mm'.mm = 5.0: must be left out: "),
        ('"camera.x_mm" = { source = "x" }', "calibration.known.'camera.x_mm'.sigma: missing; needs a finite number"),
        ('"camera to camera" = 0.1', "calibration.known.'camera to camera' = 0.1: must be between two different ones"),
        ('"camera.x_mm" = true', "calibration.known.'camera.x_mm'.sigma = True: must be a finite number"),
    ],
)  # fmt: skip
def test_what_cannot_be_known(text, line):
    with pytest.raises(SceneError) as caught:
        scene_with(text)
    assert str(caught.value).startswith(f"my.toml: {line}") and str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("calibration", "line"),
    [
        (1, "calibration = 1: must be a table [calibration]"),
        ({"known": 1}, "calibration.known = 1: must be a table of names"),
        ({"nown": {}}, "calibration.nown: unknown key; did you mean known?"),
    ],
)
def test_what_is_no_table(calibration, line):
    with pytest.raises(SceneError, match=r"^my\.toml: ") as caught:
        Scene.from_dict({**BASE, "calibration": calibration}, "my.toml")
    assert line in str(caught.value)


def test_another_value_in_its_place_is_refused():
    scene = Scene.from_dict(BASE)
    with pytest.raises(SceneError, match=r"calibration = .*must be a Calibration of irtscots_cl\.scene"):
        Scene(scene.name, scene.mirror, scene.screen, scene.camera, calibration={"camera.x_mm": 0.5})
    assert Calibration(known={"camera.x_mm": 0.5}).known["camera.x_mm"].sigma == 0.5


def test_names_of_distances():
    assert distance_ends("camera to screen") == ("camera", "screen")
    assert distance_ends("camera.x_mm") is None and distance_ends("camera to floor") is None


def test_scenes_without_the_table_do_not_import_it():
    loaded = loaded_modules("from irtscots_cl.scene.presets import load_scene; load_scene('sphere')")
    assert "irtscots_cl.scene.model" in loaded and "calibration_known" not in " ".join(loaded)
