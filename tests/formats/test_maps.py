"""Maps of all formats: told by content, orientation through every pair, rounding, and broken files of every kind."""

import random
from itertools import product

import h5py
import numpy as np
import pytest
from broken_maps import broken, outcome
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from map_files import INVALID, codev, letter_map_nm, npz, sdf_binary, sdf_text, x3p, zemax, zygo_dat, zygo_datx
from picture_files import fits, tiff

from irtscots_cl.formats.height_map import HeightMap, MapOptions
from irtscots_cl.formats.maps import ENDINGS, FORMATS, format_of, open_map, write_map

TOP_FIRST = letter_map_nm()[::-1]
FLAGS = ~np.isfinite(TOP_FIRST)
SEEN = np.where(FLAGS, 0, TOP_FIRST)
COUNTS = np.where(FLAGS, INVALID, SEEN * 100)  # of MetroPro: 0.01 nm each
NM_PER_FRINGE = 327.68  # makes 32768 counts of 0.01 nm
CARDS = ("BUNIT   = 'nm      '", "MAPKIND = 'SURFACE '")
TEXT = "# unit = nm\n# kind = surface\n# first_row = top\n"
POINTS = "\n".join(f"{c * 0.1:.1f} {-r * 0.1:.1f} {TOP_FIRST[r, c]}" for r, c in product(range(11), range(9)))

# A file of the letter made by hand in every format, its name, and what must be told.
BY_HAND = {
    "zygo-dat": ("a.dat", zygo_dat(COUNTS, scale=1.0, wavelength_m=NM_PER_FRINGE * 1e-9), {"kind": "surface"}),
    "zygo-datx": ("a.datx", zygo_datx(np.where(FLAGS, float(INVALID), SEEN)), {}),
    "codev": ("a.int", codev(np.where(FLAGS, -32768, SEEN), "SUR WVL 0.1 SSZ 100 NDA -32768"), {}),
    "zemax": ("a.DAT", zemax(SEEN * 1e-6, flags=FLAGS), {}),
    "fits": ("a.fits", fits(letter_map_nm(), -64, *CARDS), {}),
    "tiff": ("a.tif", tiff([TOP_FIRST.astype("<f4").tobytes()], 32, kind=3), {"unit": "nm"}),
    "csv": ("a.csv", (TEXT + "\n".join(",".join(map(str, row)) for row in TOP_FIRST) + "\n").encode(), {}),
    "xyz": ("a.xyz", ("# unit = nm\n# kind = surface\n" + POINTS + "\n").encode(), {}),
    "npz": ("a.npz", npz(heights_mm=letter_map_nm() * 1e-6), {}),
    "sdf": ("a.sdf", sdf_binary(letter_map_nm()), {}),
    "sdf text": ("b.sdf", sdf_text(letter_map_nm()), {}),
    "x3p": ("a.x3p", x3p(letter_map_nm() * 1e-9), {}),
}
BACK = {**BY_HAND, "npy": ("a.npy", b"", {"unit": "mm"})}
WRITTEN = [form for form in FORMATS if not form.startswith("codev-")]
LETTER = HeightMap(letter_map_nm() * 1e-6, (0.1, 0.1), 632.8)


def opened(folder, name, data, **told):
    path = folder / name
    path.write_bytes(data)
    return open_map(path, MapOptions(**told))


def assert_letter(found, tolerance_nm=1e-4):
    np.testing.assert_array_equal(found.valid, np.isfinite(letter_map_nm()))
    assert np.nanmax(np.abs(found.heights_mm * 1e6 - letter_map_nm())) <= tolerance_nm


@pytest.mark.parametrize("form", BY_HAND)
def test_a_letter_made_by_hand_stands_upright(tmp_path, form):
    name, data, told = BY_HAND[form]
    found = opened(tmp_path, name, data, **told)
    assert_letter(found)
    assert found.kind == "surface"
    # what a file begins with tells its format, its name does not
    assert_letter(opened(tmp_path, "other.txt", data, **told))


@pytest.mark.parametrize("form", [form for form in BY_HAND if form not in ("tiff", "codev", "npz")])
def test_lateral_scale_of_files_made_by_hand(tmp_path, form):
    name, data, told = BY_HAND[form]
    if form in ("fits", "csv"):
        assert opened(tmp_path, name, data, **told).pitch_mm is None
    else:
        assert opened(tmp_path, name, data, **told).pitch_mm == pytest.approx((0.1, 0.1), rel=1e-6)


@pytest.mark.parametrize(("first", "second"), list(product(WRITTEN, repeat=2)))
def test_a_letter_stays_upright_through_every_pair_of_formats(tmp_path, first, second):
    path = tmp_path / "a"
    write_map(path, LETTER, first)
    between = open_map(path, MapOptions(unit="mm" if first == "npy" else None, pitch_mm=(0.1, 0.1)))
    write_map(tmp_path / "b", between, second)
    found = open_map(tmp_path / "b", MapOptions(unit="mm" if second == "npy" else None))
    assert_letter(found, 0.02)  # two roundings: half a count of MetroPro is 0.005 nm, of CODE V 0.003 nm


