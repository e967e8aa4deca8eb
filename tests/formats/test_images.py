"""A laboratory's images: folders, files, their order, and what does not fit together."""

import tracemalloc

import numpy as np
import pytest
from loaded_modules import loaded_modules
from picture_files import COLUMNS, ROWS, letter_f, packed, png, ramp, ser, tiff

from irtscots_cl.formats.frames import ReadOptions
from irtscots_cl.formats.images import natural_order, open_frames
from irtscots_cl.imaging.fringes import FringeSet, FringeStack


def series(folder, images, name="frame_{}.tif"):
    folder.mkdir(exist_ok=True)
    for k, image in enumerate(images):
        (folder / name.format(k)).write_bytes(tiff([image.tobytes()], 8 * image.itemsize))
    return folder


def refused(*args, **keywords):
    with pytest.raises(ValueError, match=".") as caught:
        open_frames(*args, **keywords)
    assert str(caught.value).isprintable()
    return str(caught.value)


def test_a_folder_comes_in_natural_order(tmp_path):
    source = open_frames(series(tmp_path, ramp(12)))
    assert (source.count, len(source), source.shape, source.dtype) == (12, 12, (ROWS, COLUMNS), np.uint16)
    assert source.saturation == 65535 and source.notes == () and source.times is None
    assert np.array_equal(np.stack(list(source)), ramp(12))
    assert source.name(10) == str(tmp_path / "frame_10.tif")
    assert np.array_equal(source[-1], ramp(12)[11]) and np.array_equal(np.stack(source[3:5]), ramp(12)[3:5])
    with pytest.raises(IndexError):
        source[12]


def test_other_files_are_left_out_with_a_note(tmp_path):
    series(tmp_path, ramp(2))
    for name in ("._frame_0.tif", ".hidden.tif", "~lock.tif", "notes.txt", "Thumbs.db", "frame_9.jpg"):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "raw.tif").mkdir()
    source = open_frames(tmp_path)
    assert source.count == 2
    assert source.notes == (f"{tmp_path}: left out: ._frame_0.tif, .hidden.tif, Thumbs.db and 4 more",)


def test_a_folder_without_images_is_refused(tmp_path):
    assert "no images among its 0 entries" in refused(tmp_path)
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8\xff\xe0")
    said = refused(tmp_path)
    assert "no images among its 1 entries" in said and "JPEG: its counts are changed by the compression" in said
    assert "no image files" in refused([])
    assert "No such file" in refused(tmp_path / "absent.tif")


def test_folders_in_a_folder_are_named_and_can_be_given_in_their_order(tmp_path):
    """As of a laboratory that has a folder for each axis."""
    series(tmp_path / "y 2", ramp(4)[2:], name="img_2_{}.tif")
    series(tmp_path / "x 1", ramp(4)[:2], name="img_1_{}.tif")
    assert "it has the folders x 1, y 2: name them, in the frames' order" in refused(tmp_path)
    source = open_frames([tmp_path / "x 1", tmp_path / "y 2"])
    assert np.array_equal(np.stack(list(source)), ramp(4)) and source.notes == ()


def test_names_with_spaces_and_several_numbers_come_in_order(tmp_path):
    names = [f"img {a}_{b}.tif" for a in (1, 2, 10) for b in (1, 9, 10, 100)]
    for k in np.random.default_rng(1).permutation(len(names)):
        (tmp_path / names[k]).write_bytes(tiff([ramp(12)[k].tobytes()], 16))
    assert np.array_equal(np.stack(list(open_frames(tmp_path))), ramp(12))


@pytest.mark.parametrize("kind, left", [("tif", 150), ("tif", 4), ("png", 90), ("png", 20), ("npy", 200), ("tif", 0)])
def test_a_last_file_that_is_cut_off_is_named(tmp_path, kind, left):
    """As a disk that is full leaves it: at the latest when it is read."""
    for k, image in enumerate(ramp(3)):
        path = tmp_path / f"a {k}.{kind}"
        if kind == "npy":
            np.save(path, image)
        else:
            path.write_bytes(tiff([image.tobytes()], 16) if kind == "tif" else png(image, 16, 0))
    path.write_bytes(path.read_bytes()[:left])
    with pytest.raises(ValueError, match=r"a 2\.") as caught:
        list(open_frames(tmp_path))
    assert str(caught.value).isprintable() and ("not a readable" in str(caught.value) or "cut off" in str(caught.value))


