"""The oracle of a real set-up against closed forms, OpenCV's own numbers, and itself reversed."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from oracle import light, panel, picture
from oracle.rig import Rig, with_fault
from oracle.setup_text import MIRRORS, setup_text

TERMS = (-0.31, 0.12, 0.004, -0.0025, -0.02, 0.05, -0.03, 0.01)


@pytest.mark.parametrize("terms, place, expected", [
    ([0.1], (0.5, 0.0), (0.5125, 0.0)),  # s = 1/4: 1 + k1 s
    ([0, 0.1], (0.5, 0.0), (0.503125, 0.0)),
    ([0, 0, 0.01], (0.1, 0.2), (0.1004, 0.2013)),  # x + 2 p1 x y, y + p1 (s + 2 y^2)
    ([0, 0, 0, 0.01], (0.1, 0.2), (0.1007, 0.2004)),  # x + p2 (s + 2 x^2), y + 2 p2 x y
    ([0, 0, 0, 0, 0.1], (0.5, 0.0), (0.50078125, 0.0)),
    ([0, 0, 0, 0, 0, 0.1], (0.5, 0.0), (0.5 / 1.025, 0.0)),
    ([0, 0, 0, 0, 0, 0, 0.1], (0.5, 0.0), (0.5 / 1.00625, 0.0)),
    ([0, 0, 0, 0, 0, 0, 0, 0.1], (0.5, 0.0), (0.5 / 1.0015625, 0.0)),
])  # fmt: skip
def test_distortion_term_by_term(terms, place, expected):
    np.testing.assert_allclose(picture.bend(*place, (*terms, *[0] * (8 - len(terms)))), expected, rtol=1e-15)


def test_distortion_is_opencvs():
    # cv2.projectPoints of OpenCV 5.0.0: no turn, no shift, camera matrix diag(1000, 1100, 1), five and eight terms
    x, y = np.array([0.3, -0.25, 0.05]), np.array([-0.2, 0.4, 0.11])
    five = [[287.250218, -235.855111796875, 49.769975847864], [-210.3164932, 415.10499676250, 120.59591155183087]]
    eight = [[285.5252434391211, -233.5938504386448, 49.73398291324048],
             [-209.05151185535544, 411.12517677201487, 120.50880865004194]]  # fmt: skip
    for terms, expected in (((*TERMS[:5], 0, 0, 0), five), (TERMS, eight)):
        np.testing.assert_allclose(np.multiply(picture.bend(x, y, terms), [[1000], [1100]]), expected, rtol=1e-14)


def test_a_turned_camera_sees_world_points_where_opencv_sees_them():
    # cv2.projectPoints of OpenCV 5.0.0 with the turn diag(1, -1, -1) axes and the shift -turn position
    camera = {
        "position_mm": [-70.0, -120.0, 1530.0], "look_at_mm": [25.0, -18.0, 4.0], "roll_deg": 17.0,
        "aperture_diameter_mm": 1.0, "focal_length_mm": 20.0, "detector": {"pixels": [180, 130], "pitch_mm": 0.05},
        "intrinsics": {"fx": 410.0, "fy": 402.0, "principal_point_px": [88.3, 64.9], "distortion": TERMS[:5]},
    }  # fmt: skip
    eye = picture.Eye.of(camera)
    points = np.array([[10.0, 20.0, 5.0], [-90.0, 40.0, 12.0], [120.0, -100.0, 20.0]])
    row, column, a, b = eye.receives(points, eye.place - points)
    np.testing.assert_allclose(column, [87.46131137075504, 63.53448954707932, 106.61302761263539], atol=1e-10)
    np.testing.assert_allclose(129 - row, [54.221861109061344, 41.25717114763989, 92.85132793206569], atol=1e-10)
    np.testing.assert_allclose([a, b], 0, atol=1e-12)


def test_the_stored_picture_is_cut_and_joined_from_the_calibrated_one():
    eye = Rig.of(setup_text()).eye
    whole = dataclasses.replace(eye, first=(0, 0), joined=(1, 1), size=(220, 90))
    # column 3 of the stored picture joins the whole one's 26 and 27; its fifth line from the top is the whole one's 15
    x, y = eye.ideal_point(61 - 1 - 4, 3)
    row, column = whole.grid_place(x, y)
    np.testing.assert_allclose([90 - 1 - row, column], [15, 26.5], atol=1e-12)
    area = sum(whole.picture_area(row, k) for k in (26, 27))
    assert math.isclose(eye.picture_area(56, 3), area, rel_tol=1e-5)  # the sum is a rule of two points


def test_the_picture_has_its_x_to_the_right_and_its_lines_downwards():
    eye = Rig.of(setup_text()).eye
    row, column, _, _ = eye.receives(np.zeros(3), eye.place)
    for axis, down, right in ((0, 0, 1), (1, -1, 0)):
        point = 20 * eye.axes[axis]
        new_row, new_column, _, _ = eye.receives(point, eye.place - point)
        assert np.sign(np.round(row - new_row)) == down and np.sign(np.round(new_column - column)) == right


def test_undone_distortion_comes_back():
    x, y = np.meshgrid(np.linspace(-0.35, 0.35, 15), np.linspace(-0.3, 0.3, 11))
    back = picture.bend(*picture.unbend(x, y, TERMS), TERMS)
    np.testing.assert_allclose(back, [x, y], atol=1e-15)
    with pytest.raises(ValueError, match="cannot be undone"):
        picture.unbend(1.0, 0.0, (-0.31, 0, 0, 0, 0, 0, 0, 0))  # x (1 - 0.31 x^2) has its highest at 0.691


def test_the_lens_joins_the_rays_of_a_point_in_focus():
    eye = Rig.of(setup_text()).eye
    a, b = np.array([1.2, -0.8, 0.0, 0.3]), np.array([0.1, 0.9, 0.0, -1.1])
    start, along = eye.looks_along(np.full(4, 12.3), np.full(4, 70.2), a, b)
    far = start + along * eye.focus  # along has -1 on the axis
    assert np.ptp(far, axis=0).max() < 1e-11
    axis = eye.place - eye.stop_offset[0] * eye.axes[0] - eye.stop_offset[1] * eye.axes[1]  # where the optical axis is
    row, column, _, _ = eye.receives(axis, eye.axes[2])
    np.testing.assert_allclose(eye.ideal_point(row, column), 0, atol=1e-14)


def rays(rig, count=400):
    """Rays that meet the mirror: rows, columns and aperture points."""
    random = np.random.default_rng(3)
    row, column = random.uniform(0, 60, 4 * count), random.uniform(0, 89, 4 * count)
    radius, angle = 1.5 * np.sqrt(random.random(4 * count)), 2 * np.pi * random.random(4 * count)
    a, b = radius * np.cos(angle), radius * np.sin(angle)
    on = rig.mirror.contains(rig.mirror.meet(*rig.eye.looks_along(row, column, a, b)))
    return [k[on][:count] for k in (row, column, a, b)]


@pytest.mark.parametrize("plate", ["offset", "local", None])
@pytest.mark.parametrize("mirror", MIRRORS)
def test_rays_run_the_same_way_back(mirror, plate):
    rig = Rig.of(setup_text(mirror, glass=plate is not None), plate=plate or "offset")
    row, column, a, b = rays(rig)
    assert len(row) == 400
    path = rig.back(row, column, a, b)
    point, *arrived = rig.forth(path.u, path.v, -path.away)
    assert np.abs(point - path.mirror).max() < 1e-11  # mm
    for found, given in zip(arrived, (row, column, a, b), strict=True):
        assert np.abs(found - given).max() < 1e-11  # pixels and mm
    again = rig.back(*rig.image_of(path.u, path.v, a, b, row + 0.7, column - 0.4), a, b)
    assert max(np.abs(again.u - path.u).max(), np.abs(again.v - path.v).max()) < 1e-10  # mm; the concave one has folds


def test_a_convex_sphere_reflects_as_a_sphere_does():
    text = setup_text("convex", zernike=False, glass=False).replace("conic = -0.3", "conic = 0.0")
    rig = Rig.of(text)
    path = rig.back(*rays(rig)[:2])
    centre = np.array([0.0, 0.0, -2600.0])
    np.testing.assert_allclose(np.linalg.norm(path.mirror - centre, axis=-1), 2600, rtol=1e-15)
    normal = (path.mirror - centre) / 2600
    ways = [panel.unit(k) for k in (path.start - path.mirror, path.away)]
    np.testing.assert_allclose(panel.unit(ways[0] + ways[1]), normal, atol=1e-15)


def test_a_flat_mirror_shows_the_screen_behind_itself():
    rig = Rig.of(setup_text("flat", zernike=False, glass=False))
    path = rig.back(*rays(rig))
    image = rig.panel.world(path.u, path.v) * [1, 1, -1]
    straight = np.cross(panel.unit(image - path.start), panel.unit(path.mirror - path.start))
    assert np.abs(straight).max() < 1e-14


def test_pixels_are_on_the_bent_and_turned_screen():
    # the pixel at the grid's right edge, half way up: s = 1, t = 0 of the sag's polynomial
    here = Rig.of(setup_text(glass=False)).panel
    half, (u, v) = 61 * 0.9 / 2, (1.3, -7.3)
    x, y, z = picture.frame_axes([75, 130, 1540], [330, -400, 0])
    c, s = math.cos(math.radians(-33)), math.sin(math.radians(-33))
    expected = np.array([75, 130, 1540]) + (half + u) * (c * x + s * y) + v * (c * y - s * x) + (0.2 + 3.1) * z
    np.testing.assert_allclose(here.world(half + u, v), expected, atol=1e-12)
    edges = here.line_edges(0)[[0, -1]] - u
    np.testing.assert_allclose(edges, [[-half, -half + 0.9], [half - 0.9, half]], atol=1e-12)
    sparse = here.line_edges(1, first=2, step=5, width=3) - v
    np.testing.assert_allclose(sparse[1], [-77 * 0.375 + 7 * 0.75, -77 * 0.375 + 10 * 0.75], atol=1e-12)
    assert len(sparse) == 15 and sparse[-1, 1] <= 77 * 0.375


def test_a_sheet_s_tangents_are_its_derivatives():
    sheet = Rig.of(setup_text()).panel.sheet
    u, v = np.array([3.0, -20.0, 11.0]), np.array([-14.0, 2.0, 6.0])
    _, along_u, along_v = sheet(u, v)
    _, by_u, by_v = panel.map_sheet(lambda u, v: sheet(u, v)[0])(u, v)
    np.testing.assert_allclose([along_u, along_v], [by_u, by_v], atol=1e-9)  # differences over 1e-3 mm


def test_glass_moves_rays_as_a_plane_parallel_plate():
    # a bare plane panel at z = 0 that shines towards -z; rays at 40 degrees in the x-z plane
    angle, n, t = math.radians(40), 1.52, 2.2
    bare = panel.Panel(np.zeros(3), np.eye(3), (11, 11), (1.0, 1.0))
    direction = np.array([[math.sin(angle), 0.0, math.cos(angle)]])
    start = np.array([[-50.0, 3.0, -80.0]])
    u, _ = bare.meets(start, direction)
    shift = t * (math.tan(math.asin(math.sin(angle) / n)) - math.tan(angle))
    for plate in ("offset", "local"):
        covered = dataclasses.replace(bare, thickness=t, index=n, plate=plate)
        got_u, got_v = covered.meets(start, direction)
        np.testing.assert_allclose([got_u - u, got_v], [[shift], [3.0]], atol=1e-13)


def test_the_two_readings_of_a_bent_plate_differ_by_its_curvature():
    one, other = (Rig.of(setup_text(), plate=plate) for plate in ("offset", "local"))
    row, column = rays(one)[:2]
    first, second = (rig.back(row, column) for rig in (one, other))
    differ = np.hypot(first.u - second.u, first.v - second.v).max()
    assert 1e-6 < differ < 0.01  # mm; about thickness^2 x slope / radius of curvature = 4.8 x 0.2 / 120 at most


def test_measured_points_stand_for_a_sag():
    text = setup_text(glass=False)
    rig = Rig.of(text)
    row, column = rays(rig)[:2]
    exact = rig.back(row, column)

    def where(u, v):
        return rig.panel.sheet(u, v)[0]

    same = dataclasses.replace(rig, panel=dataclasses.replace(rig.panel, sheet=panel.map_sheet(where)))
    found = same.back(row, column)
    np.testing.assert_allclose([found.u, found.v], [exact.u, exact.v], atol=1e-11)
    knots = np.linspace(-30, 30, 121), np.linspace(-40, 25, 131)
    table = where(*np.meshgrid(*knots, indexing="ij"))
    joined = dataclasses.replace(rig.panel, sheet=panel.map_sheet(panel.bilinear_map(*knots, table), 1e-6))
    found = dataclasses.replace(rig, panel=joined).back(row, column)
    # between knots 0.5 mm apart: z'' / 8 x 0.5^2 = 0.0003 mm of height, times the slope of the rays on the screen
    np.testing.assert_allclose([found.u, found.v], [exact.u, exact.v], atol=3e-4)


def test_faults_move_what_their_names_say():
    rig = Rig.of(setup_text())
    eye, screen = rig.eye, rig.panel
    assert np.allclose(with_fault(rig, "camera.y_mm", 0.3).eye.place - eye.place, [0, 0.3, 0])
    rolled = with_fault(rig, "camera.roll_rad", 1e-3).eye.axes
    np.testing.assert_allclose(rolled[0], eye.axes[0] + 1e-3 * eye.axes[1], atol=1e-6)
    tilted = with_fault(rig, "screen.tilt_x_rad", 1e-3).panel.axes
    np.testing.assert_allclose(tilted[2], screen.axes[2] - 1e-3 * screen.axes[1], atol=1e-6)
    one = with_fault(rig, "screen.pitch_relative", 1e-3).panel.sheet(2.0, 3.0)[0]
    other = with_fault(rig, "screen.pitch_y_relative", 1e-3).panel.sheet(2.0, 3.0)[0]
    np.testing.assert_allclose([one[:2], other[:2]], [[2.002, 3.003], [2.0, 3.003]])
    sag = with_fault(rig, "screen.sag_2_0_mm", 0.1).panel.sheet(61 * 0.45 + 1.3, -7.3)[0]
    assert math.isclose(sag[2], 0.2 + 3.1 + 0.1)
    wider = with_fault(rig, "camera.focal_relative", 0.01).eye.scale
    np.testing.assert_allclose(wider, [646.4, 334.31])
    assert with_fault(rig, "zernike.4_um", 0.2).mirror.deviation(np.zeros(1), np.zeros(1))[0] != 0


@pytest.mark.parametrize("quantity", ["x_mm", "y_mm", "z_mm", "tilt_x_rad", "tilt_y_rad", "clocking_rad"])
def test_a_moved_mirror_is_a_moved_rest_of_the_world(quantity):
    # seen from the moved mirror's frame: distances between devices stay, and a point of the mirror moves as named
    rig = Rig.of(setup_text())
    value = 1e-3 if quantity.endswith("rad") else 0.5
    moved = with_fault(rig, f"mirror.{quantity}", value)
    apart = [np.linalg.norm(r.eye.place - r.panel.place) for r in (rig, moved)]
    assert math.isclose(*apart, rel_tol=1e-14)
    centre = moved.eye.axes @ (np.zeros(3) - moved.eye.place) - rig.eye.axes @ (np.zeros(3) - rig.eye.place)
    shift = value * np.eye(3)["xyz".index(quantity[0])] if quantity.endswith("_mm") else np.zeros(3)
    np.testing.assert_allclose(centre, rig.eye.axes @ shift, atol=1e-12)
    axis = {"tilt_x_rad": [1, 0, 0], "tilt_y_rad": [0, 1, 0], "clocking_rad": [0, 0, 1]}.get(quantity, [0, 0, 0])
    for k in np.eye(3):  # a direction fixed to the mirror, in the camera's frame
        expected = rig.eye.axes @ (k + value * np.cross(axis, k))
        np.testing.assert_allclose(moved.eye.axes @ k, expected, atol=1e-6)


# --- light ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", [0, 1])
def test_light_of_a_pixel(axis):
    rig = Rig.of(setup_text())
    edges = rig.panel.line_edges(axis)
    flux = light.line_flux(rig, 20, 38, edges, axis)
    finer = light.line_flux(rig, 20, 38, edges, axis, points=12, chords=300)
    assert np.abs(flux - finer).max() < 1e-6 * flux.max()
    rayed = light.binned_flux(rig, 20, 38, edges, axis)
    assert np.abs(flux - rayed).max() < 5e-3 * flux.max()  # 50,000 even rays
    assert math.isclose(flux.sum(), rayed.sum(), rel_tol=1e-7)  # all of it is on the screen; smooth: few rays do


def test_light_is_radiance_times_aperture_times_solid_angle():
    rig = Rig.of(setup_text().replace("aperture_diameter_mm = 3.0", "aperture_diameter_mm = 0.1"))
    row, column = 46, 13
    flux = light.line_flux(rig, row, column, rig.panel.line_edges(0), 0).sum()
    corners = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])
    ways = panel.unit(rig.eye.looks_along(row + corners[:, 0], column + corners[:, 1])[1])
    # a spherical triangle's solid angle: tan(E / 2) = a . (b x c) / (1 + a . b + b . c + c . a)  (Eriksson 1990)
    angle = 0.0
    for a, b, c in (ways[[0, 1, 2]], ways[[0, 2, 3]]):
        angle += 2 * math.atan2(abs(a @ np.cross(b, c)), 1 + a @ b + b @ c + c @ a)
    cosine = -panel.unit(ways.sum(0)) @ rig.eye.axes[2]
    assert cosine < 0.996  # to tell its powers apart
    expected = 2.0 * 0.8 * 0.9 * (math.pi / 4 * 0.1**2) * cosine * angle
    assert math.isclose(flux, expected, rel_tol=2e-4)


def test_light_of_the_sphere_s_centre_is_the_closed_form():
    # pi r^2 of the aperture, the pixel's solid angle at the image distance, cosines of nearly 1
    text = """