@pytest.mark.parametrize("kind", ["surface", "wavefront"])
@pytest.mark.parametrize("form", [form for form in WRITTEN if form != "npy"])
def test_surface_and_wavefront_are_told_apart(tmp_path, form, kind):
    path = tmp_path / "a"
    notes = write_map(path, LETTER.as_kind(kind), form)
    found = open_map(path)
    half = any("half its height" in note for note in notes)
    assert half == (kind == "wavefront" and form in ("zemax", "sdf", "x3p"))
    assert found.kind == ("surface" if half else kind)
    assert_letter(found.as_kind("surface"), 0.01)


def test_what_a_format_does_not_hold_is_said(tmp_path):
    from dataclasses import replace

    given = replace(LETTER, centre_mm=(1.0, 2.0), intensity=np.zeros((2, 11, 9)))
    for form in WRITTEN:
        notes = " ".join(write_map(tmp_path / "a", given, form))
        assert ("intensity frames are not written" in notes) == (not form.startswith("zygo"))
        assert ("the map's centre" in notes) == (form not in ("zemax", "fits", "tiff", "csv", "xyz", "npz"))


@pytest.mark.parametrize("unit", ["m", "cm", "in", "mm", "um", "nm"])
@pytest.mark.parametrize("form", ["fits", "tiff", "csv", "xyz"])
def test_units_that_are_written(tmp_path, form, unit):
    write_map(tmp_path / "a", LETTER, form, unit=unit)
    assert_letter(open_map(tmp_path / "a"))
    with pytest.raises(ValueError, match="the format zemax has its own unit"):
        write_map(tmp_path / "a", LETTER, "zemax", unit=unit)


def test_names_and_formats():
    from pathlib import Path

    assert {format_of(Path(f"x{ending.upper()}")) for ending in ENDINGS} == set(WRITTEN) - {"zemax"}
    with pytest.raises(ValueError, match="no format has the ending '.obj'"):
        format_of(Path("x.obj"))


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "0 bytes"),
        (b"Zygo ASCII Data File - Format 2\n", "save it as .dat"),
        (b"\x89PNG\r\n\x1a\n", "a picture (PNG)"),
        (b"hello world, no numbers\n", "begins as none of MetroPro"),
        (b"1 2 3\0", "begins as none of MetroPro"),
        (bytes(range(256)), "begins as none of MetroPro"),
        (b"\x88\x1b\x03\x72" + b"\0" * 900, "not a readable MetroPro file"),
        (b"PK\x03\x04" + b"\0" * 100, "not a readable zip file"),
    ],
)
def test_files_that_are_none(tmp_path, data, said):
    with pytest.raises(ValueError, match=".") as caught:
        opened(tmp_path, "a.dat", data)
    assert said in str(caught.value) and str(caught.value).startswith(f"{tmp_path / 'a.dat'}: ")


def test_no_file_and_no_folder(tmp_path):
    with pytest.raises(ValueError, match="No such file"):
        open_map(tmp_path / "none.dat")
    with pytest.raises(ValueError, match="not a readable file"):
        open_map(tmp_path)
    with pytest.raises(ValueError, match="there is no folder"):
        write_map(tmp_path / "none" / "a.dat", LETTER)
    with pytest.raises(ValueError, match="no valid height"):
        write_map(tmp_path / "a.dat", HeightMap(np.full((5, 5), np.nan)))
    with pytest.raises(ValueError, match="format 'obj': must be one of"):
        write_map(tmp_path / "a", LETTER, "obj")


COMMENTED = ["zygo-dat", "zygo-datx", "codev", "codev-zfr", "codev-zrn", "fits", "tiff", "csv", "xyz", "npz"]


@pytest.mark.parametrize("form", FORMATS)
def test_comments_are_written_and_read_where_formats_have_them(tmp_path, form):
    from dataclasses import replace

    given = replace(LETTER, comment=("Deviation, + towards the camera", "second line"))
    notes = write_map(tmp_path / "a", given, form, terms=4)
    assert ("the map's comment is not written" in notes) == (form not in COMMENTED)
    said = " ".join(open_map(tmp_path / "a", MapOptions(unit="mm" if form == "npy" else None)).comment)
    assert ("+ towards the camera" in said and "second line" in said) == (form in COMMENTED)


def test_what_is_done_to_a_map_is_said_in_its_comment():
    from dataclasses import replace

    given = replace(LETTER, comment=("height",))
    turned = given.flipped("x").rotated().negated().as_kind("wavefront")
    assert turned.comment == ("height", "mirrored: x", "turned by a quarter", "heights turned over", "now a wavefront")
    assert LETTER.flipped("x").comment == ()


