"""Maps of this package read by public packages and theirs read here; how those differ is in docs/formats.md.

The versions are pinned in the test extra: their differences are theirs, and may go with another version.
"""

import warnings
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import pytest
from map_files import codev, letter_map_nm, zygo_dat

from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.formats.maps import open_map, write_map

LETTER = HeightMap(letter_map_nm() * 1e-6, (0.1, 0.1), 632.8)
COUNTS = np.full((2, 3), 131072)


def has(package, pinned):
    try:
        return version(package) == pinned
    except PackageNotFoundError:
        return False


needs_prysm = pytest.mark.skipif(not has("prysm", "0.21.1"), reason="needs prysm 0.21.1")
needs_topography = pytest.mark.skipif(not has("SurfaceTopography", "1.27.1"), reason="needs SurfaceTopography 1.27.1")


def topography(path):
    """Heights [x, y] in nm, NaN where masked, as SurfaceTopography reads them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from SurfaceTopography.IO import open_topography

        found = open_topography(str(path)).topography()
    unit_nm = {"m": 1e9, "\u00b5m": 1e3, "nm": 1.0}[found.unit]
    return np.ma.filled(found.heights(), np.nan) * unit_nm, np.array(found.physical_sizes) * unit_nm


def prysm_io():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from prysm import io
    return io


# --- what this package writes -------------------------------------------------------------------------------


@needs_prysm
@pytest.mark.parametrize("form", ["zygo-dat", "zygo-datx"])
def test_prysm_reads_ours_the_top_row_first(tmp_path, form):
    write_map(tmp_path / "a", LETTER, form)
    read = prysm_io().read_zygo_dat if form == "zygo-dat" else prysm_io().read_zygo_datx
    np.testing.assert_allclose(read(tmp_path / "a")["phase"][::-1], letter_map_nm(), atol=0.005)  # half a count


@needs_topography
@pytest.mark.parametrize("form", ["zygo-dat", "zygo-datx"])
def test_surface_topography_reads_ours_with_y_downwards(tmp_path, form):
    path = tmp_path / f"a.{form[5:]}"
    write_map(path, LETTER, form)
    heights, sizes = topography(path)
    np.testing.assert_allclose(heights.T[::-1], letter_map_nm(), atol=0.005)
    np.testing.assert_allclose(sizes, [0.9e6, 1.1e6], rtol=1e-6)


@needs_topography
@pytest.mark.parametrize("form", ["sdf", "x3p"])
def test_surface_topography_reads_ours_with_y_upwards(tmp_path, form):
    path = tmp_path / f"a.{form}"
    write_map(path, LETTER, form)
    heights, sizes = topography(path)
    np.testing.assert_allclose(heights.T, letter_map_nm(), rtol=1e-12)
    np.testing.assert_allclose(sizes, [0.9e6, 1.1e6], rtol=1e-12)


# --- what they write ----------------------------------------------------------------------------------------


@needs_topography
@pytest.mark.parametrize("kind", ["D", "F", "L", "I"])
def test_x3p_files_of_surface_topography(tmp_path, kind):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from SurfaceTopography import Topography
        from SurfaceTopography.IO.X3P import write_x3p

    heights = np.ma.masked_invalid(letter_map_nm().T * 1e-3)
    write_x3p(Topography(heights, (900.0, 2200.0), unit="\u00b5m"), str(tmp_path / "a.x3p"), dtype=kind)
    found = open_map(tmp_path / "a.x3p")
    tolerance_nm = {"D": 1e-9, "F": 2e-5, "L": 1e-6, "I": 0.0015}[kind]  # of 190 nm: half of 2^-16 is 0.0014
    np.testing.assert_allclose(found.heights_mm * 1e6, letter_map_nm(), atol=tolerance_nm)
    assert found.pitch_mm == pytest.approx((0.1, 0.2))


@needs_prysm
def test_the_ascii_of_prysm_is_refused(tmp_path):
    """It divides by the wavelength in um twice: the counts of one wave, 32768 / 0.5, become 2.497 times as many."""
    prysm_io().write_zygo_ascii(str(tmp_path / "a.asc"), np.ones((4, 5)), 0.1)
    counts = (tmp_path / "a.asc").read_text().split("#")[2].split()
    assert set(counts) == {str(int(32768 / 0.5 / 0.6328**2))}
    with pytest.raises(ValueError, match="MetroPro's ASCII: save it as .dat"):
        open_map(tmp_path / "a.asc")


# --- where they differ --------------------------------------------------------------------------------------


@needs_prysm
def test_prysm_divides_code_v_grids_by_the_wavelength(tmp_path):
    (tmp_path / "a.int").write_bytes(codev(np.full((3, 3), 1000)))
    theirs_nm, _ = prysm_io().read_codev_gridint(tmp_path / "a.int")
    ours_nm = open_map(tmp_path / "a.int").heights_mm * 1e6
    np.testing.assert_allclose(ours_nm, 632.8, rtol=1e-12)
    np.testing.assert_allclose(theirs_nm / ours_nm, 1 / 0.6328**2, rtol=1e-9)  # 2.497


@needs_prysm
def test_prysm_exchanges_rows_and_columns_of_code_v_grids_and_needs_nda(tmp_path):
    path = tmp_path / "a.int"
    path.write_bytes(codev(np.arange(6).reshape(2, 3)))
    assert prysm_io().read_codev_gridint(path)[0].shape == (3, 2)
    assert open_map(path).heights_mm.shape == (2, 3)
    path.write_bytes(codev(np.arange(6).reshape(2, 3), "SUR WVL 0.6328 SSZ 1000"))
    with pytest.raises(ValueError, match="did not contain NDA"):
        prysm_io().read_codev_gridint(path)
    path.write_bytes(codev(np.arange(6).reshape(2, 3), "SUR WVL 0.6328 NNB SSZ 1000 NDA -32768"))
    with pytest.raises(ValueError, match="token NNB not understood"):
        prysm_io().read_codev_gridint(path)


@needs_prysm
@needs_topography
def test_the_sign_word_is_ignored_by_prysm(tmp_path):
    path = tmp_path / "a.dat"
    path.write_bytes(zygo_dat(COUNTS, sign=1))
    ours_nm = open_map(path).heights_mm * 1e6
    assert (ours_nm < 0).all()
    np.testing.assert_allclose(prysm_io().read_zygo_dat(path)["phase"], -ours_nm, rtol=1e-12)
    np.testing.assert_allclose(topography(path)[0].T, ours_nm, rtol=1e-12)


@needs_prysm
@needs_topography
@pytest.mark.parametrize("code", [0, 1, 2])
def test_all_three_agree_on_the_counts_of_a_fringe(tmp_path, code):
    path = tmp_path / "a.dat"
    path.write_bytes(zygo_dat(COUNTS, phase_res=code))
    ours_nm = open_map(path).heights_mm * 1e6
    np.testing.assert_allclose(prysm_io().read_zygo_dat(path)["phase"], ours_nm, rtol=1e-12)
    np.testing.assert_allclose(topography(path)[0].T, ours_nm, rtol=1e-12)


@needs_prysm
def test_prysm_reads_intensity_with_its_bytes_exchanged(tmp_path):
    path = tmp_path / "a.dat"
    path.write_bytes(zygo_dat(COUNTS, frames=np.array([[[1, 2, 3], [4, 5, 6]]])))
    assert prysm_io().read_zygo_dat(path)["intensity"].ravel().tolist() == [256, 512, 768, 1024, 1280, 1536]
    assert open_map(path).intensity[0, ::-1].ravel().tolist() == [1, 2, 3, 4, 5, 6]


@needs_prysm
@needs_topography
def test_a_file_that_leaves_the_number_of_frames_out(tmp_path):
    """Intensity of 2 x 3 pixels, no number of frames: SurfaceTopography takes it for the phase."""
    path = tmp_path / "a.dat"
    path.write_bytes(zygo_dat(COUNTS, frames=np.ones((1, 2, 3)), buckets=0))
    ours_nm = open_map(path).heights_mm * 1e6
    np.testing.assert_allclose(prysm_io().read_zygo_dat(path)["phase"], ours_nm)
    assert not np.allclose(topography(path)[0].T, ours_nm)
