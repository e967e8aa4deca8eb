"""NPZ and NPY files: which arrays are frames, read one at a time, and no code from them."""

import io
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from picture_files import COLUMNS, ROWS, frames, letter_f, outcome, ramp, refusal

from irtscots_cl.formats.frames import ReadOptions
from irtscots_cl.formats.npz import open_npy, open_npz


def npz(packed=False, /, **arrays):
    stream = io.BytesIO()
    (np.savez_compressed if packed else np.savez)(stream, **arrays)
    return stream.getvalue()


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def opened(folder, data, **options):
    path = folder / "a.npz"
    path.write_bytes(data)
    return (open_npz if data[:2] == b"PK" else open_npy)(path, ReadOptions(**options))


def refused(folder, data, **options):
    opener = open_npz if data[:2] == b"PK" else open_npy
    return refusal(opener, folder / "a.npz", data, ReadOptions(**options))


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("count", [1, 3, 4, 7])
def test_a_stack_is_frames(tmp_path, count, packed):
    file = opened(tmp_path, npz(packed, frames=ramp(count)))
    assert np.array_equal(frames(file), ramp(count))
    assert (file.shape, file.count, file.saturation) == ((ROWS, COLUMNS), count, 2**16 - 1)


@pytest.mark.parametrize("packed", [False, True])
def test_frames_are_read_in_any_order(tmp_path, packed):
    file = opened(tmp_path, npz(packed, frames=ramp(6)))
    for k in (0, 1, 2, 5, 4, 3, 0, 3, 4, 5):
        assert np.array_equal(file.read(k), ramp(6)[k])


def test_images_of_their_own_are_frames_in_natural_order(tmp_path):
    file = opened(tmp_path, npz(**{f"arr_{k}": ramp(12)[k] for k in (11, 10, *range(10))}))
    assert np.array_equal(frames(file), ramp(12))


@pytest.mark.parametrize("dtype, saturation", [
    ("u1", 255), ("<u2", 65535), (">u2", 65535), (">i2", 32767), ("f4", np.inf), (">f8", np.inf),
])  # fmt: skip
def test_types_are_kept(tmp_path, dtype, saturation):
    image = letter_f(dtype=dtype)
    for data in (npz(a=image), npy(image), npy(np.asfortranarray(image)), npz(a=np.asfortranarray(image))):
        file = opened(tmp_path, data)
        assert np.array_equal(file.read(0), image) and file.dtype == image.dtype.newbyteorder("=")
        assert file.dtype.isnative and file.saturation == saturation


def test_a_stack_of_several_must_be_named(tmp_path):
    data = npz(up=ramp(2), down=ramp(2)[::-1], x_mm=np.zeros(3))
    assert "array x_mm: shape [3]" in refused(tmp_path, data)
    data = npz(up=ramp(2), down=ramp(2)[::-1], mask=letter_f())
    assert "several stacks (up, down): name one (npz_array)" in refused(tmp_path, data)
    file = opened(tmp_path, data, npz_array="down")
    assert np.array_equal(frames(file), ramp(2)[::-1])
    assert "no array 'sideways' in it" in refused(tmp_path, data, npz_array="sideways")
    assert opened(tmp_path, npz(up=ramp(2), mask=letter_f())).notes == ("arrays left out: mask",)


class Bomb:
    def __reduce__(self):
        return print, ("this must never be run",)


@pytest.mark.parametrize("array, said", [
    (np.array([[Bomb(), Bomb()]]), "values of type object"),
    (np.zeros((3, 4), complex), "values of type complex128"),
    (np.zeros((3, 4), [("a", "u1")]), "must be real numbers"),
    (np.zeros(5), "shape [5]: must be [frames, rows, columns]"),
    (np.zeros((20, 30, 3)), "shape [20, 30, 3]: colour"),
    (np.zeros((0, 4, 4)), "0 frames"),
    (np.asfortranarray(np.zeros((3, 4, 5))), "Fortran order: must be in C order"),
])  # fmt: skip
def test_what_is_no_stack_of_grey_frames_is_refused(tmp_path, capsys, array, said):
    assert said in refused(tmp_path, npz(a=array))
    assert said in refused(tmp_path, npy(array))
    assert capsys.readouterr().out == ""


def test_unequal_images_are_refused_by_name(tmp_path):
    assert "array b: shape [10, 9], uint8; a has [11, 9]" in refused(tmp_path, npz(a=letter_f(), b=letter_f()[:-1]))


@pytest.mark.parametrize("shape", [(60_000, 60_000), (9_999, 9_999), (2**21, 1, 1)])
def test_a_header_that_claims_too_much_is_refused_before_memory_is_taken(tmp_path, shape):
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<u2", "fortran_order": False, "shape": shape})
    data = stream.getvalue() + bytes(100)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", data)
    for bad in (data, packed.getvalue()):
        said = refused(tmp_path, bad)
        assert "cut off" in said or "must be" in said


@pytest.mark.parametrize("packed", [False, True])
def test_a_file_that_is_cut_off_is_refused(tmp_path, packed):
    for data in (npz(packed, a=ramp(2)), npy(ramp(2))):
        for length in range(12, len(data), 37):
            assert refused(tmp_path, data[:length])


def test_a_file_that_is_cut_off_after_it_was_opened_is_refused(tmp_path):
    data = npy(ramp(2))
    file = opened(tmp_path, data)
    (tmp_path / "a.npz").write_bytes(data[:-1])
    assert np.array_equal(file.read(0), ramp(2)[0])
    with pytest.raises(ValueError, match="a.npz: cut off$"):
        file.read(1)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    packed=st.booleans(),
    changes=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=4),
)
def test_broken_bytes_are_read_or_refused_in_one_line(tmp_path, packed, changes):
    for opener, whole in ((open_npz, npz(packed, a=ramp(2))), (open_npy, npy(ramp(2)))):
        data = bytearray(whole)
        for place, value in changes:
            data[place % len(data)] = value
        outcome(opener, tmp_path / "a.npz", bytes(data))
