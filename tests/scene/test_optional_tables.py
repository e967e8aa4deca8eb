"""The tables of noise in a scene file and in a file of their own: what is taken, and what is refused in one line."""

from __future__ import annotations

import dataclasses
import tomllib

import pytest
from fuzz import NUMBERS, OTHERS, TEXTS
from loaded_modules import loaded_modules
from refusals import BASE, changed, refusal

from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene, with_noise_file
from irtscots_cl.scene.screen_response import ScreenResponse
from irtscots_cl.scene.validation import SceneError

NOISE = ("camera", "detector", "noise")
RESPONSE = ("screen", "response")
CAMERA = {
    "electrons_at_peak": 8000.0, "exposure_s": 0.1, "shot_noise": True, "prnu": 0.01, "dark_current_e_per_s": 2.0,
    "hot_pixel_share": 0.001, "hot_pixel_e": 100.0, "dead_pixel_share": 0.001, "read_noise_e": 4.0,
    "full_well_e": 1e4, "gain_e_per_dn": 2.5, "offset_dn": 64.0, "bits": 12, "justification": "left",
    "frames_averaged": 8, "dark_frames": 16, "exposures": 4, "seed": 7,
}  # fmt: skip
DISPLAY = {
    "brightness_polynomial": [0.1, 0.0, -0.05, 0.0, 0.02], "grey_level": 0.5, "gamma": 2.2, "drift": 0.05,
    "jitter": 0.01, "dead_pixels": [[3, 4]], "dead_columns": [1], "dead_rows": [2, 5], "dead_pixel_share": 0.01,
    "dead_line_share": 0.02, "seed": 3,
}  # fmt: skip


def with_tables(noise=None, response=None):
    data = changed(*NOISE, to=noise) if noise is not None else changed("name", to="x")
    if response is not None:
        data["screen"]["response"] = response
    return data


def written(tmp_path, text):
    path = tmp_path / "camera.toml"
    path.write_text(text, encoding="utf-8")
    return path


# --- what is taken ------------------------------------------------------------------------------------------


def test_a_scene_has_no_noise_by_default():
    scene = Scene.from_dict(BASE)
    assert scene.camera.detector.noise is None and scene.screen.response is None
    assert "noise" not in scene.to_toml() and "response" not in scene.to_toml()


def test_both_tables_become_checked_values():
    scene = Scene.from_dict(with_tables(CAMERA, DISPLAY))
    assert scene.camera.detector.noise == DetectorNoise(**CAMERA)
    response = scene.screen.response
    assert isinstance(response, ScreenResponse)
    assert (response.dead_pixels, response.dead_rows) == (((3, 4),), (2, 5))
    with pytest.raises(dataclasses.FrozenInstanceError):
        response.drift = 0.0


def test_toml_text_loads_back_to_an_equal_scene():
    scene = Scene.from_dict(with_tables(CAMERA, DISPLAY))
    assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene
    assert hash(scene) == hash(Scene.from_dict(tomllib.loads(scene.to_toml())))


def test_the_design_keeps_camera_and_screen():
    scene = Scene.from_dict(with_tables(CAMERA, DISPLAY))
    assert (scene.nominal().camera, scene.nominal().screen) == (scene.camera, scene.screen)


@pytest.mark.parametrize(("steps", "key"), [(NOISE, "quantum_efficiency_map"), (RESPONSE, "brightness_map")])
def test_paths_of_maps_are_relative_to_the_file(steps, key):
    table = {key: "maps/one.npy"} | ({"electrons_at_peak": 1.0} if steps == NOISE else {})

    def found(source):
        scene = Scene.from_dict(changed(*steps, to=table), source)
        return getattr(scene.camera.detector.noise or scene.screen.response, key)

    assert found("tests/of/my.toml") == "tests/of/maps/one.npy"
    assert found("/lab/my.toml") == "/lab/maps/one.npy"
    assert found("my.toml") == "maps/one.npy"
    table[key] = "/lab/one.npy"
    assert found("tests/of/my.toml") == "/lab/one.npy"


def test_a_file_of_noise_takes_the_place_of_the_scene_s_own_tables(tmp_path):
    scene = Scene.from_dict(with_tables(CAMERA, DISPLAY))
    path = written(tmp_path, "[camera.detector.noise]\nelectrons_at_peak = 5.0\nshot_noise = true\n")
    noisy = with_noise_file(scene, path)
    assert noisy.camera.detector.noise == DetectorNoise(electrons_at_peak=5.0, shot_noise=True)  # nothing is mixed
    assert noisy.screen == scene.screen  # the file has no table for it
    path = written(tmp_path, "[screen.response]\ndrift = 0.5\n")
    assert with_noise_file(scene, path).screen.response == ScreenResponse(drift=0.5)
    assert with_noise_file(scene, path).camera == scene.camera


def test_a_scene_without_noise_imports_nothing_of_it():
    loaded = loaded_modules("import irtscots_cl as irt; irt.load_scene('sphere')")
    assert "irtscots_cl.scene.instrument" in loaded
    names = ("optional_tables", "detector_noise", "screen_response")
    assert not {f"irtscots_cl.scene.{name}" for name in names} & loaded


# --- what is refused ----------------------------------------------------------------------------------------

NOT_BELOW_0 = "a finite number at least 0 and at most 1e+12"
SHARE = "a finite number at least 0 and at most 1"
EXPOSURE = "be given, or electrons_at_peak, to turn flux into electrons"


@pytest.mark.parametrize(
    ("key", "value", "must"),
    [
        ("electrons_at_peak", 0.0, "be a finite number above 0 and at most 1e+12"),
        ("electrons_at_peak", True, "be a finite number above 0 and at most 1e+12"),
        ("read_noise_e", -1.0, f"be {NOT_BELOW_0}"),
        ("dark_current_e_per_s", float("nan"), f"be {NOT_BELOW_0}"),
        ("prnu", 1.5, f"be {SHARE}"),
        ("hot_pixel_share", -0.1, f"be {SHARE}"),
        ("dead_pixel_share", 2, f"be {SHARE}"),
        ("shot_noise", 1, "be true or false"),
        ("bits", 17, "be an integer from 1 to 16"),
        ("bits", 12.0, "be an integer from 1 to 16"),
        ("justification", "middle", "be right or left"),
        ("frames_averaged", 0, "be an integer from 1 to 10000"),
        ("dark_frames", -1, "be an integer from 0 to 10000"),
        ("exposures", 1001, "be an integer from 1 to 1000"),
        ("gain_e_per_dn", 0, "be a finite number at least 1e-06 and at most 1e+12"),
        ("full_well_e", 0, "be a finite number above 0 and at most 1e+12"),
        ("seed", -1, "be an integer from 0 to 2^63 - 1"),
        ("quantum_efficiency_map", 3, "be the path of an NPY file"),
        ("quantum_efficiency", 0.5, "be left out with electrons_at_peak, which states the exposure"),
        ("wavelength_nm", 550.0, "be left out with electrons_at_peak, which states the exposure"),
        ("offset_dn", 5000.0, "be at most 4095, the largest number of the bits"),
        ("hot_pixel_e", 0.0, "be above 0: hot_pixel_share and hot_pixel_e go together"),
    ],
)
def test_a_value_of_the_detector_out_of_range_is_refused_in_one_line(key, value, must):
    line = refusal(with_tables({**CAMERA, key: value}))
    assert line == f"my.toml: camera.detector.noise.{key} = {value!r}: must {must}"


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"shot_noise": True}, f"exposure_s = None: must {EXPOSURE}"),
        ({"read_noise_e": 3.0, "exposure_s": 0.1}, f"quantum_efficiency = None: must {EXPOSURE}"),
        (
            {"bits": 8, "exposure_s": 0.1, "quantum_efficiency": 0.5},
            f"wavelength_nm = None: must {EXPOSURE}",
        ),
        (
            {"electrons_at_peak": 1.0, "dark_current_e_per_s": 2.0},
            "exposure_s = None: must be given with dark_current_e_per_s",
        ),
        (
            {"electrons_at_peak": 1.0, "hot_pixel_e": 2.0},
            "hot_pixel_share = 0.0: must be above 0: hot_pixel_share and hot_pixel_e go together",
        ),
        (
            {"electrons_at_peak": 1.0, "justification": "left"},
            "justification = 'left': must be left out without bits",
        ),
        ({"read_nose_e": 1.0}, ": unknown key; did you mean read_noise_e?"),
    ],
)
def test_values_of_the_detector_that_do_not_fit_together_are_refused(table, line):
    joined = "camera.detector.noise" + ("" if line.startswith(":") else ".")
    expected = line if not line.startswith(":") else ".read_nose_e" + line
    assert refusal(with_tables(table)) == f"my.toml: {joined}{expected}"


@pytest.mark.parametrize(
    ("key", "value", "must"),
    [
        ("drift", 1.5, "be a finite number at least -1 and at most 1"),
        ("jitter", -0.1, f"be {SHARE}"),
        ("gamma", 0.0, "be a finite number above 0 and at most 10"),
        ("grey_level", 0.0, "be a finite number above 0 and at most 1"),
        (
            "brightness_polynomial",
            [0.1, 0.2],
            "be [x, y, xx, xy, yy], five finite numbers within 1000",
        ),
        ("dead_pixels", [[1]], "be an array of [column, row], counted from 0"),
        ("dead_pixels", [[1, -1]], "be an array of [column, row], counted from 0"),
        ("dead_rows", 3, "be an array of integers from 0 to 16383"),
        ("dead_pixel_share", 1.1, f"be {SHARE}"),
        ("brightness_map", "", "be the path of an NPY file"),
    ],
)
def test_a_value_of_the_screen_out_of_range_is_refused_in_one_line(key, value, must):
    line = refusal(with_tables(response={key: value}))
    assert line == f"my.toml: screen.response.{key} = {value!r}: must {must}"


