"""Result files: whole or not there at all, their names and units, and strangers' files."""

from __future__ import annotations

import dataclasses
import json
import os
import stat

import h5py
import numpy as np
import pytest
from synthetic import noise_free_stack, small_scene, with_replicates

from irtscots_cl.imaging.image_files import read_images
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.report.result_file import write_result
from irtscots_cl.system.atomic_files import check_output_folder, replacing, write_json, write_text

ROUNDING = 1e-12  # relative: sums of a few float64 numbers


# --- whole files or none ------------------------------------------------------------------------------------


def test_a_text_is_written_as_utf_8_with_the_user_s_permissions(tmp_path):
    before = os.umask(0o027)
    try:
        write_text(tmp_path / "a.txt", "µm\n")
    finally:
        os.umask(before)
    assert (tmp_path / "a.txt").read_bytes() == "µm\n".encode()
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o640
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("existing", [None, "old"])
def test_an_error_while_writing_leaves_what_was_there(tmp_path, existing):
    path = tmp_path / "a.txt"
    if existing:
        path.write_text(existing)

    def write_half():
        with replacing(path) as temporary:
            temporary.write_text("half")
            assert not existing or path.read_text() == existing  # not touched before all is written
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        write_half()
    assert os.listdir(tmp_path) == ([path.name] if existing else [])
    assert not existing or path.read_text() == existing


def test_an_error_while_writing_hdf5_leaves_nothing(tmp_path):
    scene = small_scene(pixels=9)
    stack = noise_free_stack(scene)
    result = reconstruct(stack, scene.nominal())
    with pytest.raises(TypeError):
        write_result(tmp_path / "result.h5", stack, result, {"scene": object()})
    assert os.listdir(tmp_path) == []


def test_json_has_null_for_numbers_that_do_not_exist(tmp_path):
    data = {
        "a": float("nan"),
        "b": np.float64("inf"),
        "c": [np.int64(3), np.float32(0.5), None, True, "x"],
        "d": {"e": (1.5, -float("inf"))},
        7: np.bool_(False),
    }
    write_json(tmp_path / "a.json", data)
    text = (tmp_path / "a.json").read_text()
    expected = {"a": None, "b": None, "c": [3, 0.5, None, True, "x"], "d": {"e": [1.5, None]}, "7": False}
    assert json.loads(text, parse_constant=pytest.fail) == expected
    assert text.endswith("}\n")


# --- result.h5 ----------------------------------------------------------------------------------------------

