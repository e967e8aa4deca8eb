"""The tables [[mirror.map]]: what they may say, how they read their files, and how they come back from TOML."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from loaded_modules import loaded_modules

from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.formats.maps import write_map
from irtscots_cl.optics.height_map import MapWarning
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.presets import load_scene, parse_scene, preset_text
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.fingerprint import trace_fingerprint
from irtscots_cl.tracing.options import TraceOptions

TABLE = '\n[[mirror.map]]\nfile = "week.npz"\ncentre_mm = [1, -2.5]\nrotation_deg = 90\nflip = "x"\nfactor = -1\n'


def heights(size=1e-5):
    x = np.linspace(-600, 600, 61)
    return HeightMap(size * np.exp(-((x - 200) ** 2 + (x[:, None] + 100) ** 2) / 4e4), pitch_mm=(20.0, 20.0))


def written(folder, name="week.npz", text=TABLE, given=None):
    """A scene file with a map beside it."""
    write_map(folder / name, given or heights())
    path = folder / "mine.toml"
    path.write_text(preset_text("sphere") + text, encoding="utf-8")
    return path


def test_a_scene_file_names_a_map_beside_it_and_comes_back(tmp_path, monkeypatch):
    path = written(tmp_path)
    scene = load_scene(path)
    (table,) = scene.mirror.map
    assert table.file == str(tmp_path / "week.npz") and table.centre_mm == (1.0, -2.5)
    assert (table.rotation_deg, table.flip, table.factor, table.outside) == (90.0, "x", -1.0, "refuse")
    assert scene.nominal() == load_scene("sphere") and "mirror.map" not in scene.nominal().to_toml()
    text = scene.to_toml()
    monkeypatch.chdir(tmp_path.parent)  # a worker, or a run that is resumed, is elsewhere
    assert parse_scene(text) == scene
    assert Surface.of(parse_scene(text).mirror).deviation_at(0.0, 0.0)[0] != 0


def test_two_tables_are_an_array(tmp_path):
    scene = load_scene(written(tmp_path, text=TABLE + '\n[[mirror.map]]\nfile = "week.npz"\noutside = "zero"\n'))
    assert len(scene.mirror.map) == 2 and parse_scene(scene.to_toml()) == scene


@pytest.mark.parametrize(
    "line, said",
    [
        ("outside = 'maybe'", "mirror.map[0].outside = 'maybe': must be one of refuse, nearest, zero"),
        ("rotation = 3.0", "mirror.map[0].rotation: unknown key; did you mean rotation_deg?"),
        ("flip = 'z'", "mirror.map[0].flip = 'z': must be one of x, y, xy"),
        ("factor = 0.0", "mirror.map[0].factor = 0.0: must be a finite number within 1e6 on either side of 0"),
        ("factor = nan", "mirror.map[0].factor = nan: must be a finite number within 1e6 on either side of 0"),
        ("scale = -1.0", "mirror.map[0].scale = -1.0: must be a finite number at least 1e-06 and at most 1e+06"),
        ("pitch_mm = 0.0", "mirror.map[0].pitch_mm = 0.0: must be a finite number above 0"),
        ("pitch_mm = 2.0\nscale = 2.0", "mirror.map[0].scale = 2.0: must be left out where pitch_mm gives"),
        ("unit = 'fathom'", "mirror.map[0].unit = 'fathom': must be one of m, cm"),
        ("holds = 'water'", "mirror.map[0].holds = 'water': must be surface or wavefront"),
        ("wavelength_nm = -1", "mirror.map[0].wavelength_nm = -1: must be a finite number"),
        ("file = 7", "mirror.map[0].file = 7: must be the path of a map"),
        ("heights = 'in memory, 12'", "mirror.map[0].heights = 'in memory, 12': must be a HeightMap"),
    ],
)
def test_a_wrong_key_is_one_line(tmp_path, line, said):
    table = "\n[[mirror.map]]\n" + ("" if line.startswith(("file", "heights")) else 'file = "week.npz"\n') + line + "\n"
    with pytest.raises(SceneError) as caught:
        load_scene(written(tmp_path, text=table))
    assert f"mine.toml: {said}" in str(caught.value) and "\n" not in str(caught.value)


def test_a_table_that_is_no_array_is_one_line(tmp_path):
    with pytest.raises(SceneError, match=r"mirror.map = .*must be tables \[\[mirror.map\]\]"):
        load_scene(written(tmp_path, text="\n[mirror.map]\nfile = 'week.npz'\n"))
    with pytest.raises(SceneError, match=r"Mirror: map\[0\] = 'week.npz': must be a MirrorMap"):
        replace(load_scene("sphere").mirror, map=("week.npz",))


BROKEN = {
    "missing": (None, "not a readable file: No such file or directory"),
    "empty": (b"", "not a readable map: 0 bytes"),
    "a picture": (b"\x89PNG\r\n", "a picture (PNG), which has no unit: save heights as numbers"),
    "noise": (bytes(range(1, 256)) * 9, "not a readable map: begins as none of"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_file_is_one_line_when_the_surface_is_needed(tmp_path, kind):
    path = written(tmp_path)
    content, said = BROKEN[kind]
    (tmp_path / "week.npz").unlink()
    if content is not None:
        (tmp_path / "week.npz").write_bytes(content)
    scene = load_scene(path)  # what measures from images needs no file of the true surface
    with pytest.raises(SceneError) as caught:
        Surface.of(scene.mirror)
    assert str(caught.value).startswith(f"{tmp_path / 'week.npz'}: mirror.map[0].file: {said}")
    assert "\n" not in str(caught.value)


def test_what_a_file_does_not_say_is_asked_for_by_its_key(tmp_path):
    path = written(tmp_path, "week.npy", TABLE.replace("npz", "npy"))
    with pytest.raises(SceneError, match=r"mirror\.map\[0\]\.file: tells no unit of its heights: give unit, one of"):
        Surface.of(load_scene(path).mirror)
    path.write_text(path.read_text() + 'unit = "nm"\n', encoding="utf-8")
    with pytest.raises(SceneError, match="tells no lateral scale: must have a pitch_mm beside it"):
        Surface.of(load_scene(path).mirror)
    path.write_text(path.read_text() + 'pitch_mm = 20.0\nholds = "wavefront"\n', encoding="utf-8")
    write_map(tmp_path / "week.npy", heights(), unit="nm")
    x, y = np.linspace(-300, 300, 7), np.linspace(200, -250, 7)
    with pytest.warns(MapWarning, match="does not tell its row order: row 0 is taken as the lowest"):
        found = Surface.of(load_scene(path).mirror).deviation_at(x, y)[0]
    whole = replace(load_scene("sphere").mirror, map=(MirrorMap(
        heights=heights(), centre_mm=(1.0, -2.5), rotation_deg=90.0, flip="x", factor=-1.0),))  # fmt: skip
    np.testing.assert_allclose(found, Surface.of(whole).deviation_at(x, y)[0] / 2, rtol=0, atol=1e-12)


def test_what_a_file_leaves_open_is_said_once(tmp_path):
    path = written(tmp_path, "week.fits", TABLE.replace("npz", "fits") + "pitch_mm = 20.5\n")
    scene = load_scene(path)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for _ in range(3):
            Surface.of(scene.mirror)
    (told,) = [str(warning.message) for warning in said if issubclass(warning.category, MapWarning)]
    assert re.fullmatch(r"mirror\.map\[0\]\.file = .*week\.fits: pitch of 20\.5 x 20\.5 mm as told; .*", told)


def test_a_changed_file_is_read_again_and_is_another_run(tmp_path):
    scene = load_scene(written(tmp_path))
    facts = [trace_fingerprint(scene, TraceOptions("adjoint"), np.array([4]), {})]
    before = Surface.of(scene.mirror).deviation_at(90.0, 200.0)[0]
    write_map(tmp_path / "week.npz", heights(3e-5))
    facts.append(trace_fingerprint(scene, TraceOptions("adjoint"), np.array([4]), {}))
    assert facts[0]["scene"] == facts[1]["scene"] and facts[0]["maps"] != facts[1]["maps"]
    assert Surface.of(scene.mirror).deviation_at(90.0, 200.0)[0] == pytest.approx(3 * before)
    assert "maps" not in trace_fingerprint(load_scene("sphere"), TraceOptions("adjoint"), np.array([4]), {})


def test_a_map_in_memory_is_known_by_its_content(tmp_path):
    scene = load_scene("sphere")
    one, same, other = (
        replace(scene, mirror=replace(scene.mirror, map=(MirrorMap(heights=heights(size)),))) for size in (1, 1, 2)
    )
    assert one == same and hash(one.mirror.map) == hash(same.mirror.map) and one != other
    assert one.to_toml() == same.to_toml() != other.to_toml()
    with pytest.raises(SceneError, match=r"mirror\.map\[0\]\.heights = .*must be a HeightMap .*or `file` a path"):
        parse_scene(one.to_toml())
    for wrong in ({}, {"file": "a.npz", "heights": heights()}, {"heights": np.zeros((3, 3))}):
        with pytest.raises(SceneError, match=r"MirrorMap: (?s:(file|heights) = .*): must be"):
            MirrorMap(**wrong)
    with pytest.raises(SceneError, match="unit = 'nm': must be left out: a HeightMap says it itself"):
        MirrorMap(heights=heights(), unit="nm")


def test_loading_a_scene_with_a_map_needs_no_numpy(tmp_path):
    path = written(tmp_path)
    loaded = loaded_modules(f"from irtscots_cl.scene.presets import load_scene; load_scene({str(path)!r})")
    assert "irtscots_cl.scene.model" in loaded and "numpy" not in loaded


def test_what_only_the_command_line_can_tell_is_said_so(tmp_path):
    np.savez(tmp_path / "week.npz", heights_mm=np.zeros((3, 4, 5)))
    with pytest.raises(SceneError, match="write one to a file by irtscots convert --number, from 1 to 3"):
        MirrorMap(file=str(tmp_path / "week.npz")).read(0)
    write_map(tmp_path / "week.npz", heights())
    with pytest.raises(SceneError, match="holds a surface, told a wavefront: leave holds out"):
        MirrorMap(file=str(tmp_path / "week.npz"), holds="wavefront").read(0)
