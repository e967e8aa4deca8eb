"""The shipped scenes, and loading by name or from a file."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from irtscots_cl.scene import presets
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene, preset_names, preset_text
from irtscots_cl.scene.validation import SceneError

NAMES = [
    "baffled", "elt-segment", "fsm-on-axis", "ghosts", "gmt-segment", "jwst-segment", "lbt-secondary", "newtonian",
    "off-axis", "sphere", "sphere-deviated", "sphere-doublet", "sphere-singlet", "sphere-window", "vista-secondary",
]  # fmt: skip
KNOWN = f"allowed: {', '.join(NAMES)}, or a path that ends in .toml"


def refusal(name_or_path):
    with pytest.raises(SceneError) as caught:
        load_scene(name_or_path)
    message = str(caught.value)
    assert message.isprintable()  # one line, no control characters
    return message


def test_the_text_of_a_preset_has_no_path():
    with pytest.raises(SceneError) as caught:
        preset_text("mine.toml")
    assert str(caught.value).endswith(f"unknown scene; allowed: {', '.join(NAMES)}")


def test_the_scenes_are_shipped():
    assert preset_names() == NAMES
    for name in preset_names():
        scene = load_scene(name)
        assert scene.name == name
        assert scene == Scene.from_dict(tomllib.loads(preset_text(name)))
        assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene
        assert preset_text(name).startswith("# ")  # says what it is


@pytest.mark.parametrize("name", ["sphere", "sphere-deviated"])
def test_the_sphere_scenes(name):
    scene = load_scene(name)
    mirror, screen, camera = scene.mirror, scene.screen, scene.camera
    assert (mirror.radius_mm, mirror.conic, mirror.diameter_mm) == (4166.747, 0.0, 1064.0)
    assert (mirror.off_axis_mm, mirror.obscuration_mm, mirror.reflectance) == (0.0, 0.0, 1.0)
    assert (screen.position_mm, screen.look_at_mm) == ((218.0707, 0.0, 4161.0366), (0.0, 0.0, 0.0))
    assert (screen.pixels, screen.pitch_mm, screen.centre_offset_mm) == ((21, 21), 0.2, (0.0, 0.0))
    assert (screen.radiance, screen.emission) == (1.0, "lambertian")
    assert (camera.position_mm, camera.look_at_mm) == ((-218.0707, 0.0, 4161.0366), (0.0, 0.0, 0.0))
    assert (camera.aperture_diameter_mm, camera.focal_length_mm) == (1.0, 16.0)
    assert (camera.focus_distance_mm, camera.transmittance) == (None, 1.0)
    assert (camera.detector.pixels, camera.detector.pitch_mm) == ((125, 125), 0.037)


def test_the_deviation_of_the_deviated_sphere_is_all_that_tells_it_from_the_sphere():
    scene = load_scene("sphere-deviated")
    (terms,) = scene.mirror.zernike
    assert (terms.radius_mm, terms.ordering) == (532.0, "noll")
    assert terms.coefficients_um == {6: 0.3266, 8: -0.1414, 9: 0.1061, 11: 0.0894, 29: -0.025, 38: -0.0141}
    sphere, nominal = load_scene("sphere"), scene.nominal()
    assert (nominal.mirror, nominal.screen, nominal.camera) == (sphere.mirror, sphere.screen, sphere.camera)


def test_the_off_axis_scene():
    scene = load_scene("off-axis")
    mirror, screen, camera = scene.mirror, scene.screen, scene.camera
    assert (mirror.radius_mm, mirror.conic, mirror.off_axis_mm) == (4166.747, -0.7154, 1087.74)
    assert (mirror.diameter_mm, mirror.reflectance, mirror.zernike) == (1064.0, 1.0, ())
    assert (screen.position_mm, screen.look_at_mm) == ((35.0, 0.0, 4378.0), (35.0, 0.0, 0.0))
    assert (screen.pixels, screen.pitch_mm, screen.centre_offset_mm) == ((359, 303), 0.2, (28.4, 0.0))
    assert (camera.position_mm, camera.look_at_mm) == ((-35.0, 0.0, 4378.0), (0.0, 0.0, 0.0))
    assert (camera.aperture_diameter_mm, camera.focal_length_mm) == (1.0, 16.0)
    assert (camera.detector.pixels, camera.detector.pitch_mm) == ((125, 125), 0.037)


def test_a_file_is_loaded_by_string_and_by_path(tmp_path, monkeypatch):
    file = tmp_path / "sphere"  # without the suffix only a separator or a Path tells it from the preset
    file.write_text(load_scene("off-axis").to_toml(), encoding="utf-8")
    assert load_scene(str(file)).name == "off-axis"
    monkeypatch.chdir(tmp_path)
    assert load_scene(Path("sphere")).name == "off-axis"
    assert load_scene("sphere").name == "sphere"
    file.rename(tmp_path / "Mine.TOML")
    assert load_scene("Mine.TOML").name == "off-axis"


def test_a_value_in_a_file_is_refused_under_the_file_s_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = preset_text("sphere")
    Path("my.toml").write_text(text.replace("diameter_mm = 1064.0", "diameter_mm = -3.0"), encoding="utf-8")
    assert refusal("my.toml") == (
        "my.toml: mirror.diameter_mm = -3.0: must be a finite number at least 1e-12 and at most 1e+12"
    )
    Path("new\nline.toml").write_text(text.replace('"sphere"', "1"), encoding="utf-8")
    assert refusal("new\nline.toml").startswith(r"new\nline.toml: name = 1: must be 1 to 64 characters")


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("spere", f"spere: unknown scene; did you mean sphere? {KNOWN}"),
        ("qq", f"qq: unknown scene; {KNOWN}"),
        ("", f"'': unknown scene; {KNOWN}"),
        (".", f".: unknown scene; {KNOWN}"),
        (3, "scene: 3: must be a preset name or the path of a TOML file"),
        (None, "scene: None: must be a preset name or the path of a TOML file"),
        ("none.toml", "none.toml: cannot be read: No such file or directory"),
        ("../sphere", "../sphere: cannot be read: No such file or directory"),
        ("\x00.toml", r"\x00.toml: cannot be read: no file can have this name"),
        ("\ud800.toml", r"\ud800.toml: cannot be read: no file can have this name"),
    ],
)
def test_a_wrong_name_is_refused_in_one_line(name, line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert refusal(name) == line


def test_no_preset_name_leads_out_of_the_folder():
    for name in ("../scenes/sphere", "sphere.toml", "/etc/passwd", "scenes"):
        with pytest.raises(SceneError, match="unknown scene"):
            preset_text(name)


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"name = ", "is not valid TOML: Invalid value (at end of document)"),
        (b"name = 'a'\nname = 'b'\n", "is not valid TOML: Cannot overwrite a value (at line 2"),
        (b"a\x1b[0m = 1", "is not valid TOML: "),
        (b"a = " + b"[" * 100_000, "is not valid TOML: nested too deep"),
        (b"a = " + b"9" * 5000, "is not valid TOML: Exceeds the limit"),
        (b"name = '\xff'", "is not UTF-8 text (byte 8); a scene is a TOML file"),
        ("name = 'a'".encode("utf-16"), "is UTF-16 text; a scene is a TOML file, which must be UTF-8"),
        (b"\xef\xbb\xbfname = 'a", "is not valid TOML: "),
        (b"#" * (2**20 + 1), "is too large; a scene file has at most 1048576 bytes"),
        (b"", "name: missing; needs 1 to 64 characters"),
    ],
)
def test_a_broken_file_is_refused_in_one_line(content, line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("my.toml").write_bytes(content)
    assert refusal("my.toml").startswith(f"my.toml: {line}")


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path):
    file = tmp_path / "marked.toml"
    file.write_bytes(b"\xef\xbb\xbf" + preset_text("sphere").encode())
    assert load_scene(file) == load_scene("sphere")


def test_a_directory_and_an_endless_file_are_refused(tmp_path):
    assert refusal(tmp_path) == f"{tmp_path}: cannot be read: Is a directory"
    if os.path.exists("/dev/zero"):
        assert refusal("/dev/zero") == "/dev/zero: is too large; a scene file has at most 1048576 bytes"


def test_a_file_of_the_largest_size_is_read(tmp_path):
    text = preset_text("sphere").encode()
    file = tmp_path / "large.toml"
    file.write_bytes(text + b"#" * (presets.MAX_FILE_BYTES - len(text)))
    assert load_scene(file) == load_scene("sphere")


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_any_damaged_text_is_refused_or_loads(data):
    """Cut, doubled and overwritten pieces of a scene's text, as bytes."""
    text = preset_text("sphere-deviated").encode()
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        end = min(len(text), start + data.draw(st.integers(0, 12)))
        piece = data.draw(
            st.sampled_from([b"nan", b"-inf", b"1e999", b"true", b"''", b"[", b"]", b"{", b"}", b"=", b"\n"])
            | st.binary(max_size=4)
            | st.just(text[start : start + 40])
        )
        text = text[:start] + piece + text[end:]
    try:
        scene = Scene.from_dict(presets._parse(text, "my.toml"), "my.toml")
    except SceneError as error:
        assert str(error).startswith("my.toml: ") and str(error).isprintable()
    else:
        assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene
