"""MetroPro's .dat: files made from the format's description, and its own writer."""

import numpy as np
import pytest
from map_files import INVALID, letter_map_nm, zygo_dat

from irtscots_cl.formats.height_map import CameraPlace, HeightMap, MapOptions
from irtscots_cl.formats.zygo_dat import read_zygo_dat, write_zygo_dat

WAVELENGTH_NM = float(np.float32(632.8e-9)) * 1e9
COUNTS = np.array([[1, 2, 3], [INVALID, -5, 6]])  # top row first


def read(folder, data, **options):
    path = folder / "a.dat"
    path.write_bytes(data)
    return read_zygo_dat(path, MapOptions(**options))


def refused(folder, data, **options):
    with pytest.raises(ValueError, match=".") as caught:
        read(folder, data, **options)
    assert str(caught.value).startswith(f"{folder / 'a.dat'}: ")
    return str(caught.value)


@pytest.mark.parametrize("form", [1, 2, 3])
def test_header_formats(tmp_path, form):
    found = read(tmp_path, zygo_dat(COUNTS, form=form))
    unit = 0.5 * WAVELENGTH_NM * 1e-6 / 32768
    np.testing.assert_allclose(found.heights_mm, np.array([[np.nan, -5, 6], [1, 2, 3]]) * unit, rtol=1e-14)
    assert found.pitch_mm == pytest.approx((0.1, 0.1), rel=1e-7)  # a 32-bit float in the file
    assert found.wavelength_nm == pytest.approx(WAVELENGTH_NM)
    assert (found.kind, found.warnings) == ("surface", ())


@pytest.mark.parametrize(("code", "counts"), [(0, 4096), (1, 32768), (2, 131072)])
def test_phase_resolution_codes(tmp_path, code, counts):
    found = read(tmp_path, zygo_dat(np.full((2, 2), counts), phase_res=code, scale=0.5, obliquity=1.25))
    # one fringe = S x O waves
    np.testing.assert_allclose(found.heights_mm, 0.5 * 1.25 * WAVELENGTH_NM * 1e-6, rtol=1e-14)


def test_invalid_from_the_limit_on(tmp_path):
    found = read(tmp_path, zygo_dat(np.array([[INVALID - 1, INVALID, 2**31 - 1]])))
    assert found.valid.tolist() == [[True, False, False]]


def test_sign_word_turns_heights_over_with_a_warning(tmp_path):
    found = read(tmp_path, zygo_dat(COUNTS, sign=1))
    np.testing.assert_array_equal(found.heights_mm, -read(tmp_path, zygo_dat(COUNTS)).heights_mm)
    assert "sign word 1" in found.warnings[0]


def test_scale_factor_tells_surface_from_wavefront(tmp_path):
    whole, half = (read(tmp_path, zygo_dat(COUNTS, scale=scale)) for scale in (1.0, 0.5))
    assert (whole.kind, half.kind) == ("wavefront", "surface")
    np.testing.assert_allclose(whole.as_kind("surface").heights_mm, half.heights_mm, rtol=1e-14)
    other = read(tmp_path, zygo_dat(COUNTS, scale=0.25))
    assert other.kind == "surface" and "scale factor 0.25" in other.warnings[0]
    assert read(tmp_path, zygo_dat(COUNTS), kind="wavefront").kind == "wavefront"


def test_unknown_lateral_scale_asks_for_the_pitch(tmp_path):
    data = zygo_dat(COUNTS, lateral_m=0.0)
    found = read(tmp_path, data)
    assert found.pitch_mm is None and found.warnings == ("the file tells no lateral scale: give --pitch-mm",)
    with pytest.raises(ValueError, match="lateral scale is unknown; give its pitch"):
        found.positions_mm()
    told = read(tmp_path, data, pitch_mm=(0.2, 0.2))
    assert (told.pitch_mm, told.warnings) == ((0.2, 0.2), ())
    assert "as told; the file has 0.1" in read(tmp_path, zygo_dat(COUNTS), pitch_mm=(0.2, 0.2)).warnings[0]


def test_unknown_wavelength_must_be_told(tmp_path):
    data = zygo_dat(COUNTS, wavelength_m=0.0)
    assert "give --wavelength-nm" in refused(tmp_path, data)
    assert read(tmp_path, data, wavelength_nm=633.0).wavelength_nm == 633.0
    assert "leave --wavelength-nm out" in refused(tmp_path, zygo_dat(COUNTS), wavelength_nm=1064.0)


def test_intensity_is_paired_with_the_phase_by_their_origins(tmp_path):
    camera = np.arange(2 * 8 * 10).reshape(2, 8, 10)  # frames [2, rows, columns] of the whole camera, top first
    counts = camera[0, 3:6, 2:6]  # the phase's pixels: left 2, top 3; counts that tell the pixel
    data = zygo_dat(counts, origin=(2, 3), camera=(10, 8), frames=camera)
    found = read(tmp_path, data)
    np.testing.assert_array_equal(found.intensity[:, ::-1], camera[:, 3:6, 2:6])
    assert found.camera == CameraPlace(10, 8, 2, 3)
    # frames that begin at 4, 4 of the camera cover a part of the phase
    part = read(tmp_path, zygo_dat(counts, origin=(2, 3), frames=camera[:, 4:, 4:], frames_origin=(4, 4)))
    wanted = np.full((2, 3, 4), np.nan)
    wanted[:, 1:, 2:] = camera[:, 4:6, 4:6]
    np.testing.assert_array_equal(part.intensity[:, ::-1], wanted)
    beside = read(tmp_path, zygo_dat(counts, origin=(2, 3), frames=camera[:, :1, :1]))
    assert np.isnan(beside.intensity).all()


