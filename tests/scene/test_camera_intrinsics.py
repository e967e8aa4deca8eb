"""The table [camera.intrinsics]: what is taken, and every refusal in one line with key, value and what is allowed."""

from __future__ import annotations

import math
import time
import tomllib

import numpy as np
import pytest
from refusals import BASE, changed, refusal

from irtscots_cl.maths import lens_distortion
from irtscots_cl.scene.camera_intrinsics import MIN_DETERMINANT, Intrinsics, picture_size
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError

TABLE = ("camera", "intrinsics")
GIVEN = {
    "image_size_px": [640, 512], "principal_point_px": [300.5, 260.25], "fx": 940.0, "fy": 950.0,
    "distortion": [-0.1, 0.02, 0.001, -0.002, 0.003], "roi_px": [100, 96], "binning": [2, 2],
}  # fmt: skip


def scene_with(**table):
    return Scene.from_dict(changed(*TABLE, to=table))


def focal_px() -> float:
    camera = Scene.from_dict(BASE).camera
    return camera.image_distance_mm / camera.detector.pitch_mm


# --- what is taken ------------------------------------------------------------------------------------------


def test_the_table_goes_to_toml_and_back():
    focal = 2 * focal_px()  # of pixels that binning joins
    scene = scene_with(**{**GIVEN, "fx": focal, "fy": 1.01 * focal})
    assert scene.camera.intrinsics.roi_px == (100, 96) and scene.camera.is_distorted
    assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene


def test_every_key_may_be_left_out():
    for key in GIVEN:
        table = {k: v for k, v in GIVEN.items() if k not in (key, "fx", "fy")}
        if key == "image_size_px":
            assert picture_size(scene_with(**table).camera.intrinsics, (125, 125)) == (350, 346)
        else:
            scene_with(**table)
    empty = scene_with().camera.intrinsics
    assert empty == Intrinsics() and not empty.is_distorted and picture_size(empty, (125, 100)) == (125, 100)


@pytest.mark.parametrize("count", [0, 4, 5, 8])
def test_opencv_s_numbers_of_coefficients_are_taken(count):
    scene_with(distortion=[1e-3] * count)


def test_scenes_without_the_table_do_not_have_it():
    scene = Scene.from_dict(BASE)
    assert scene.camera.intrinsics is None and not scene.camera.is_distorted
    assert "intrinsics" not in scene.to_toml()


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "shown", "must"),
    [
        ("image_size_px", [0, 5], "[0, 5]", "be [columns, rows], two integers from 1 to"),
        ("image_size_px", [640.5, 480], "[640.5, 480]", "two integers"),
        ("image_size_px", 640, "640", "[columns, rows]"),
        ("principal_point_px", [1.0], "[1.0]", "[x, y], two finite numbers"),
        ("principal_point_px", [math.nan, 1.0], "nan", "finite numbers"),
        ("principal_point_px", [-126.0, 60.0], "[-126.0, 60.0]", "lie within one size of the picture of [125, 125]"),
        ("principal_point_px", [60.0, 251.0], "[60.0, 251.0]", "lie within one size of the picture of [125, 125]"),
        ("fx", 0.0, "0.0", "above 0"),
        ("fx", -500.0, "-500.0", "above 0"),
        ("fx", math.inf, "inf", "finite"),
        ("fx", 100.0, "100.0", "be within a factor of 2 of"),
        ("fy", 5000.0, "5000.0", "be within a factor of 2 of"),
        ("fx", "500", "'500'", "number"),
        ("distortion", [0.1], "[0.1]", "be [k1, k2, p1, p2], [k1, k2, p1, p2, k3] or these with k4, k5, k6"),
        ("distortion", [0.1] * 6, "0.1", "be [k1, k2, p1, p2]"),
        ("distortion", [0.1] * 12, "0.1", "be [k1, k2, p1, p2]"),
        ("distortion", [0.1, 0.1, 0.1, math.nan], "nan", "finite numbers"),
        ("distortion", [1e7, 0.0, 0.0, 0.0], "10000000.0", "finite numbers within 1e6"),
        ("roi_px", [-1, 0], "[-1, 0]", "be [column, row], two integers of at least 0"),
        ("roi_px", [1.0, 0], "[1.0, 0]", "two integers"),
        ("binning", [0, 1], "[0, 1]", "be [x, y], two integers from 1 to 64"),
        ("binning", [65, 1], "[65, 1]", "two integers from 1 to 64"),
        ("binning", 2, "2", "be [x, y]"),
        ("skew", 0.1, "", "unknown key"),
        ("k1", 0.1, "", "unknown key"),
    ],
)
def test_a_wrong_value_is_refused_with_key_value_and_what_is_allowed(key, value, shown, must):
    message = refusal(changed(*TABLE, to={key: value}))
    assert message.startswith(f"my.toml: camera.intrinsics.{key}"), message
    assert shown in message and must in message


@pytest.mark.parametrize(
    ("table", "must"),
    [
        ({"image_size_px": [125, 124]}, "leave room for 125 rows of 1 pixels in a picture of 124"),
        ({"image_size_px": [249, 250], "binning": [2, 2]}, "leave room for 125 columns of 2 pixels in a picture of 249"),
        ({"image_size_px": [200, 200], "roi_px": [76, 0]}, "leave room for 125 columns of 1 pixels in a picture of 200"),
    ],
)
def test_a_region_outside_the_picture_is_refused(table, must):
    message = refusal(changed(*TABLE, to=table))
    assert message.startswith("my.toml: camera.intrinsics.roi_px = [") and must in message


