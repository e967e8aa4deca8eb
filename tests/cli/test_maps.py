"""`irtscots map` and `irtscots convert`: what they print, write, warn of and refuse."""

import json

import numpy as np
import pytest
from map_files import codev, letter_map_nm, zygo_dat

from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.formats.maps import open_map, write_map
from irtscots_cl.maths.zernike.polynomials import zernike


@pytest.fixture
def letter(tmp_path):
    write_map(tmp_path / "letter.npz", HeightMap(letter_map_nm() * 1e-6, (0.1, 0.1), 632.8))
    return tmp_path / "letter.npz"


@pytest.fixture
def mirror(tmp_path):
    """20 nm of focus, 10 of astigmatism, 5 of coma and a tilt of 1000 nm rms on a disk of 50 mm, in a file of 1 mm."""
    x, y = np.meshgrid((np.arange(101) - 50) / 50, (np.arange(101) - 50) / 50)
    heights = 20 * zernike(4, x, y) + 10 * zernike(6, x, y) + 5 * zernike(7, x, y) + 1000 * zernike(2, x, y)
    heights[x * x + y * y > 1] = np.nan
    write_map(tmp_path / "mirror.dat", HeightMap(heights * 1e-6, (1.0, 1.0), 632.8))
    return tmp_path / "mirror.dat"


def facts(irtscots, *arguments):
    code, out, err = irtscots(*arguments, "--json")
    assert code == 0, err
    return json.loads(out), err


def test_figures(irtscots, mirror):
    found, err = facts(irtscots, "map", mirror)
    assert err == ""
    assert found["removed"] == "piston_tilt" and found["pixels"] == found["valid_pixels"] == 7845
    assert found["rms_nm"] == pytest.approx(np.sqrt(20**2 + 10**2 + 5**2), rel=0.02)
    turns = {one["removed"]: one["rms_nm"] for one in found["in_turn"]}
    assert list(turns)[-1] == "piston_tilt_power_astigmatism" and turns[list(turns)[-1]] == pytest.approx(5, rel=0.02)
    assert turns["none"] == pytest.approx(1000, rel=0.03)
    terms = {one["noll"]: one["output_nm"] for one in found["zernike"]}
    assert terms[4] == pytest.approx(20 * 1.01**2, rel=1e-3)  # the disk is half a pixel larger
    assert found["zernike_disk"]["radius"] == pytest.approx(50.5) and found["zernike_disk"]["unit"] == "mm"
    assert found["pvr_nm"]["value"] == pytest.approx(found["pv_nm"], rel=0.01)
    assert found["pvr_nm"]["terms"].startswith("PV of 36 fringe Zernike terms plus 3 times the rms")
    # the tilt of 1000 nm rms is 2 um at the rim of 50 mm, 40 urad, and in x alone
    assert found["in_turn"][0]["slope_rms_urad"]["x"] == pytest.approx(40, rel=0.01)


def test_chosen_terms_and_wavefront(irtscots, mirror):
    surface, _ = facts(irtscots, "map", mirror, "--remove", "piston_tilt_power")
    wavefront, _ = facts(irtscots, "map", mirror, "--remove", "piston_tilt_power", "--wavefront")
    assert wavefront["kind"] == "wavefront"
    assert wavefront["rms_nm"] == pytest.approx(2 * surface["rms_nm"], rel=1e-12)
    assert surface["rms_nm"] == pytest.approx(np.sqrt(125), rel=0.02)


def test_text(irtscots, mirror):
    code, out, err = irtscots("map", mirror, "--spectrum")
    assert (code, err) == (0, "")
    assert "surface, 101 x 101 pixels, 7845 of them valid, pixels of 1 x 1 mm, 632.8 nm" in out
    assert "piston, tilt, power, astigmatism" in out and "PVr" in out and "Power spectral density" in out
    assert "Structure function" in out and "distance [mm]" in out


def test_spectrum(irtscots, mirror):
    found, _ = facts(irtscots, "map", mirror, "--spectrum")
    assert len(found["psd"]["frequency_per_mm"]) == len(found["psd"]["psd_nm2_mm2"]) > 40
    assert 0.7 < found["psd"]["window_share"] < 1
    assert found["structure_function"]["mean_square_nm2"][0] < found["structure_function"]["mean_square_nm2"][-1]


def test_an_unknown_lateral_scale_costs_slopes_and_spectrum_only(irtscots, tmp_path):
    path = tmp_path / "a.int"
    path.write_bytes(codev(np.arange(100).reshape(10, 10)))
    found, err = facts(irtscots, "map", path)
    assert found["slope_rms_urad"] == {"x": None, "y": None} and found["zernike_disk"]["unit"] == "pixel"
    assert err == f"irtscots: warning: {path}: the file tells no lateral scale: give --pitch-mm\n"
    code, _, err = irtscots("map", path, "--spectrum")
    assert code == 2 and "a spectrum needs the lateral scale" in err
    told, err = facts(irtscots, "map", path, "--pitch-mm", "0.5,0.25", "--spectrum")
    assert (told["pitch_mm"], err) == ([0.5, 0.25], "") and told["slope_rms_urad"]["x"] > 0