[mirror]
radius_mm = 4166.747
diameter_mm = 1064.0
[screen]
position_mm = [218.0707, 0.0, 4161.0366]
pixels = [21, 21]
pitch_mm = 0.2
[camera]
position_mm = [-218.0707, 0.0, 4161.0366]
aperture_diameter_mm = 1.0
focal_length_mm = 16.0
[camera.detector]
pixels = [125, 125]
pitch_mm = 0.037
"""
    rig = Rig.of(text)
    flux = light.line_flux(rig, 62, 62, rig.panel.line_edges(0), 0)
    image = 1 / (1 / 16 - 1 / math.hypot(218.0707, 4161.0366))
    assert math.isclose(flux.sum(), math.pi / 4 * (0.037 / image) ** 2, rel_tol=1e-5)
    # the aperture's image on the screen is as large as the aperture: the middle line and three lines cut it at 0.2, 0.6
    share = [2 / math.pi * (math.asin(k) + k * math.sqrt(1 - k * k)) for k in (0.2, 0.6)]
    np.testing.assert_allclose([flux[10] / flux.sum(), flux[9:12].sum() / flux.sum()], share, rtol=0.02)


def test_light_that_is_not_all_there_is_refused():
    rig = Rig.of(setup_text())
    with pytest.raises(ValueError, match="rim"):
        light.line_flux(rig, 0, 0, rig.panel.line_edges(0), 0)
    short = dataclasses.replace(rig, panel=dataclasses.replace(rig.panel, size=(61, 3)))
    with pytest.raises(ValueError, match="ends of the lines"):
        light.line_flux(short, 20, 38, short.panel.line_edges(0), 0)