def test_phase_comes_after_all_intensity_frames(tmp_path):
    frames = np.full((5, 2, 3), 7)
    for given in (frames, frames[:1]):
        found = read(tmp_path, zygo_dat(COUNTS, frames=given))
        np.testing.assert_array_equal(found.heights_mm, read(tmp_path, zygo_dat(COUNTS)).heights_mm)
    unnumbered = read(tmp_path, zygo_dat(COUNTS, frames=frames[:1], buckets=0))
    np.testing.assert_array_equal(unnumbered.heights_mm, found.heights_mm)


def test_saturated_intensity_is_invalid(tmp_path):
    found = read(tmp_path, zygo_dat(COUNTS, frames=np.array([[[65411, 65412, 65535], [0, 1, 2]]])))
    assert np.isnan(found.intensity[0, ::-1]).tolist() == [[False, True, True], [False, False, False]]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"phase_res": 3}, "phase resolution code 3: must be 0, 1 or 2"),
        ({"sign": 2}, "sign word 2"),
        ({"scale": 0.0}, "scale factor 0: must be above 0"),
        ({"scale": np.nan}, "scale factor nan"),
        ({"obliquity": -1.0}, "obliquity factor -1"),
        ({"wavelength_m": np.inf}, "wavelength of inf nm"),
        ({"lateral_m": np.nan}, "must be finite"),
        ({"wavelength_m": 1.0}, "wavelength of 1e+09 nm: must be 1 to 1e+06"),
    ],
)
def test_broken_headers(tmp_path, changes, said):
    assert said in refused(tmp_path, zygo_dat(COUNTS, **changes))


def test_cut_off_and_absurd_sizes(tmp_path):
    data = zygo_dat(COUNTS)
    assert "cut off or broken" in refused(tmp_path, data[:-1])
    assert "of its header" in refused(tmp_path, data[:833])
    huge = bytearray(data)
    huge[68:72] = b"\xff\xff\xff\xff"  # 65535 x 65535 pixels
    assert "must be at least 1 x 1, at most" in refused(tmp_path, bytes(huge))
    wrong = bytearray(data)
    wrong[4:6] = b"\0\2"
    assert "must be format 1 and 834" in refused(tmp_path, bytes(wrong))
    empty = bytearray(data)
    empty[68:70] = b"\0\0"
    assert "holds no phase" in refused(tmp_path, bytes(empty))
    assert "none of its 6 heights is valid" in refused(tmp_path, zygo_dat(np.full((2, 3), INVALID)))
    assert read(tmp_path, data + b"more").warnings == ("4 bytes after the phase: not read",)


@pytest.mark.parametrize("kind", ["surface", "wavefront"])
def test_written_files_come_back_to_half_a_count(tmp_path, kind):
    heights = np.random.default_rng(1).normal(0, 1e-3, (7, 5))
    heights[2, 3] = np.nan
    frames = np.arange(2 * 7 * 5).reshape(2, 7, 5).astype(float)
    place = CameraPlace(100, 90, 11, 13)
    given = HeightMap(heights, (0.1, 0.1), 632.8, kind, intensity=frames, camera=place)
    notes = write_zygo_dat(tmp_path / "a.dat", given)
    found = read_zygo_dat(tmp_path / "a.dat", MapOptions())
    quantum_mm = {"surface": 0.5, "wavefront": 1.0}[kind] * WAVELENGTH_NM * 1e-6 / 32768
    assert 0.4 * quantum_mm < np.nanmax(np.abs(found.heights_mm - heights)) <= 0.5001 * quantum_mm
    assert (found.kind, found.camera) == (kind, place)
    np.testing.assert_array_equal(found.intensity, frames)
    assert f"{quantum_mm * 1e6:.3g} nm" in notes[0]
    # what was read is on the grid of counts: it comes back exactly
    write_zygo_dat(tmp_path / "b.dat", found)
    again = read_zygo_dat(tmp_path / "b.dat", MapOptions())
    np.testing.assert_allclose(again.heights_mm, found.heights_mm, rtol=1e-15)
    assert (again.pitch_mm, again.wavelength_nm) == (found.pitch_mm, found.wavelength_nm)


def test_written_large_heights_and_what_is_refused(tmp_path):
    path = tmp_path / "a.dat"
    write_zygo_dat(path, HeightMap(np.array([[30.0, -40.0]]), None, 632.8))
    found = read_zygo_dat(path, MapOptions())
    np.testing.assert_allclose(found.heights_mm, [[30.0, -40.0]], atol=0.51 * 632.8e-6 / 2 / 4096)
    assert found.pitch_mm is None
    with pytest.raises(ValueError, match="holds at most 165"):
        write_zygo_dat(path, HeightMap(np.array([[200.0]]), None, 632.8))
    with pytest.raises(ValueError, match="one pitch for both"):
        write_zygo_dat(path, HeightMap(np.ones((2, 2)), (0.1, 0.2), 632.8))
    assert "632.8 nm is written" in write_zygo_dat(path, HeightMap(letter_map_nm() * 1e-6))[0]


def test_a_comment_that_is_cut_is_said(tmp_path):
    for length, said in ((81, False), (82, True)):
        notes = write_zygo_dat(tmp_path / "a.dat", HeightMap(np.zeros((2, 2)), (1.0, 1.0), comment=("x" * length,)))
        assert ("the map's comment is cut to 81 characters" in notes) == said
        assert read_zygo_dat(tmp_path / "a.dat", MapOptions()).comment == ("x" * 81,)