@pytest.mark.parametrize(
    ("flip", "turned"), [("x", lambda a: a[:, ::-1]), ("y", lambda a: a[::-1]), ("xy", lambda a: a[::-1, ::-1])]
)
def test_convert_flips(irtscots, letter, tmp_path, flip, turned):
    found, _ = facts(irtscots, "convert", letter, tmp_path / "b.datx", "--flip", flip)
    assert found["format"] == "zygo-datx"
    np.testing.assert_allclose(open_map(tmp_path / "b.datx").heights_mm * 1e6, turned(letter_map_nm()), rtol=1e-12)


def test_convert_rotates_counterclockwise_and_turns_heights_over(irtscots, letter, tmp_path):
    for quarters in (1, 2, 3):
        facts(irtscots, "convert", letter, tmp_path / "b.npz", *["--rotate"] * quarters, "--negate")
        seen = open_map(tmp_path / "b.npz").heights_mm[::-1] * 1e6  # as a picture, its top row first
        np.testing.assert_allclose(seen, -np.rot90(letter_map_nm()[::-1], quarters), rtol=1e-12)


def test_convert_says_what_is_lost(irtscots, letter, tmp_path):
    code, out, err = irtscots("convert", letter, tmp_path / "b.int")
    assert (code, err) == (0, "")
    assert out.startswith(f"{tmp_path / 'b.int'}: codev, surface, 9 x 11 pixels")
    assert "a CODE V file holds no lateral scale" in out and "heights are rounded to 0.0061 nm" in out
    code, out, _ = irtscots("convert", letter, tmp_path / "b.DAT", "--format", "zemax", "--wavefront")
    assert code == 0 and "the wavefront is written as a surface of half its height" in out


def test_convert_with_units_and_zernike_terms(irtscots, mirror, tmp_path):
    facts(irtscots, "convert", mirror, tmp_path / "b.csv", "--to-unit", "um")
    assert "# unit = um" in (tmp_path / "b.csv").read_text()
    found, _ = facts(irtscots, "convert", mirror, tmp_path / "b.int", "--format", "codev-zfr", "--terms", "9")
    assert "ZFR 9 SUR WVL" in (tmp_path / "b.int").read_text() and "the 9 terms leave" in found["notes"][1]