@pytest.mark.parametrize("value", ["a string", 3, [1], None])
def test_a_table_is_a_table(value):
    if value is None:
        return
    assert "camera.intrinsics" in refusal(changed(*TABLE, to=value))


def test_unequal_binning_leaves_room_for_pixels_that_are_not_square():
    focal = focal_px()
    for fx, fy in ((focal, focal), (4 * focal, 4 * focal)):  # pitch_mm is the joined pixel's short or long side
        scene_with(binning=[1, 4], fx=fx, fy=fy)
    assert "be within a factor of 2 of" in refusal(changed(*TABLE, to={"binning": [1, 4], "fx": 9 * focal}))


# --- folds --------------------------------------------------------------------------------------------------


def corner_of(focal: float) -> float:
    """Radius of the image's corner, in focal lengths."""
    return math.hypot(62.5, 62.5) / focal


def limit_of(distortion) -> tuple[float, float]:
    """Radius where a radial distortion's determinant falls to MIN_DETERMINANT, and the distorted one, by a scan."""
    r = np.linspace(0, 50, 2_000_001)
    c = lens_distortion.full(tuple(distortion))
    xx, xy, yy = lens_distortion.distortion_matrix(r, 0 * r, c)
    first = int(np.flatnonzero(~(xx * yy - xy * xy > MIN_DETERMINANT))[0])
    return float(r[first]), float(lens_distortion.distort(r[first], 0.0, c)[0])


RADIAL = [
    [-30.0, 0.0, 0.0, 0.0], [10.0, -4000.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, -5e5],
    [20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9e5], [-40.0, 3000.0, 0.0, 0.0, -2.5e5], [0.0, 0.0, 0.0, 0.0, 0.0, -60.0, 0.0, 0.0],
]  # fmt: skip


@pytest.mark.parametrize("distortion", RADIAL[:5])
@pytest.mark.parametrize("share", [0.9, 0.995, 1.005, 1.1, 1.5])
def test_a_distortion_is_refused_where_it_folds_inside_the_image_and_only_there(distortion, share):
    """The focal length is chosen so that the image's corner lies at `share` of the fold: the preset has 0.19."""
    radius, distorted = limit_of(distortion)
    focal = math.hypot(62.5, 62.5) / (share * distorted)
    data = changed(*TABLE, to={"distortion": distortion, "fx": focal, "fy": focal})
    # within the factor of 2 that the pitch allows
    data["camera"]["detector"]["pitch_mm"] *= focal_px() / focal
    data["camera"]["intrinsics"].pop("fx"), data["camera"]["intrinsics"].pop("fy")
    if share < 1:
        Scene.from_dict(data)
        return
    message = refusal(data)
    assert message.startswith("my.toml: camera.intrinsics.distortion = [")
    assert "must be one-to-one in the image; it folds beyond " in message
    told = float(message.split("folds beyond ")[1].split()[0])
    assert 0.8 * radius <= told <= 1.001 * radius
    assert "focal lengths from the principal point, towards pixel [" in message


def test_a_fold_on_one_side_alone_is_found():
    """A principal point near one corner: the far corner alone is beyond the fold."""
    k1 = -1 / (3 * (1.5 * 140.0 / focal_px()) ** 2)  # the largest distorted radius, 2/3 of 1 / sqrt(-3 k1): 140 pixels
    distortion = [k1, 0.0, 0.0, 0.0]
    assert 115.0 < limit_of(distortion)[1] * focal_px() < math.hypot(115.0, 115.0)
    scene_with(distortion=distortion)  # centred
    message = refusal(changed(*TABLE, to={"distortion": distortion, "principal_point_px": [9.5, 9.5]}))
    column, row = message.rsplit("[", 1)[1].rstrip("]").split(",")
    assert (float(column), float(row)) == pytest.approx((124.5, 124.5), abs=32)


def test_a_fold_between_two_rising_parts_is_found():
    """The radius rises, falls and rises again: a point beyond has three images, though the edge's own is steep."""
    c = [-12.0, 0.0, 0.0, 0.0, 600.0]
    r = np.linspace(0, 1, 100001)
    distorted = lens_distortion.distort(r, 0 * r, lens_distortion.full(tuple(c)))[0]
    assert np.any(np.diff(distorted) < 0) and np.diff(distorted)[-1] > 0
    message = refusal(changed(*TABLE, to={"distortion": c}))
    assert "folds beyond" in message


@pytest.mark.parametrize("distortion", [RADIAL[5], [0.0, 0.0, 0.0, 0.0, 0.0, -1e6, 1e6, -1e6], [1e6] * 8, [-1e6] * 8,
                                        [0.0, 0.0, 1e6, 1e6], [0.0, 0.0, 0.0, 0.0, 0.0, 1e6, 1e6, 1e6]])  # fmt: skip
def test_absurd_distortions_end_in_a_line_and_soon(distortion):
    started = time.perf_counter()
    try:
        Scene.from_dict(changed(*TABLE, to={"distortion": distortion}))
    except SceneError as error:
        assert "distortion" in str(error) and str(error).isprintable()
    assert time.perf_counter() - started < 5


def test_tangential_distortion_that_folds_is_refused():
    assert "folds beyond" in refusal(changed(*TABLE, to={"distortion": [0.0, 0.0, 4.0, 0.0]}))
    scene_with(distortion=[0.0, 0.0, 0.1, -0.1])
