"""Camera calibrations of other programs: small files as they write them, whole and broken."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

from irtscots_cl.formats.opencv_camera import OpenCvCamera, opencv_yaml, read_camera

CAMERA = OpenCvCamera(686.5, 685.25, 101.5, 77.25, (-0.144, 1.61, 2.5e-05, -0.0019, 0.0), (203, 154), "bench 3")
MATRIX = "[ 686.5, 0., 101.5, 0., 685.25, 77.25, 0., 0., 1. ]"
LENS = "[ -0.144, 1.61, 2.5000000000000001e-05, -0.0019, 0. ]"

# As cv2.FileStorage 4 and 5 write them: another first line, and a vector as a matrix or as an array of one dimension.
OPENCV_4 = f"""%YAML:1.0
---
camera_name: "bench 3"
image_width: 203
image_height: 154
board_width: 9
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: {MATRIX}
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: {LENS}
avg_reprojection_error: 1.2e-01
"""
OPENCV_5 = OPENCV_4.replace("%YAML:1.0", "%YAML 1.2").replace(
    "!!opencv-matrix\n   rows: 5\n   cols: 1", "!!opencv-nd-matrix\n   sizes: [ 5 ]"
)
OPENCV_JSON = """{
    "camera_name": "bench 3", "image_width": 203, "image_height": 154, "worst": .Nan,
    "camera_matrix": { "type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
        "data": [ 686.5, 0.0, 101.5, 0.0, 685.25, 77.25, 0.0, 0.0, 1.0 ] },
    "distortion_coefficients": { "type_id": "opencv-nd-matrix", "sizes": [ 5 ], "dt": "d",
        "data": [ -0.144, 1.61, 2.5e-05, -0.0019, 0.0 ] }
}"""
ROS = """image_width: 203
image_height: 154
camera_name: bench 3
camera_matrix:
  rows: 3
  cols: 3
  data: [686.5, 0, 101.5, 0, 685.25, 77.25, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.144, 1.61, 2.5e-05, -0.0019, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
"""
PLAIN_JSON = json.dumps(
    {
        "K": [[686.5, 0, 101.5], [0, 685.25, 77.25], [0, 0, 1]],
        "dist_coeffs": [[-0.144, 1.61, 2.5e-05, -0.0019, 0.0]],
        "image_size": [203, 154],
        "camera_name": "bench 3",
    }
)
NESTED = "left:\n" + "".join(f"  {line}\n" for line in ROS.splitlines())


@pytest.mark.parametrize(
    ("name", "text"),
    [("a.yml", OPENCV_4), ("a.yaml", OPENCV_5), ("a.json", OPENCV_JSON), ("ros.yaml", ROS), ("b.json", PLAIN_JSON),
     ("c.yaml", NESTED), ("bom.yml", "\ufeff" + OPENCV_4)],
    ids=["opencv 4", "opencv 5", "opencv json", "ros", "json", "nested", "byte order mark"],
)  # fmt: skip
def test_all_kinds_of_files_give_the_same_camera(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    assert read_camera(path) == CAMERA


def test_what_is_written_is_read(tmp_path):
    for camera in (
        CAMERA,
        OpenCvCamera(1 / 3, 2e5 / 7, -3.3, 1e-7, (), (8, 9)),
        OpenCvCamera(1, 2, 3, 4, (0.1,) * 8, (5, 6)),
    ):
        path = tmp_path / "a.yml"
        path.write_text(opencv_yaml(camera))
        assert read_camera(path) == camera  # to the last bit
    with pytest.raises(ValueError, match="has no size"):
        opencv_yaml(OpenCvCamera(1, 1, 0, 0))


def test_a_size_and_coefficients_may_be_missing(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("K: [1e2, 0, 3, 0, 2e+2, 4, 0, 0, 1]\nD: []\n")
    assert read_camera(path) == OpenCvCamera(100.0, 200.0, 3.0, 4.0)


def with_lens(*values):
    return ROS.replace(
        "cols: 5, data: [-0.144, 1.61, 2.5e-05, -0.0019, 0]", f"cols: {len(values)}, data: {list(values)}"
    )


def test_long_distortions_without_their_own_terms_are_read(tmp_path):
    path = tmp_path / "a.yaml"
    for zeros in (4, 6):
        path.write_text(with_lens(-0.1, 0.2, 1e-4, 2e-4, 0.3, 0.4, 0.5, 0.6, *[0] * zeros))
        assert read_camera(path).distortion == (-0.1, 0.2, 1e-4, 2e-4, 0.3, 0.4, 0.5, 0.6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ROS.replace("686.5, 0,", "686.5, 0.7,"), r"camera_matrix\[0\]\[1\] = 0.7: a skew .* must be 0"),
        (ROS.replace("0, 0, 1]\ndist", "0, 0, 2]\ndist"), r"must be \[fx, 0, cx, 0, fy, cy, 0, 0, 1\]"),
        (ROS.replace("686.5", "-686.5"), "focal lengths -686.5, 685.25; must be above 0"),
        (ROS.replace("686.5", "wide"), "camera_matrix.data = wide: must be a finite number"),
        (ROS.replace("686.5", ".nan"), "camera_matrix.data = .nan: must be a finite number"),
        (ROS.replace("686.5, 0,", "686.5,"), "camera_matrix: 8 numbers in a matrix of 3 x 3"),
        (ROS.replace("plumb_bob", "equidistant"), "distortion_model = equidistant: a model of fisheyes .* pinhole"),
        (ROS + "fisheye_model: 1\n", "fisheye_model = 1: a model of fisheyes"),
        (ROS + "xi: 0.8\n", "xi = 0.8: a model of fisheyes"),
        (with_lens(0.1, 0.2), "distortion_coefficients: 2 coefficients; must be 4 .* 5 .* or 8"),
        (with_lens(*[0.1] * 12), "12 coefficients with the thin prism's s1 to s4 = .* calibrate with at most 8"),
        (with_lens(*[0.0] * 12, 0.01, 0.0), "14 coefficients with the thin prism's s1 to s4 and the tilts"),
        (ROS.replace("distortion_coefficients", "lens"), "has no distortion_coefficients; must have it"),
        (ROS.replace("camera_matrix", "matrix"), "has no camera_matrix .keys: image_width"),
        (ROS.replace("image_width: 203", "image_width: 203.5"), "image_width = 203.5: must be a whole number"),
        (ROS + "binning_x: 2\n", "binning_x = 2: must be left out; give binning in the scene"),
        (ROS + "roi: {x_offset: 5, y_offset: 0}\n", "roi: must be left out; give roi_px in the scene"),
        ("image_size: [1, 2, 3]\n" + ROS.replace("image_width", "w"), "image_size: 3 numbers; must be .columns, rows."),
        ("- 1\n- 2\n", "holds no table"),
        ("a: [1, 2\nb: 3", "is not valid YAML or JSON: .* in line"),
        ("[" * 5000, "is not valid YAML"),
        ("<?xml version='1.0'?><opencv_storage/>", "is XML; must be YAML or JSON"),
        ("K: {a: 1}\nD: []\n", "K: a table without `data`"),
        (f"K: {[[0] * 9] * 9}\nD: []\n", "K: too many numbers"),
    ],
)  # fmt: skip
def test_other_files_are_refused_with_the_remedy(tmp_path, text, message):
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        read_camera(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_files_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "a.yml"
    for data, message in ((b"\xff\xfe\x00a", "is not UTF-8 text"), (b"a: b\n" * 2**20, "is too large")):
        path.write_bytes(data)
        with pytest.raises(ValueError, match=message):
            read_camera(path)
    for other, message in ((tmp_path, "cannot be read"), (tmp_path / "no.yml", "cannot be read: No such file")):
        with pytest.raises(ValueError, match=message):
            read_camera(other)


def test_nothing_in_a_file_is_run(tmp_path):
    path = tmp_path / "a.yaml"
    mark = tmp_path / "made"
    path.write_text(ROS + f"x: !!python/object/apply:os.system ['touch {mark}']\n")
    assert read_camera(path) == CAMERA
    assert not mark.exists()


def write_sofast(path, **changes):
    parts = {
        "intrinsic_mat": np.array([[686.5, 0, 101.5], [0, 685.25, 77.25], [0, 0, 0.125]]),
        "distortion_coef": np.array([-0.144, 1.61, 2.5e-05, -0.0019, 0.0]),
        "image_shape_xy": np.array([203, 154]),
        "name": "bench 3",
    } | changes
    with h5py.File(path, "w") as file:
        for name, value in parts.items():
            if value is not None:
                file[f"Camera/{name}"] = value
    return path


def test_a_sofast_camera_is_read_as_opencv_reads_it(tmp_path):
    """OpenCV's functions take fx, fy, cx, cy of a matrix and nothing else: a file scaled as a whole, its last element
    included, is of the small pictures (findings/opencv_storage.py)."""
    assert read_camera(write_sofast(tmp_path / "c.h5")) == CAMERA


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"intrinsic_mat": np.eye(2)}, r"Camera/intrinsic_mat: of shape \[2, 2\]; must be 3x3 numbers"),
        ({"intrinsic_mat": None}, "Camera/intrinsic_mat: missing; must be a dataset"),
        ({"intrinsic_mat": np.full((3, 3), np.nan)}, "Camera/intrinsic_mat: holds a value that is no finite number"),
        ({"distortion_coef": np.zeros(3) + 1}, "Camera/distortion_coef: 3 coefficients; must be 4"),
        ({"distortion_coef": np.zeros(99)}, "Camera/distortion_coef: of shape .99. .* must be n numbers"),
        ({"image_shape_xy": np.array([203.5, 154])}, "Camera/image_shape_xy = 203.5: must be a whole number"),
        ({"image_shape_xy": "large"}, "Camera/image_shape_xy: of shape .* must be 2 numbers"),
    ],
)
def test_other_sofast_files_are_refused(tmp_path, changes, message):
    path = write_sofast(tmp_path / "c.h5", **changes)
    with pytest.raises(ValueError, match=message) as caught:
        read_camera(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
    with h5py.File(path, "w"):
        pass
    with pytest.raises(ValueError, match="has no group Camera"):
        read_camera(path)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(ValueError, match="has no group Camera|not a readable HDF5 file"):
        read_camera(path)