def test_one_of_several_maps(tmp_path):
    """A stack of the letter and its double, in every format that holds several."""
    import tifffile
    from astropy.io import fits as astropy_fits

    stack = np.stack([letter_map_nm(), 2 * letter_map_nm()])
    hdu = astropy_fits.PrimaryHDU(stack)
    hdu.header["BUNIT"] = "nm"
    hdu.writeto(tmp_path / "a.fits")
    tifffile.imwrite(tmp_path / "a.tif", stack[:, ::-1].astype("f4"), photometric="minisblack")
    np.savez(tmp_path / "a.npz", heights_mm=stack * 1e-6, other=stack[1])
    np.save(tmp_path / "a.npy", stack)
    with h5py.File(tmp_path / "a.datx", "w") as file:
        for k, heights in enumerate(stack):
            data = file.create_dataset(f"Data/Surface/{k}", data=np.nan_to_num(heights[::-1], nan=float(INVALID)))
            data.attrs["Unit"] = b"NanoMeters"
            file.create_dataset(f"Data/Intensity/{k}", data=np.full(heights.shape, k + 1))
    for name in ("a.fits", "a.tif", "a.npz", "a.npy", "a.datx"):
        told = {"unit": "nm"} if name in ("a.tif", "a.npy") else {}
        with pytest.raises(ValueError, match="a map is one; give --number, from 1 to 2"):
            open_map(tmp_path / name, MapOptions(**told))
        with pytest.raises(ValueError, match="--number = 3: must be 1 to 2"):
            open_map(tmp_path / name, MapOptions(number=3, **told))
        for number in (1, 2):
            found = open_map(tmp_path / name, MapOptions(number=number, **told))
            np.testing.assert_allclose(found.heights_mm * 1e6, number * letter_map_nm(), rtol=1e-6)
    assert open_map(tmp_path / "a.datx", MapOptions(number=2)).intensity.max() == 2
    other = open_map(tmp_path / "a.npz", MapOptions(unit="nm", array="other"))
    np.testing.assert_allclose(other.heights_mm * 1e6, stack[1])
    assert any("does not tell its row order" in text for text in other.warnings)


@pytest.mark.parametrize("form", ["zygo-dat", "codev", "zemax", "sdf", "x3p"])
def test_a_unit_is_refused_where_the_format_has_its_own(tmp_path, form):
    write_map(tmp_path / "a", LETTER, form)
    with pytest.raises(ValueError, match="--unit: must be left out, a file of this format has its own unit"):
        open_map(tmp_path / "a", MapOptions(unit="nm"))


# --- broken files -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    """Every reader has run once: what its library takes at import is no file's memory."""
    for name, data, told in BY_HAND.values():
        opened(tmp_path_factory.mktemp("warm"), name, data, **told)


def some_file(number):
    rng = random.Random(number)
    form = rng.choice(sorted(BY_HAND))
    return BY_HAND[form][0], broken(BY_HAND[form][1], rng)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(number=st.integers(0, 2**40))
def test_broken_files_give_one_line(tmp_path, libraries, number):
    outcome(tmp_path / some_file(number)[0], some_file(number)[1])


@pytest.mark.slow
def test_5000_broken_files_give_one_line(tmp_path, libraries):
    said = {}
    for number in range(5000):
        name, data = some_file(number)
        result = outcome(tmp_path / name, data)
        said[result == "read"] = said.get(result == "read", 0) + 1
    assert said[False] > 2000 and said[True] > 200, said  # most are refused, and some changes do no harm


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=2000), start=st.sampled_from([b"", *(entry[1][:12] for entry in BY_HAND.values())]))
def test_any_bytes_give_one_line(tmp_path, libraries, data, start):
    outcome(tmp_path / "a.bin", start + data)


@pytest.mark.parametrize("form", BY_HAND)
def test_every_file_cut_off_anywhere_is_refused_or_whole(tmp_path, form):
    """Where a cut leaves a readable file, as in a text without its last digits, a warning says so."""
    name, data, told = BY_HAND[form]
    for at in sorted({*range(0, len(data), max(1, len(data) // 40)), len(data) - 1, len(data) - 2}):
        (tmp_path / name).write_bytes(data[:at])
        try:
            found = open_map(tmp_path / name, MapOptions(**told))
        except ValueError as error:
            assert str(error).isprintable()
            continue
        # what is cut off a text's last line, or off a table of unknown length, can only be warned of
        text = form in ("csv", "xyz", "codev", "sdf text", "zemax")
        warned = any("may be cut off" in warning for warning in found.warnings)
        whole = data[:at].endswith((b"\n", b"\r")) or form == "fits"  # zeros after the data
        assert (text and (warned or whole)) or whole, f"{at} of {len(data)} bytes were read"


def test_absurd_sizes_in_an_hdf5_file_take_no_memory(tmp_path, libraries):
    path = tmp_path / "a.datx"
    with h5py.File(path, "w") as file:
        file.create_dataset("Data/Surface/{1}", (2**15, 2**12), "f8", chunks=(64, 64), compression="gzip")
    assert "cut off or broken" in outcome(path, path.read_bytes())