def test_images_of_two_kinds_in_a_folder_are_refused(tmp_path):
    series(tmp_path, ramp(2))
    (tmp_path / "frame_0.png").write_bytes(png(letter_f(), 8, 0))
    assert "several kinds (PNG, TIFF)" in refused(tmp_path)


def test_files_come_in_the_order_given(tmp_path):
    series(tmp_path, ramp(12))
    paths = [tmp_path / f"frame_{k}.tif" for k in (3, 1, 2)]
    source = open_frames(paths)
    assert np.array_equal(np.stack(list(source)), ramp(12)[[3, 1, 2]]) and source.notes == ()
    shell = sorted(map(str, tmp_path.iterdir()))
    assert open_frames(shell).notes == (
        "the files are in the order given, which is the alphabet's: frame_10.tif before frame_2.tif",
    )
    natural = natural_order(map(tmp_path.__class__, shell))
    assert [p.name for p in natural] == [f"frame_{k}.tif" for k in range(12)]


def test_files_with_many_frames_follow_each_other(tmp_path):
    (tmp_path / "a.ser").write_bytes(ser(ramp(3, np.uint8, top=255)))
    (tmp_path / "b.tif").write_bytes(tiff([image.tobytes() for image in ramp(2, np.uint8, top=200)], 8))
    source = open_frames([tmp_path / "a.ser", tmp_path / "b.tif"])
    assert np.array_equal(np.stack(list(source)), np.concatenate([ramp(3, top=255), ramp(2, top=200)]))
    assert source.name(4) == f"{tmp_path / 'b.tif'} frame 2" and source.notes == ("a.ser: no times",)
    part = source.part([4, 0])
    assert np.array_equal(np.stack(part[:]), np.stack([ramp(2, top=200)[1], ramp(3, top=255)[0]]))
    assert part.name(0) == source.name(4) and part.shape == source.shape and len(part) == 2


def test_every_kind_keeps_the_letter_upright(tmp_path):
    (tmp_path / "a.png").write_bytes(png(letter_f(), 8, 0))
    (tmp_path / "a.tif").write_bytes(tiff([letter_f().tobytes()], 8))
    (tmp_path / "a.ser").write_bytes(ser(letter_f()[None]))
    np.save(tmp_path / "a.npy", letter_f())
    np.savez(tmp_path / "a.npz", letter_f())
    for path in sorted(tmp_path.iterdir()):
        assert np.array_equal(open_frames(path)[0], letter_f()), path.name


def test_the_beginning_of_a_file_tells_its_kind(tmp_path):
    (tmp_path / "a.tif").write_bytes(png(letter_f(), 8, 0))
    assert np.array_equal(open_frames(tmp_path)[0], letter_f())


@pytest.mark.parametrize("data, said", [
    (b"", "0 bytes"), (b"\xff\xd8\xff\xe0", "a JPEG: its counts are changed"), (b"BM12", "a BMP"),
    (b"\x89HDF\r\n\x1a\n", "not a readable HDF5 file"),
    (b"\x1f\x8b\x08", "unpack it first"), (b"hello", "begins as none of TIFF"),
])  # fmt: skip
def test_what_is_no_image_is_refused(tmp_path, data, said):
    (tmp_path / "a.tif").write_bytes(data)
    assert said in refused(tmp_path)