DATASETS = {  # name: unit, shape with 21 lines of a detector of 15 x 15 pixels
    "images/x": ("W", (21, 15, 15)),
    "images/y": ("W", (21, 15, 15)),
    "images/x_standard_error": ("W", (21, 15, 15)),
    "images/y_standard_error": ("W", (21, 15, 15)),
    "lines/x_mm": ("mm", (21,)),
    "lines/y_mm": ("mm", (21,)),
    "mirror/x_mm": ("mm", (15, 15)),
    "mirror/y_mm": ("mm", (15, 15)),
    "mask": ("1", (15, 15)),
    "flags": ("1", (15, 15)),
    "islands": ("1", (15, 15)),
    "island_groups": ("1", (15, 15)),
    "centroid/x_mm": ("mm", (15, 15)),
    "centroid/y_mm": ("mm", (15, 15)),
    "slope/x_rad": ("rad", (15, 15)),
    "slope/y_rad": ("rad", (15, 15)),
    "height_mm": ("mm", (15, 15)),
    "deviation_nm": ("nm", (15, 15)),
    "height_standard_error_nm": ("nm", (15, 15)),
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A stack with three replicates and windows of eight lines, its result, and the file of both."""
    scene = small_scene(pixels=15)
    stack = with_replicates(noise_free_stack(scene), 3, 0.01)
    stack = ImageStack(*(_in_windows(scan) for scan in (stack.x, stack.y)))
    result = reconstruct(stack, scene.nominal())
    path = tmp_path_factory.mktemp("files") / "result.h5"
    write_result(path, stack, result, {"scene": scene.to_toml(), "seed": "1"})
    return stack, result, path


def _in_windows(scan: Scan, width: int = 10) -> Scan:
    """The same scan as a trace gives it: lit pixels only, and of each the lines around its light."""
    lit = np.flatnonzero(scan.mean_w().any(1))
    first = np.minimum(np.argmax(scan.mean_w()[lit] != 0, axis=1), len(scan.positions_mm) - width + 2)
    lines = first[:, None] + np.arange(width)
    padded = np.pad(scan.flux_w, ((0, 0), (0, 0), (0, width)))
    windows = dataclasses.replace(
        scan,
        pixels=scan.pixels[lit],
        first_line=first,
        hits=scan.hits[lit],
        flux_w=padded[:, lit[:, None], lines],
    )
    assert np.isclose(windows.flux_w.sum(), scan.flux_w.sum())  # or light is lost, and the test with it
    return windows


def test_result_h5_holds_what_the_contract_names_with_units(written):
    _, _, path = written
    found = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, item: (
                found.update({name: (item.attrs["unit"], item.shape)}) if isinstance(item, h5py.Dataset) else None
            )
        )
        assert dict(file.attrs)["seed"] == "1" and 'name = "sphere-deviated"' in file.attrs["scene"]
    assert found == DATASETS


def test_result_h5_holds_the_result(written):
    _, result, path = written
    with h5py.File(path) as file:
        for name, values in (
            ("mirror/x_mm", result.x_mm),
            ("mirror/y_mm", result.y_mm),
            ("mask", result.mask),
            ("flags", result.flags),
            ("centroid/x_mm", result.centroid_x_mm),
            ("centroid/y_mm", result.centroid_y_mm),
            ("slope/x_rad", result.slope_x),
            ("slope/y_rad", result.slope_y),
            ("height_mm", result.height_mm),
            ("deviation_nm", result.deviation_mm * 1e6),
        ):
            np.testing.assert_array_equal(file[name][()], values, err_msg=name)


def test_the_images_in_result_h5_are_the_stack_s(written):
    stack, _, path = written
    with h5py.File(path) as file:
        for scan in (stack.x, stack.y):
            for line in range(21):
                image, error = (
                    file[f"images/{scan.axis}"][line],
                    file[f"images/{scan.axis}_standard_error"][line],
                )
                np.testing.assert_array_equal(image, scan.image(line, scan.jackknife_w()[0]))
                np.testing.assert_array_equal(error, scan.image(line, scan.standard_error_w()))


def test_images_are_read_back(written):
    stack, _, path = written
    found = read_images(path)
    for one, other in ((found.x, stack.x), (found.y, stack.y)):
        assert (one.axis, one.shape) == (other.axis, other.shape)
        np.testing.assert_array_equal(one.positions_mm, other.positions_mm)
        for line in range(21):
            np.testing.assert_allclose(one.image(line), other.image(line), rtol=ROUNDING)


def test_the_same_result_comes_out_of_the_images_read_back(written):
    _, result, path = written
    again = reconstruct(read_images(path), result.nominal)
    np.testing.assert_allclose(
        again.deviation_mm,
        result.deviation_mm,
        rtol=0,
        atol=1e-12,  # mm: rounding of 500 mm
    )


def test_several_exposures_are_read_as_replicates(tmp_path):
    images = np.random.default_rng(9).uniform(size=(4, 3, 2, 2))
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        for axis in ("x", "y"):
            file[f"images/{axis}"], file[f"lines/{axis}_mm"] = (
                (images * 1000).astype(np.uint16),
                [0.0, 0.2, 0.4],
            )
    assert read_images(tmp_path / "lab.h5").x.flux_w.shape == (4, 4, 3)


# --- strangers' files ---------------------------------------------------------------------------------------


def _with(images=None, lines=(0.0, 0.2, 0.4)):
    def write(file):
        for axis in ("x", "y"):
            file[f"images/{axis}"] = np.ones((3, 2, 2)) if images is None else images
            file[f"lines/{axis}_mm"] = np.asarray(lines)

    return write


ELSEWHERE = "its values are in another file; must be in this one"


def _virtual(file):
    layout = h5py.VirtualLayout((3, 2, 2), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (3, 2, 2))
    file.create_virtual_dataset("images/x", layout)


def _raw(file):
    file.create_dataset("images/x", (3, 2, 2), "f8", external=[("other.raw", 0, h5py.h5f.UNLIMITED)])


def _linked(link):
    def write(file):
        file["images/x"] = link

    return write


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (
            lambda file: None,
            "/images/x: missing; must be a dataset of real numbers, as `irtscots run` writes it",
        ),
        (lambda file: file.create_group("images/x"), "/images/x: a group; must be"),
        (
            lambda file: file.create_dataset("images", data=[1.0]),
            "/images/x: missing; must be",
        ),
        (
            lambda file: file.create_dataset("images/x", data=np.ones((3, 2, 2))),
            "/lines/x_mm: missing; must be",
        ),
        (_with(images=h5py.Empty("f8")), "/images/x: empty; must be"),
        (_with(images=[b"text"]), "/images/x: of type "),
        (_with(images=np.ones((3, 2, 2), complex)), "/images/x: of type complex128; must be"),
        (_with(images=np.zeros((3, 2, 2), [("a", "f8")])), "/images/x: of type [('a', '<f8')]; must be"),
        (_linked(h5py.SoftLink("/nowhere")), "/images/x: missing; must be"),
        (_linked(h5py.SoftLink("/images/x")), "not a readable HDF5 file: "),
        (_linked(h5py.ExternalLink("other.h5", "/x")), f"/images/x: {ELSEWHERE}"),
        (lambda file: file.update({"images": h5py.ExternalLink("other.h5", "/")}), f"/images/x: {ELSEWHERE}"),
        (_virtual, f"/images/x: {ELSEWHERE}"),
        (_raw, f"/images/x: {ELSEWHERE}"),
        (
            _with(images=np.full((3, 2, 2), 1e101)),
            "images/x[0, 0, 0] = 1e+101: must be a finite number within 1e+100",
        ),
        (
            _with(images=np.ones((3, 2))),
            "images of the x scan have shape (3, 2); must be [lines, rows, columns]",
        ),
        (
            _with(images=np.ones((0, 2, 2))),
            "images of the x scan have shape (0, 2, 2); must be [lines, rows, columns]",
        ),
        (_with(lines=[0.0, 0.2]), "the x scan has 3 images but line positions of shape (2,)"),
        (_with(lines=0.2), "the x scan has 3 images but line positions of shape ()"),
        (_with(lines=[0.4, 0.2, 0.0]), "the line positions of the x scan must grow from line to line"),
        (
            _with(lines=[0.0, np.nan, 0.4]),
            "lines/x_mm[1] = nan: must be a finite number within 1e+100",
        ),
        (
            _with(images=np.full((3, 2, 2), np.inf)),
            "images/x[0, 0, 0] = inf: must be a finite number within 1e+100",
        ),
    ],
)
def test_a_stranger_s_file_is_refused_in_one_line(tmp_path, write, message):
    path = tmp_path / "lab.h5"
    with h5py.File(path, "w") as file:
        write(file)
    with pytest.raises(ValueError, match="lab.h5") as caught:
        read_images(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert str(caught.value).isprintable()


def test_a_file_that_would_fill_the_memory_is_refused_unread(tmp_path, monkeypatch):
    monkeypatch.setattr("irtscots_cl.imaging.image_files.MAX_IMAGE_VALUES", 100)
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        file.create_dataset("images/x", (101, 1, 1), "f8")
        file["lines/x_mm"] = np.arange(101.0)
    with pytest.raises(ValueError, match="/images/x: 101 values; at most 100 are read"):
        read_images(tmp_path / "lab.h5")


@pytest.mark.parametrize("content", [None, b"", b"no HDF5", "folder", "truncated"])
def test_what_is_no_hdf5_file_is_refused_in_one_line(tmp_path, written, content):
    path = tmp_path / "lab.h5"
    if content == "folder":
        path.mkdir()
    elif content == "truncated":
        path.write_bytes(written[2].read_bytes()[:3000])
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(ValueError, match="not a readable HDF5 file") as caught:
        read_images(path)
    assert str(caught.value).startswith(f"{path}: ") and str(caught.value).isprintable()


# --- the output folder --------------------------------------------------------------------------------------


def test_an_output_folder_is_checked_without_being_made(tmp_path):
    check_output_folder(tmp_path)
    check_output_folder(tmp_path / "new" / "deep")
    assert os.listdir(tmp_path) == []
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(ValueError, match="file is not a folder"):
            check_output_folder(path)


def test_an_output_folder_without_permission_is_refused(tmp_path):
    if os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    tmp_path.chmod(0o500)
    with pytest.raises(ValueError, match="no permission to write in "):
        check_output_folder(tmp_path / "new")
