"""The camera's model against OpenCV's conventions written out: distortion, region, binning, orientation, areas."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from irtscots_cl.imaging.orientation import stored
from irtscots_cl.maths import lens_distortion
from irtscots_cl.optics.camera_model import CameraModel
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.camera_intrinsics import Intrinsics
from irtscots_cl.scene.instrument import ORIENTATIONS, Camera, Detector
from irtscots_cl.scene.presets import load_scene

STRONG = (-0.31, 0.14, 0.004, -0.003, -0.02)
RATIONAL = (0.6, -0.2, 0.002, 0.001, 0.03, 0.9, -0.1, 0.05)


def camera(pixels=(80, 60), pitch_mm=0.05, intrinsics=None, **changes) -> Camera:
    return Camera(
        position_mm=(0.0, 0.0, 1000.0),
        aperture_diameter_mm=2.0,
        focal_length_mm=4.0,
        detector=Detector(pixels=pixels, pitch_mm=pitch_mm),
        intrinsics=intrinsics,
        **changes,
    )


def grid(pixels, step: int = 3):
    columns, rows = pixels
    return np.meshgrid(np.arange(0, rows, step), np.arange(0, columns, step), indexing="ij")


def opencv_pixel(point, fx, fy, cx, cy, distortion):
    """Column and row of the picture of a point (x, y, z) of OpenCV's camera frame: x right, y down, z forwards."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (*distortion, *(0.0,) * (8 - len(distortion)))
    x, y = point[..., 0] / point[..., 2], point[..., 1] / point[..., 2]
    r2 = x**2 + y**2
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    right = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    down = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return fx * right + cx, fy * down + cy


# --- directions ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("distortion", [(), (-0.2, 0.05, 0.001, -0.002), STRONG, RATIONAL])
def test_a_pixel_sees_what_opencv_s_projection_puts_there(distortion):
    """Full picture of 80 x 60 pixels; the upright grid's rows grow upwards: the picture's last row is its first."""
    given = Intrinsics(fx=83.0, fy=79.0, principal_point_px=(41.3, 27.9), distortion=distortion)
    own = camera(intrinsics=given)
    model = CameraModel.of(own)
    row, column = grid((80, 60))
    x, y = (v / own.image_distance_mm for v in model.image_point(row, column))
    # The camera's z points backwards, from what it looks at: slopes dx/dz = -x, so the point at z = -1 is (x, y, -1).
    point = np.stack([x, -y, np.ones_like(x)], -1)  # OpenCV's axes: y down, z forwards
    right, down = opencv_pixel(point, 83.0, 79.0, 41.3, 27.9, distortion)
    np.testing.assert_allclose(right, column, atol=1e-10)
    np.testing.assert_allclose(59 - down, row, atol=1e-10)


def test_the_chief_rays_go_where_the_image_points_say():
    """A camera over a mirror: the mirror's point that a pixel sees lies along OpenCV's ray through it."""
    scene = load_scene("sphere")
    given = Intrinsics(distortion=(-0.15, 0.02, 0.001, 0.0), principal_point_px=(60.2, 65.1))
    scene = dataclasses.replace(scene, camera=dataclasses.replace(scene.camera, intrinsics=given, roll_deg=20.0))
    chief = ChiefRays(scene)
    row, column = grid((125, 125), 25)
    points, _, _ = chief.reverse(row, column)
    frame = chief.camera_frame
    away = (points - frame.position_mm) @ frame.axes.T  # in the camera's frame
    cv = np.stack([away[..., 0], -away[..., 1], -away[..., 2]], -1)
    focal = scene.camera.image_distance_mm / scene.camera.detector.pitch_mm
    right, down = opencv_pixel(cv, focal, focal, 60.2, 65.1, given.distortion)
    seen = np.isfinite(right)
    assert seen.sum() > 12
    np.testing.assert_allclose(right[seen], column[seen], atol=1e-8)
    np.testing.assert_allclose(124 - down[seen], row[seen], atol=1e-8)


