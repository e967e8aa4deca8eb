"""Unknowns by name, and the scenes in which they have other values."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from lopsided import lopsided

from irtscots_cl.calibration.parameters import known_parameters, moved, parameter, zernike_names
from irtscots_cl.calibration.poses import device_frame
from irtscots_cl.optics.camera_model import CameraModel
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.camera_intrinsics import Intrinsics
from irtscots_cl.scene.presets import load_scene


def test_nothing_changed_is_the_same_scene():
    scene = lopsided()
    assert moved(scene, {}) == scene == moved(scene, dict.fromkeys(known_parameters(scene), 0.0))


def test_a_flat_mirror_has_neither_radius_nor_conic_constant():
    scene = load_scene("sphere")
    flat = replace(scene, mirror=replace(scene.mirror, radius_mm=float("inf")))
    missing = {"mirror.radius_relative", "mirror.conic"}
    assert set(known_parameters(scene)) - set(known_parameters(flat)) == missing
    for name in missing:
        with pytest.raises(ValueError, match="a flat mirror has none"):
            parameter(name, flat)


@pytest.mark.parametrize("name", [*known_parameters(lopsided()), *zernike_names([4, 11])])
def test_every_known_unknown_can_be_changed(name):
    scene = lopsided()
    known = parameter(name, scene)
    assert known.scale > 0 and known.name == name and known.text
    assert moved(scene, {name: known.scale}) != scene


def test_a_shift_keeps_the_orientation_and_the_focus():
    scene = load_scene("sphere")
    camera = moved(scene, {"camera.x_mm": 3.0, "camera.y_mm": -1.0}).camera
    np.testing.assert_allclose(np.subtract(camera.position_mm, scene.camera.position_mm), [3, -1, 0], atol=1e-12)
    np.testing.assert_allclose(device_frame(camera).axes, device_frame(scene.camera).axes, atol=1e-15)  # rounding
    assert camera.image_distance_mm == pytest.approx(scene.camera.image_distance_mm, rel=1e-15)


@pytest.mark.parametrize("axis, key", [(0, "tilt_x_rad"), (1, "tilt_y_rad"), (2, "clocking_rad")])
def test_turns_are_right_handed_about_the_devices_own_axes(axis, key):
    scene, angle = lopsided(), 0.3
    before, after = (device_frame(s.screen).axes for s in (scene, moved(scene, {f"screen.{key}": angle})))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    np.testing.assert_allclose(after[axis], before[axis], atol=1e-14)  # rounding
    expected = np.cos(angle) * before[first] + np.sin(angle) * before[second]
    np.testing.assert_allclose(after[first], expected, atol=1e-14)


def test_a_roll_and_a_clocking_are_the_scenes_own():
    scene = replace(lopsided(), camera=replace(lopsided().camera, roll_deg=10.0))
    turned = moved(scene, {"camera.roll_rad": np.radians(2.0), "screen.clocking_rad": np.radians(-3.0)})
    assert turned.camera.roll_deg == pytest.approx(12.0, abs=1e-12)  # rounding
    assert turned.screen.clocking_deg == pytest.approx(-3.0, abs=1e-12)


def test_a_moved_mirror_sees_what_it_would_see_had_it_moved():
    """Distances and angles between the devices stay, and a point fixed to the mirror is where the move puts it."""
    scene = lopsided()
    changes = {"mirror.x_mm": 4.0, "mirror.z_mm": -7.0, "mirror.tilt_x_rad": 0.02, "mirror.clocking_rad": -0.03}
    after = moved(scene, changes)
    old, new = ((device_frame(s.camera), device_frame(s.screen)) for s in (scene, after))
    np.testing.assert_allclose(new[0].axes @ new[1].axes.T, old[0].axes @ old[1].axes.T, atol=1e-14)  # rounding
    apart = [axes[0].axes @ (axes[1].position_mm - axes[0].position_mm) for axes in (old, new)]
    np.testing.assert_allclose(apart[1], apart[0], atol=1e-11)
    # small turns about x and z to second order: the world point of the mirror's point (10, 20, 30)
    x, z = 0.02, -0.03
    turn = np.array([[1 - z * z / 2, -z, x * z / 2], [z, 1 - (x * x + z * z) / 2, -x], [x * z / 2, x, 1 - x * x / 2]])
    point = np.array([10.0, 20.0, 30.0])
    world = np.array([4.0, 0.0, -7.0]) + turn @ point
    seen = new[0].axes @ (point - new[0].position_mm)
    np.testing.assert_allclose(seen, old[0].axes @ (world - old[0].position_mm), atol=1e-3)  # third order of 0.036


def test_the_principal_point_is_the_pictures():
    """To the right is +x, down is -y: a principal point moved right by a pixel is a pixel more along the columns."""
    scene = load_scene("sphere")
    scene = replace(
        scene, camera=replace(scene.camera, intrinsics=Intrinsics(binning=(2, 1), image_size_px=(260, 130)))
    )
    before, after = (
        CameraModel.of(s.camera).centre
        for s in (scene, moved(scene, {"camera.principal_x_px": 1.0, "camera.principal_y_px": 2.0}))
    )
    np.testing.assert_allclose(np.subtract(after, before), [-2.0, 0.5], atol=1e-12)  # row, column of the stored grid


def test_the_form_of_the_mirror():
    changed = moved(lopsided(), {"mirror.radius_relative": 1e-3, "mirror.conic": 0.1, "zernike.4_um": 2.0}).mirror
    assert changed.radius_mm == pytest.approx(1501.5) and changed.conic == pytest.approx(-0.7)
    assert changed.zernike[-1].coefficients_um == {4: 2.0} and changed.zernike[-1].radius_mm == 180.0


def test_a_sag_is_added_to_the_screens_own_or_to_measured_points():
    from irtscots_cl.scene.screen_shape import ScreenShape

    scene = load_scene("sphere")
    corners = tuple((x, y) for x in (0.0, 1.0) for y in (0.0, 1.0))
    flat = ScreenShape(fractions=corners, points_mm=tuple((4 * x - 2, 4 * y - 2) for x, y in corners))
    scene = replace(scene, screen=replace(scene.screen, shape=flat))
    bent = moved(scene, {"screen.sag_1_1_mm": 0.5}).screen
    assert [point[2] for point in bent.shape.points_mm] == [0.5, -0.5, -0.5, 0.5]
    plain = moved(load_scene("sphere"), {"screen.sag_2_0_mm": 0.5})
    assert moved(plain, {"screen.sag_2_0_mm": 0.5}).screen.shape.sag_mm == ((2, 0, 0.5), (2, 0, 0.5))
    edge = ChiefRays(plain).screen_model.to_world(2.1, 0.0) - ChiefRays(load_scene("sphere")).screen_model.to_world(
        2.1, 0
    )
    assert np.linalg.norm(edge) == pytest.approx(0.5)


@pytest.mark.parametrize(
    "name, text",
    [
        ("camera.q_mm", "unknown 'camera.q_mm': did you mean camera.z_mm?"),
        ("screen.sag_9_9_mm", "sum of at most 10"),
        ("zernike.999_um", "from 1 to 861"),
        ("", "unknown '':"),
    ],
)
def test_unknown_names_are_refused(name, text):
    with pytest.raises(ValueError, match=re.escape(text)):
        moved(lopsided(), {name: 0.0})