def test_files_that_differ_are_refused_by_name(tmp_path):
    series(tmp_path, ramp(3))
    odd = tmp_path / "frame_7.tif"
    odd.write_bytes(tiff([ramp(rows=5)[0].tobytes()], 16, shapes=[(5, COLUMNS)]))
    assert refused(tmp_path) == f"{odd}: 9 x 5 pixels; frame_0.tif has 9 x 11 pixels: must be equal"
    odd.write_bytes(tiff([letter_f().tobytes()], 8))
    assert "frame_7.tif: uint8 samples of 8 bits; frame_0.tif has uint16 samples of 16 bits" in refused(tmp_path)
    odd.write_bytes(tiff([packed(ramp()[0], 12)], 12))
    assert "uint16 samples of 12 bits" in refused(tmp_path)


def test_saturation_is_that_of_the_bits_or_as_told(tmp_path):
    (tmp_path / "a.tif").write_bytes(tiff([packed(ramp()[0], 12)], 12))
    assert open_frames(tmp_path).saturation == 4095
    assert open_frames(tmp_path, saturation=4000).saturation == 4000
    for bad in (0, -1, float("nan")):
        assert "must be above 0" in refused(tmp_path, saturation=bad)


def test_options_reach_the_readers(tmp_path):
    (tmp_path / "a.ser").write_bytes(ser(ramp(1, top=255), 16, order="big"))
    assert "state it" in refused(tmp_path)
    source = open_frames(tmp_path, options=ReadOptions(ser_byte_order="big"))
    assert np.array_equal(source[0], ramp(1, top=255)[0])


def test_notes_name_their_files_once(tmp_path):
    for k in range(5):
        (tmp_path / f"{k}.tif").write_bytes(tiff([letter_f().tobytes()], 8, orientation=3))
    assert open_frames(tmp_path).notes == ("0.tif, 1.tif, 2.tif and 2 more: Orientation 3 of the file applied",)


def test_a_file_that_changed_after_it_was_opened_is_refused(tmp_path):
    source = open_frames(series(tmp_path, ramp(2)))
    (tmp_path / "frame_1.tif").write_bytes(tiff([letter_f().tobytes()], 8))
    with pytest.raises(ValueError, match="frame_1.tif: values of .*uint8; its header says otherwise"):
        source[1]
    (tmp_path / "frame_1.tif").unlink()
    with pytest.raises(ValueError, match="frame_1.tif: not a readable TIFF file: No such file"):
        source[1]


@pytest.mark.parametrize("kind", ["ser", "npz", "tif"])
def test_frames_are_read_one_at_a_time(tmp_path, kind):
    """16 frames of half a MiB with fewer than 8 of them in memory."""
    images = ramp(16, rows=512, columns=512)
    path = tmp_path / f"a.{kind}"
    if kind == "npz":
        np.savez_compressed(path, images)
    else:
        path.write_bytes(ser(images, 12) if kind == "ser" else tiff(
            [image.tobytes() for image in images], 16, shapes=[(512, 512)] * 16
        ))  # fmt: skip
    frame, sums = images[0].nbytes, [int(image.sum()) for image in images]
    del images
    open_frames(path)  # which loads the libraries
    tracemalloc.start()
    try:
        assert [int(image.sum()) for image in open_frames(path)] == sums
        assert tracemalloc.get_traced_memory()[1] < 8 * frame
    finally:
        tracemalloc.stop()


def test_fringes_take_the_frames_of_a_folder(tmp_path):
    fringes = FringeSet.equal("x", [3.0], 4)
    source = open_frames(series(tmp_path, ramp(4)))
    stack = FringeStack((fringes,), source.part(range(4)), saturation=source.saturation)
    ((_, _, images),) = stack.series(0)
    assert stack.shape == (ROWS, COLUMNS) and np.array_equal(images, ramp(4))


def test_a_frame_that_is_kept_cannot_be_changed(tmp_path):
    source = open_frames(series(tmp_path, ramp(1)))
    with pytest.raises(ValueError, match="read-only"):
        source[0][0, 0] = 1


def test_importing_the_reader_loads_no_image_library():
    loaded = loaded_modules("import irtscots_cl.formats.images")
    assert not {"tifffile", "PIL", "astropy", "imagecodecs", "h5py"} & loaded
