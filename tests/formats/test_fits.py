"""FITS files: signs, missing samples, the order of rows, stacks."""

import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from picture_files import COLUMNS, ROWS, fits, frames, letter_f, outcome, ramp, refusal

from irtscots_cl.formats.fits import open_fits
from irtscots_cl.formats.frames import ReadOptions

UNSIGNED = "BZERO   =                32768"


def test_a_missing_astropy_is_named_with_its_remedy(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "astropy.io", None)
    said = refusal(open_fits, tmp_path / "a.fits", fits(letter_f(), 8))
    assert said.endswith("a FITS file needs astropy: pip install irtscots-cl[fits]")


class TestWithAstropy:
    @pytest.fixture(autouse=True)
    def _astropy(self):
        pytest.importorskip("astropy", reason="pip install irtscots-cl[fits]")

    def opened(self, folder, data, **options):
        path = folder / "a.fits"
        path.write_bytes(data)
        return open_fits(path, ReadOptions(**options))

    def refused(self, folder, data):
        return refusal(open_fits, folder / "a.fits", data)

    def test_the_bottom_row_comes_first_unless_the_file_says_otherwise(self, tmp_path):
        file = self.opened(tmp_path, fits(letter_f()[::-1], 8))
        assert np.array_equal(file.read(0), letter_f()) and "bottom-up, by the standard" in file.notes[-1]
        down = fits(letter_f(), 8, "ROWORDER= 'TOP-DOWN'")
        file = self.opened(tmp_path, down)
        assert np.array_equal(file.read(0), letter_f()) and "ROWORDER" in file.notes[-1]
        file = self.opened(tmp_path, down, fits_rows="bottom-up")
        assert np.array_equal(file.read(0), letter_f()[::-1]) and "as told" in file.notes[-1]
        up = fits(letter_f()[::-1], 8, "ROWORDER= 'BOTTOM-UP'")
        assert np.array_equal(self.opened(tmp_path, up).read(0), letter_f())
        assert "must be TOP-DOWN" in self.refused(tmp_path, fits(letter_f(), 8, "ROWORDER= 'SIDEWAYS'"))

    @pytest.mark.parametrize("bitpix, zero, dtype", [
        (8, 0, "u1"), (16, 0, "i2"), (16, 2**15, "u2"), (32, 2**31, "u4"), (8, -128, "i1"), (32, 0, "i4"),
        (64, 2**63, "u8"), (-32, 0, "f4"), (-64, 0, "f8"),
    ])  # fmt: skip
    def test_signs_and_sizes_are_kept(self, tmp_path, bitpix, zero, dtype):
        image = letter_f().astype(float) if bitpix < 0 else letter_f().astype(object)
        low, high = (-3.25, 1e30) if bitpix < 0 else (int(np.iinfo(dtype).min), int(np.iinfo(dtype).max))
        image = np.where(image > 100, 100, image)
        image[0, :2] = low, high
        stored = image - zero
        card = [f"BZERO   = {zero:20d}"] if zero else []
        file = self.opened(tmp_path, fits(stored[::-1], bitpix, *card))
        assert file.read(0).dtype == file.dtype == np.dtype(dtype)
        assert np.array_equal(file.read(0), image.astype(dtype))
        assert file.saturation == (np.inf if bitpix < 0 else float(high))

    @pytest.mark.parametrize("zero", [0, 2**15])
    def test_blank_samples_are_missing(self, tmp_path, zero):
        """astropy gives a count for them in unsigned images."""
        image = ramp(dtype=np.int64)[0]
        stored = image - zero
        stored[2, 3] = -9
        card = [UNSIGNED] if zero else []
        file = self.opened(tmp_path, fits(stored[::-1], 16, *card, "BLANK   =                   -9"))
        got = file.read(0)
        assert got.dtype == file.dtype == np.float32 and np.argwhere(np.isnan(got)).tolist() == [[2, 3]]
        assert np.nansum(got - image) == 0 and file.saturation == (2**16 - 1 if zero else 2**15 - 1)

    @pytest.mark.parametrize("packed", [False, True])
    @pytest.mark.parametrize("zero", [0, 2**15])
    def test_blank_samples_of_later_units_are_missing(self, tmp_path, zero, packed):
        from astropy.io import fits as library

        image = ramp(dtype="u2" if zero else "i2")[0]
        kind = library.CompImageHDU if packed else library.ImageHDU
        unit = kind(image[::-1])
        unit.header["BLANK"] = int(image[2, 3]) - zero
        library.HDUList([library.PrimaryHDU(), unit]).writeto(tmp_path / "a.fits", output_verify="silentfix")
        got = open_fits(tmp_path / "a.fits", ReadOptions()).read(0)
        assert got.dtype == np.float32 and np.argwhere(np.isnan(got)).tolist() == [[2, 3]]
        assert np.nanmax(np.abs(got - image)) == 0

    def test_other_scales_are_applied_and_their_saturation_is_not_known(self, tmp_path):
        stored = ramp(dtype=np.int64)[0]
        file = self.opened(tmp_path, fits(stored[::-1], 16, "BZERO   = 100.5", "BSCALE  = 0.25"))
        assert np.array_equal(file.read(0), 100.5 + 0.25 * stored) and file.saturation == np.inf
        assert "saturation is not known" in file.notes[0]

    def test_a_nan_of_floating_point_stays_one(self, tmp_path):
        image = letter_f(dtype=float)
        image[4, 5] = np.nan
        got = self.opened(tmp_path, fits(image[::-1], -64)).read(0)
        assert np.array_equal(got, image, equal_nan=True)

    @pytest.mark.parametrize("count", [1, 3, 4, 6])
    def test_planes_are_frames(self, tmp_path, count):
        images = ramp(count)
        file = self.opened(tmp_path, fits(images[:, ::-1].astype(int) - 2**15, 16, UNSIGNED))
        assert np.array_equal(frames(file), images) and file.shape == (ROWS, COLUMNS)

    def test_units_are_frames_and_tables_are_left_out(self, tmp_path):
        from astropy.io import fits as library

        units = [library.ImageHDU(image[::-1]) for image in ramp(3)]
        table = library.BinTableHDU.from_columns([library.Column("a", "J", array=[1, 2])])
        library.HDUList([library.PrimaryHDU(), *units, table]).writeto(tmp_path / "a.fits")
        file = open_fits(tmp_path / "a.fits", ReadOptions())
        assert np.array_equal(frames(file), ramp(3)) and file.notes[0] == "unit 5 is no image: left out"
        units[1] = library.ImageHDU(ramp(1, rows=5)[0])
        library.HDUList([library.PrimaryHDU(), *units]).writeto(tmp_path / "b.fits")
        with pytest.raises(ValueError, match=f"unit 3: {COLUMNS} x 5 pixels of uint16; the first has"):
            open_fits(tmp_path / "b.fits", ReadOptions())

    def test_tiles_packed_without_loss_are_read(self, tmp_path):
        from astropy.io import fits as library

        unit = library.CompImageHDU(ramp(2)[:, ::-1], compression_type="RICE_1")
        library.HDUList([library.PrimaryHDU(), unit]).writeto(tmp_path / "a.fz")
        file = open_fits(tmp_path / "a.fz", ReadOptions())
        assert np.array_equal(frames(file), ramp(2)) and file.dtype == np.uint16

    @pytest.mark.parametrize("cards, said", [
        (["BAYERPAT= 'RGGB'"], "BAYERPAT = 'RGGB': colour"),
        (["BSCALE  = 0.0"], "the scale not 0"),
    ])  # fmt: skip
    def test_what_is_no_grey_measurement_is_refused(self, tmp_path, cards, said):
        assert said in self.refused(tmp_path, fits(letter_f(), 8, *cards))

    @pytest.mark.parametrize("axis", [60_000, 2_000_000_000])
    def test_a_header_that_claims_too_much_is_refused_before_memory_is_taken(self, tmp_path, axis):
        data = fits(letter_f(), 8).replace(f"NAXIS1  = {COLUMNS:20d}".encode(), f"NAXIS1  = {axis:20d}".encode())
        said = self.refused(tmp_path, data)
        assert "cut off or broken" in said or "pixels: must be" in said

    def test_a_file_that_is_cut_off_is_refused(self, tmp_path):
        data = fits(ramp(dtype=np.int64)[0], 16)
        for length in (10, 80, 2000, 2879, 2880, 2881, 2880 + 2 * ROWS * COLUMNS - 1):
            assert self.refused(tmp_path, data[:length])
        whole = self.opened(tmp_path, data[: 2880 + 2 * ROWS * COLUMNS])  # without the padding
        assert np.array_equal(whole.read(0), ramp(dtype=np.int64)[0][::-1])

    @settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(
        changes=st.lists(
            st.tuples(st.integers(0, 700), st.sampled_from(list(b"0129 -ETF'=./AZ\x00\xff"))), min_size=1, max_size=4
        )
    )
    def test_broken_bytes_are_read_or_refused_in_one_line(self, tmp_path, changes):
        data = bytearray(fits(letter_f(), 8, UNSIGNED, "BLANK   =                    7"))
        for place, value in changes:
            data[place] = value
        outcome(open_fits, tmp_path / "a.fits", bytes(data))