def test_what_a_file_does_not_tell_can_be_told(irtscots, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("1,2\n3,4\n")
    arguments = ("--unit", "wave", "--wavelength-nm", "500", "--pitch-mm", "0.1", "--holds", "wavefront", "--surface")
    code, _, err = irtscots("convert", path, tmp_path / "b.npz", *arguments)
    assert code == 0 and err.count("\n") == 1 and "first row is taken as the top" in err
    found = open_map(tmp_path / "b.npz")
    np.testing.assert_allclose(found.heights_mm, np.array([[3, 4], [1, 2]]) * 250e-6)
    assert (found.kind, found.pitch_mm, found.wavelength_nm) == ("surface", (0.1, 0.1), 500.0)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("convert", "A", "b.obj"), "no format has the ending '.obj'"),
        (("convert", "A", "b.npz", "--format", "obj"), "--format = obj: must be one of zygo-dat"),
        (("convert", "A", "b.csv", "--to-unit", "ft"), "--to-unit = ft: must be one of m"),
        (("convert", "A", "b.dat", "--to-unit", "nm"), "the format zygo-dat has its own unit"),
        (("convert", "A", "b.npz", "--flip", "z"), "flip = 'z': must be one of x, y, xy"),
        (("convert", "A", "b.npz", "--unit", "ft"), "unit = 'ft'"),
        (("convert", "A", "b.npz", "--holds", "opd"), "kind = 'opd'"),
        (("convert", "A", "b.npz", "--pitch-mm", "1,2,3"), "--pitch-mm = 1,2,3: must be one number"),
        (("convert", "A", "b.npz", "--pitch-mm", "x"), "--pitch-mm = x"),
        (("convert", "A", "b.npz", "--pitch-mm", "0"), "pitch_mm = 0"),
        (("convert", "A", "b.npz", "--wavelength-nm", "1064"), "leave --wavelength-nm out"),
        (("convert", "A", "b.npz", "--surface", "--wavefront"), "not allowed with argument"),
        (("convert", "A", "A"), "is the file to read"),
        (("convert", "A", "."), "no format has the ending"),
        (("convert", "none.dat", "b.npz"), "none.dat: not a readable file: No such file"),
        (("map", "none.dat"), "none.dat: not a readable file: No such file"),
        (("map", "A", "--remove", "coma"), "--remove = coma: must be one of none"),
        (("map", "A", "--unit", "nm"), "heights in mm, told nm: leave --unit out"),
        (("map", "A", "--quantity", "height"), "--quantity: must be left out, a file of this format is no result"),
        (("map", "A", "--number", "2"), "--number = 2: must be 1 to 1"),
        (("map", "A", "--array", "z"), "has no array z: give --array, one of: heights_mm"),
        (("map", "A", "--quantity", "slope"), "quantity = 'slope': must be one of deviation"),
        (("map", "A", "--disk", "0"), "--disk = 0: must be a radius above 0"),
        (("map", "A", "--disk", "1,2"), "--disk = 1,2: must be a radius above 0, or radius, x and y"),
        (("map", "A", "--disk", "1,50,2"), "no valid pixel is on the disk"),
        (("convert", "A", "b.dat", "--disk", "1"), "a disk is of codev-zfr and codev-zrn"),
    ],
)
def test_refusals_are_one_line(irtscots, letter, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    code, out, err = irtscots(*(str(letter) if word == "A" else word for word in arguments))
    if said is None:
        assert code == 0
        return
    assert code == 2 and out == "" and err.count("\n") == 1 and said in err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["letter.npz"]


def test_a_broken_file_is_one_line(irtscots, tmp_path):
    (tmp_path / "a.dat").write_bytes(zygo_dat(np.ones((5, 5)))[:-7])
    for command in (("map",), ("convert",)):
        code, out, err = irtscots(*command, tmp_path / "a.dat", *(["b.npz"] if command == ("convert",) else []))
        assert (code, out) == (2, "") and err.count("\n") == 1 and "cut off or broken" in err


def test_the_disk_of_the_zernike_terms_can_be_told(irtscots, mirror, tmp_path):
    """20 nm of focus on a disk of 50 mm, whatever circle holds the pixels."""
    found, _ = facts(irtscots, "map", mirror, "--disk", "50")
    terms = {one["noll"]: one["output_nm"] for one in found["zernike"]}
    assert terms[4] == pytest.approx(20, abs=0.01) and found["zernike_disk"]["radius"] == 50
    facts(irtscots, "convert", mirror, tmp_path / "b.int", "--format", "codev-zfr", "--terms", "9", "--disk", "50,0,0")
    text = (tmp_path / "b.int").read_text()
    assert "disk of radius 50 pixels about row 50, column 50" in text
    assert float(text.split()[-6]) == pytest.approx(20 * 3**0.5 / 632.8, rel=1e-3)  # the fourth of nine, 1 at the rim


@pytest.mark.slow
def test_run_and_reconstruct_export_what_convert_writes(irtscots, tmp_path, monkeypatch):
    from synthetic import small_scene

    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(small_scene("sphere-deviated", 25).to_toml())
    exports = ("--export", "part.dat", "--export", "zemax:grid.DAT", "--export", "part.csv")
    few = ("--rays-per-pixel", "64", "--replicates", "4", "--out", "out", "--quiet")
    code, out, err = irtscots("run", "small.toml", *few, *exports)
    assert code == 0 and "map in part.dat; the map has no wavelength" in out and "interpolated from" in err
    assert "# comment: Deviation from design" in (tmp_path / "part.csv").read_text()
    assert open_map(tmp_path / "grid.DAT").origin.startswith("Zemax")
    facts(irtscots, "convert", "out/result.h5", "again.dat")
    assert (tmp_path / "again.dat").read_bytes() == (tmp_path / "part.dat").read_bytes()
    told = ("--measure", "paper", "--out", "measured", "--export", "measured.dat")
    found, _ = facts(irtscots, "reconstruct", "out/result.h5", "--scene", "small.toml", *told)
    assert [one["format"] for one in found["exported"]] == ["zygo-dat"]
    assert open_map(tmp_path / "measured.dat").valid.sum() > 200


@pytest.mark.parametrize(
    ("export", "said"),
    [
        ("part.obj", "no format has the ending '.obj'"),
        ("none/part.dat", "--export = none/part.dat: there is no folder none"),
        ("folder.dat", "--export = folder.dat: is a folder"),
        ("zemax:none/part.dat", "there is no folder none"),
    ],
)
def test_an_export_that_cannot_be_is_refused_before_anything_is_computed(irtscots, tmp_path, monkeypatch, export, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.dat").mkdir()
    for command in (("run", "sphere-deviated"), ("reconstruct", "none.h5", "--scene", "sphere-deviated")):
        code, out, err = irtscots(*command, "--export", export)
        assert (code, out) == (2, "") and said in err and err.count("\n") == 1
    code, _, err = irtscots("run", "sphere-deviated", "--export", "a.dat", "--export", "a.dat")
    assert code == 2 and "is given twice" in err