@pytest.mark.parametrize("distortion", [STRONG, RATIONAL, (0.5, 0.8, 0.01, -0.01, 0.3), (-0.3,) + (0.0,) * 3])
@pytest.mark.parametrize("pixels", [(80, 60), (4000, 3000)])
def test_pixels_come_back_to_1e_10(distortion, pixels):
    pitch = 4.0 / pixels[0]
    own = camera(pixels, pitch, Intrinsics(distortion=distortion, principal_point_px=(pixels[0] * 0.52, pixels[1] * 0.45)))
    model = CameraModel.of(own)
    row, column = (v + 0.37 for v in grid(pixels, pixels[0] // 40))
    back = model.pixel(*model.image_point(row, column))
    np.testing.assert_allclose(back, (row, column), atol=1e-10)


@pytest.mark.parametrize("share", [0.9, 0.99, 0.998])
def test_pixels_come_back_close_to_where_the_distortion_folds(share):
    """k1 = -0.3 folds at r = 1.054, distorted 0.703: the image's corner at `share` of where the check refuses."""
    corner = 0.7013 * share  # determinant 0.05
    pixels, pitch = (81, 61), 0.01
    focal = np.hypot(40.5, 30.5) / corner
    own = camera(pixels, pitch * 4, Intrinsics(distortion=(-0.3, 0.0, 0.0, 0.0), fx=focal, fy=focal))
    model = CameraModel.of(own)
    row, column = np.array([-0.5, 60.5, 30.0]), np.array([-0.5, 80.5, 80.5])
    x, y = model.image_point(row, column)
    assert np.isfinite(x + y).all() and np.hypot(x, y)[0] > np.hypot(x, y)[2]
    np.testing.assert_allclose(model.pixel(x, y), (row, column), atol=1e-10)


def test_outside_the_image_there_may_be_no_direction():
    model = CameraModel.of(camera(intrinsics=Intrinsics(distortion=(-0.3, 0.0, 0.0, 0.0))))
    x, y = model.image_point(np.array([0.0, 500.0]), np.array([0.0, 500.0]))
    assert np.isfinite(x[0] + y[0]) and np.isnan(x[1]) and np.isnan(y[1])


# --- areas --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("offset", [(0.0, 0.0), (3.0, -2.0)])
@pytest.mark.parametrize("distortion", [STRONG, RATIONAL])
def test_the_stretch_is_the_area_of_the_pixel_s_image(distortion, offset):
    """Against the shoelace area of small squares about the pixels, 1e-3 of a pixel: second order."""
    model = CameraModel.of(camera(intrinsics=Intrinsics(distortion=distortion), aperture_offset_mm=offset))
    row, column = grid((80, 60), 7)
    half = 5e-4
    corners = [model.image_point(row + half * a, column + half * b) for a, b in ((-1, -1), (-1, 1), (1, 1), (1, -1))]
    area = 0.0
    for (x, y), (next_x, next_y) in itertools.pairwise([*corners, corners[0]]):
        area = area + (x * next_y - next_x * y) / 2
    area = area / (2 * half) ** 2 / model.pixel_area_mm2
    np.testing.assert_allclose(model.stretch(row, column), area, rtol=2e-7)  # rounding 1e-16 * 4 / 2.5e-9
    assert np.ptp(area) > 0.05


def test_without_distortion_nothing_is_stretched_and_the_pixels_keep_their_bits():
    plain = CameraModel.of(camera())
    assert not plain.is_distorted and plain.distortion == ()
    row, column = grid((80, 60))
    x, y = plain.image_point(row, column)
    np.testing.assert_array_equal(x, (column - 39.5) * 0.05)
    np.testing.assert_array_equal(y, (row - 29.5) * 0.05)
    assert np.all(plain.stretch(row, column) == 1.0)
    for given in (Intrinsics(), Intrinsics(distortion=(0.0,) * 5), Intrinsics(principal_point_px=(39.5, 29.5))):
        same = CameraModel.of(camera(intrinsics=given))
        np.testing.assert_array_equal(same.image_point(row, column), (x, y))
        assert same.pitch_mm == plain.pitch_mm and not same.is_distorted


def test_intrinsics_without_distortion_move_and_scale():
    given = Intrinsics(fx=90.0, principal_point_px=(-20.0, 75.0))  # outside the picture: a shifted lens
    own = camera(intrinsics=given)
    x, y = CameraModel.of(own).image_point(10.0, 20.0)
    assert x == pytest.approx((20.0 + 20.0) / 90.0 * own.image_distance_mm)
    assert y == pytest.approx((75.0 - (59 - 10.0)) * 0.05)


def test_an_aperture_off_the_axis_sees_along_other_directions():
    """The ray to a point in focus leaves for the same image point from any place of the lens."""
    own = camera(aperture_offset_mm=(3.0, -2.0))
    model, centred = CameraModel.of(own), CameraModel.of(camera())
    x, y = model.image_point(10, 20)
    there_x, there_y = centred.image_point(10, 20)
    # slopes of the chief ray: (a + a0) / focus - x_n; the axis is a0 away from the aperture's centre
    assert x / own.image_distance_mm == pytest.approx(there_x / own.image_distance_mm - 3.0 / 1000.0)
    assert y / own.image_distance_mm == pytest.approx(there_y / own.image_distance_mm + 2.0 / 1000.0)
    np.testing.assert_allclose(model.pixel(x, y), (10, 20), atol=1e-12)


# --- region, binning and orientation ------------------------------------------------------------------------


@pytest.mark.parametrize(("roi", "binning"), [((0, 0), (1, 1)), ((7, 12), (1, 1)), ((0, 0), (2, 2)), ((5, 8), (3, 2))])
@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_a_stored_pixel_is_the_part_of_the_picture_that_was_read_there(orientation, roi, binning):
    """A picture whose values are its own pixel numbers is cut, binned and stored: the numbers say what each sees."""
    full = (64, 48)  # columns, rows of the picture that was calibrated
    pixels = (18, 16)  # of the upright grid, after region and binning
    number_x, number_y = np.meshgrid(np.arange(full[0], dtype=float), np.arange(full[1], dtype=float))
    read = []
    for number in (number_x, number_y):  # [row from the top, column]
        part = number[roi[1] : roi[1] + pixels[1] * binning[1], roi[0] : roi[0] + pixels[0] * binning[0]]
        read.append(part.reshape(pixels[1], binning[1], pixels[0], binning[0]).mean((1, 3)))
    grid_x, grid_y = (part[::-1] for part in read)  # the picture's first row is at the top, the upright grid's below
    lying = stored(np.stack([grid_x, grid_y]), orientation)
    given = Intrinsics(
        image_size_px=full, principal_point_px=(30.7, 25.2), fx=50.0, fy=52.0, roi_px=roi, binning=binning,
        distortion=(-0.1, 0.02, 0.001, 0.002),
    )  # fmt: skip
    own = camera(pixels, 4.0 * binning[0] / 50.0, given)
    model = CameraModel.of(own)
    undo = {word: stored(np.arange(18 * 16).reshape(16, 18), word) for word in ORIENTATIONS}[orientation]
    for index in ((0, 0), (3, 5), (-1, -2)):
        in_picture = lying[0][index], lying[1][index]
        row, column = divmod(int(undo[index]), 18)  # of the upright grid
        x, y = (float(v) / own.image_distance_mm for v in model.image_point(row, column))
        right, down = opencv_pixel(np.array([x, -y, 1.0]), 50.0, 52.0, 30.7, 25.2, given.distortion)
        assert (right, down) == pytest.approx(in_picture, abs=1e-10)


def test_binned_pixels_have_the_binned_focal_length():
    given = Intrinsics(fx=100.0, fy=100.0, binning=(2, 4))
    own = camera((40, 20), 0.08, given)
    model = CameraModel.of(own)
    assert model.pitch_mm == pytest.approx((2 * own.image_distance_mm / 100, 4 * own.image_distance_mm / 100))
    assert model.centre == pytest.approx((9.5, 19.5))  # the middle of the whole picture, which is read out whole


def test_coefficients_of_the_upright_grid_have_p1_turned():
    model = CameraModel.of(camera(intrinsics=Intrinsics(distortion=STRONG)))
    assert model.distortion == lens_distortion.full((-0.31, 0.14, -0.004, -0.003, -0.02))