@pytest.mark.parametrize(
    ("key", "value", "shown", "must"),
    [
        ("dead_columns", [0, 21], "21", "be below 21, the number of the screen's lines"),
        ("dead_rows", [17], "17", "be below 17, the number of the screen's lines"),
        ("dead_pixels", [[20, 16], [21, 0]], "[21, 0]", "lie on the screen of 21 columns, 17 rows"),
        ("dead_pixels", [[0, 17]], "[0, 17]", "lie on the screen of 21 columns, 17 rows"),
    ],
)
def test_dead_lines_and_pixels_lie_on_the_screen(key, value, shown, must):
    data = changed("screen", "pixels", to=[21, 17])
    data["screen"]["response"] = {key: value}
    assert refusal(data) == f"my.toml: screen.response.{key} = {shown}: must {must}"


@pytest.mark.parametrize("steps", [NOISE, RESPONSE])
@pytest.mark.parametrize("value", [3, [], "on"])
def test_what_is_no_table_is_refused(steps, value):
    path = ".".join(steps)
    assert refusal(changed(*steps, to=value)) == f"my.toml: {path} = {value!r}: must be a table [{path}]"


def test_constructors_of_screen_and_detector_take_no_other_object():
    scene = load_scene("sphere")
    for part in (scene.screen, scene.camera.detector):
        key = "response" if part is scene.screen else "noise"
        with pytest.raises(SceneError, match=f"{key} = 3: must be a"):
            dataclasses.replace(part, **{key: 3})


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "has no noise; must have a table [camera.detector.noise] or [screen.response]"),
        ("[noise]\nprnu = 0.1\n", "noise: unknown key; allowed: camera, screen"),
        ("[camera]\npixels = [1, 1]\n", "camera.pixels: unknown key; allowed: detector"),
        ("[camera.detector]\npitch_mm = 0.1\n", "camera.detector.pitch_mm: unknown key; allowed: noise"),
        ("screen = 3\n", "screen = 3: must be a table [screen]"),
        ("[screen.respons]\n", "screen.respons: unknown key; did you mean response?"),
        (
            "[screen.response]\ndrift = 2.0\n",
            "screen.response.drift = 2.0: must be a finite number at least -1 and at most 1",
        ),
        (
            "[camera.detector.noise]\nbits = 12\n",
            f"camera.detector.noise.exposure_s = None: must {EXPOSURE}",
        ),
    ],
)
def test_a_file_of_noise_with_anything_else_is_refused(tmp_path, text, line):
    path = written(tmp_path, text)
    with pytest.raises(SceneError) as caught:
        with_noise_file(load_scene("sphere"), path)
    assert str(caught.value) == f"{path}: {line}"


@pytest.mark.parametrize("kind", [DetectorNoise, ScreenResponse])
def test_any_value_of_any_key_is_taken_or_refused_in_one_line(tmp_path, kind):
    scene, heading = load_scene("sphere"), ".".join(NOISE if kind is DetectorNoise else RESPONSE)
    taken = 0
    for k, key in enumerate(kind.__pydantic_fields__):
        for value in (NUMBERS + TEXTS + OTHERS)[k % 4 :: 4]:  # a quarter for each key: enough, and four times as fast
            path = written(tmp_path, f"[{heading}]\n{key} = {value}\n")
            try:
                with_noise_file(scene, path).to_toml()
                taken += 1
            except SceneError as refused:
                assert str(refused).startswith(f"{path}: ") and str(refused).isprintable()
    assert taken > 20  # some values are good


def test_what_is_off_and_what_is_not():
    assert DetectorNoise().is_off and DetectorNoise(electrons_at_peak=5.0, frames_averaged=3, exposures=2).is_off
    for key in ("shot_noise", "prnu", "read_noise_e", "offset_dn", "full_well_e", "bits", "dead_pixel_share"):
        assert not DetectorNoise(electrons_at_peak=5.0, **{key: CAMERA[key]}).is_off, key
    assert not DetectorNoise(electrons_at_peak=5.0, exposure_s=1.0, dark_current_e_per_s=1.0).is_off
    assert not DetectorNoise(electrons_at_peak=5.0, hot_pixel_share=0.1, hot_pixel_e=1.0).is_off
    assert not DetectorNoise(electrons_at_peak=5.0, quantum_efficiency_map="x.npy").is_off
    full_on = ScreenResponse(gamma=2.2, seed=5)  # gamma without effect
    assert not (full_on.needs_map or full_on.changes_frames)
    assert ScreenResponse(grey_level=0.5, gamma=2.0).level == 0.25
