"""What the non-sequential tracer makes of a scene: its parts, where their positions are told from, what glows."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from irtscots_cl.maths.frame import Frame
from irtscots_cl.optics.elements.components import FAR_MM, components_of, groups_of, on_screen, targets_of
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import Harvey, Lambertian

CAMERA = [("stop", "absorber"), ("lens", "lens"), ("detector", "detector")]
WINDOW = [("window.front", "refractor"), ("window.back", "refractor")]
SINGLET = [("lens.front", "refractor"), ("lens.back", "refractor")]
PRESETS = {
    "sphere": ("quadric", CAMERA),
    "sphere-deviated": ("deviated", CAMERA),
    "off-axis": ("quadric", CAMERA),
    "baffled": ("quadric", [*CAMERA, ("baffle", "absorber"), ("ring", "absorber")]),
    "sphere-window": ("quadric", [*CAMERA, *WINDOW]),
    "sphere-singlet": ("quadric", [CAMERA[0], CAMERA[2], *SINGLET]),
    "sphere-doublet": (
        "quadric", [CAMERA[0], CAMERA[2], SINGLET[0], ("lens.cement", "refractor"), SINGLET[1]]
    ),
    "ghosts": ("quadric", [CAMERA[0], CAMERA[2], *WINDOW, ("panel", "mirror"), *SINGLET]),
}  # fmt: skip


def named(scene):
    return {component.name: component for component in components_of(scene)}


def with_element(**values):
    """The ideal sphere with one element more, and that element's part."""
    values = {"name": "more", "kind": "mirror", "position_mm": (30.0, 40.0, 900.0), "facing_mm": (0.0, 0.0, 0.0),
              "diameter_mm": 20.0} | values  # fmt: skip
    scene = load_scene("sphere")
    scene = dataclasses.replace(scene, element=(*scene.element, Element(**values)))
    return scene, components_of(scene)[-1]


@pytest.mark.parametrize("name", PRESETS)
def test_presets_have_these_parts_in_this_order(name):
    shape, rest = PRESETS[name]
    components = components_of(load_scene(name))
    assert [(component.name, component.kind) for component in components] == [("mirror", "mirror"), *rest]
    assert components[0].shape == shape
    assert {component.shape for component in components[1:]} <= {"plane", "quadric"}


def test_the_mirror_is_the_worlds_frame_and_scatters_if_told():
    scene = load_scene("sphere")
    mirror = dataclasses.replace(scene.mirror, scatter=Harvey(0.01, -1.5, tis=0.0025), obscuration_mm=30.0,
                                 reflectance=0.9)  # fmt: skip
    component = components_of(dataclasses.replace(scene, mirror=mirror))[0]
    assert (component.kind, component.scatter, component.reflectance) == ("mirror", mirror.scatter, 0.9)
    assert (component.outer_mm, component.inner_mm) == (mirror.diameter_mm / 2, 15.0)
    np.testing.assert_array_equal(component.frame.position_mm, np.zeros(3))
    np.testing.assert_array_equal(component.frame.axes, np.eye(3))


@pytest.mark.parametrize("name", PRESETS)
def test_the_camera_lies_along_its_line_of_sight(name):
    """Stop and lens in the aperture, the detector behind it; all turned like the camera, x horizontal."""
    scene, components = load_scene(name), named(load_scene(name))
    camera = scene.camera
    position, look = np.array(camera.position_mm), np.array(camera.look_at_mm)
    away = (position - look) / np.linalg.norm(position - look)
    behind = camera.detector_distance_mm or camera.image_distance_mm
    assert behind > 0
    expected = {"stop": position, "detector": position + behind * away}
    expected |= {"lens": position} if camera.lens == "paraxial" else {}
    for key, place in expected.items():
        frame = components[key].frame
        np.testing.assert_allclose(frame.position_mm, place, rtol=0, atol=1e-11)  # rounding of 4 m
        np.testing.assert_allclose(frame.axes[2], away, rtol=0, atol=1e-14)  # rounding
        np.testing.assert_allclose(frame.axes @ frame.axes.T, np.eye(3), rtol=0, atol=1e-14)  # rounding
        assert abs(frame.axes[0, 1]) < 1e-15 and frame.axes[1, 1] > 0
        assert np.linalg.det(frame.axes) > 0
    assert ("lens" in components) == (camera.lens == "paraxial")


@pytest.mark.parametrize("name", ["sphere", "sphere-singlet"])
def test_the_cameras_apertures(name):
    """The stop's hole is the aperture, which the lens fills; no light from it passes by the stop to the detector."""
    camera, components = load_scene(name).camera, named(load_scene(name))
    width, height = (n * camera.detector.pitch_mm for n in camera.detector.pixels)
    assert components["stop"].inner_mm == camera.aperture_diameter_mm / 2
    assert components["stop"].outer_mm >= max(np.hypot(width, height), camera.aperture_diameter_mm)
    assert components["stop"].half_mm == (np.inf, np.inf)
    assert components["detector"].half_mm == pytest.approx((width / 2, height / 2), rel=1e-15)  # rounding
    assert (components["detector"].inner_mm, components["detector"].outer_mm) == (0.0, np.inf)
    if "lens" in components:
        lens = components["lens"]
        assert (lens.inner_mm, lens.outer_mm) == (0.0, components["stop"].inner_mm)
        assert (lens.focal_length_mm, lens.transmittance) == (camera.focal_length_mm, camera.transmittance)


def test_a_detector_that_is_told_its_distance_stands_there():
    scene = load_scene("sphere")
    camera = dataclasses.replace(scene.camera, detector_distance_mm=21.5)
    components = named(dataclasses.replace(scene, camera=camera))
    gap = components["detector"].frame.position_mm - components["stop"].frame.position_mm
    assert gap @ components["stop"].frame.axes[2] == pytest.approx(21.5, abs=1e-11)  # rounding of 4 m


def test_an_elements_front_faces_where_it_is_told():
    _, component = with_element(position_mm=(30.0, 40.0, 900.0), facing_mm=(10.0, -60.0, 850.0))
    way = np.array([-20.0, -100.0, -50.0])
    np.testing.assert_array_equal(component.frame.position_mm, [30.0, 40.0, 900.0])
    np.testing.assert_allclose(component.frame.axes[2], way / np.linalg.norm(way), rtol=0, atol=1e-14)  # rounding
    np.testing.assert_allclose(component.frame.axes @ component.frame.axes.T, np.eye(3), rtol=0, atol=1e-14)  # rounding


def test_an_elements_aperture_and_numbers():
    _, disk = with_element(diameter_mm=20.0, obscuration_mm=6.0)
    assert (disk.outer_mm, disk.inner_mm, disk.half_mm) == (10.0, 3.0, (np.inf, np.inf))
    assert (disk.shape, disk.reflectance, disk.transmittance) == ("plane", 1.0, 1.0)
    _, plate = with_element(diameter_mm=None, size_mm=(8.0, 6.0), reflectance=0.04)
    assert (plate.outer_mm, plate.inner_mm, plate.half_mm, plate.reflectance) == (np.inf, 0.0, (4.0, 3.0), 0.04)
    _, glass = with_element(kind="refractor", index_front=1.0, index_back=1.5)
    assert (glass.index_front, glass.index_back) == (1.0, 1.5) and np.isnan(glass.reflectance)  # Fresnel's
    _, coated = with_element(kind="refractor", index_front=1.0, index_back=1.5, reflectance=0.0)
    assert coated.reflectance == 0.0
    _, lens = with_element(kind="lens", focal_length_mm=-30.0, transmittance=0.5)
    assert (lens.focal_length_mm, lens.transmittance, lens.shape) == (-30.0, 0.5, "plane")
    _, black = with_element(kind="absorber")
    assert black.focal_length_mm == np.inf
    _, layer = with_element(kind="refractor", index_front=1.0, index_back=1.5, coating_index=1.2)
    assert (layer.kind, layer.coating_index, layer.refracts) == ("coated", 1.2, True)
    assert glass.refracts and not black.refracts
    _, wall = with_element(kind="absorber", scatter=Lambertian(0.3))
    assert (wall.kind, wall.scatter) == ("diffuser", Lambertian(0.3))
    _, meter = with_element(kind="detector")
    assert (meter.kind, meter.scatter, black.kind) == ("absorber", None, "absorber")  # pixels has the camera's alone


# --- targets ------------------------------------------------------------------------------------------------


def targets(scene):
    return {target.name: target for target in targets_of(scene)}


def test_a_scattering_mirror_aims_at_the_camera_alone():
    scene = load_scene("sphere")
    mirror = dataclasses.replace(scene.mirror, scatter=Lambertian(0.1))
    found = targets(dataclasses.replace(scene, mirror=mirror))
    assert list(found) == ["stop"]
    stop = found["stop"]
    assert stop.radius_mm == scene.camera.aperture_diameter_mm / 2
    np.testing.assert_array_equal(stop.frame.position_mm, scene.camera.position_mm)
    np.testing.assert_array_equal(stop.frame.axes, named(scene)["stop"].frame.axes)


def test_other_scatterers_also_aim_at_detector_mirror_and_what_is_important():
    """Disks that hold the elements' apertures: round ones, rectangles by their corners."""
    scene, _ = with_element(kind="absorber", scatter=Lambertian(0.1))
    assert list(targets(scene)) == ["stop", "detector", "mirror"]
    more = Element("plate", "absorber", (0.0, 0.0, 700.0), (0.0, 0.0, 0.0), size_mm=(6.0, 8.0), important=True)
    found, components = targets(dataclasses.replace(scene, element=(*scene.element, more))), named(scene)
    assert list(found) == ["stop", "detector", "mirror", "plate"]
    assert found["plate"].radius_mm == 5.0  # half of the diagonal of 6 by 8
    assert found["mirror"].radius_mm == scene.mirror.diameter_mm / 2
    detector = scene.camera.detector
    assert found["detector"].radius_mm == pytest.approx(np.hypot(*detector.pixels) * detector.pitch_mm / 2, rel=1e-15)
    np.testing.assert_array_equal(found["detector"].frame.position_mm, components["detector"].frame.position_mm)


def test_an_important_element_is_a_target_of_the_mirrors_scatter_too():
    scene, _ = with_element(important=True)
    assert list(targets(scene)) == ["stop", "more"]
    assert targets(scene)["more"].radius_mm == 10.0


@pytest.mark.parametrize("radius", [120.0, -120.0])
def test_the_centre_of_curvature_lies_on_the_front_for_a_radius_above_0(radius):
    """Points of the sphere about (0, 0, radius) in the element's frame fulfil the quadric's equation."""
    _, component = with_element(radius_mm=radius)
    q, angle = component.quadric, np.linspace(-1.2, 1.2, 25)
    x, y = abs(radius) * np.sin(angle) * 0.6, abs(radius) * np.sin(angle) * 0.8
    z = radius - np.sign(radius) * np.sqrt(radius**2 - x**2 - y**2)
    assert component.shape == "quadric"
    left = q.q_xx * x * x + q.q_yy * y * y + q.q_zz * z * z + 2 * q.q_xz * x * z - 2 * z
    np.testing.assert_allclose(left, 0, atol=1e-13 * abs(radius))  # rounding
    assert (q.q_zz * z + q.q_xz * x < 1).all()  # on the side that the kernels take for the surface


@pytest.mark.parametrize("radius", [120.0, -120.0])
def test_a_segment_of_a_conic_bends_away_from_the_axis_on_either_side(radius):
    """Points of the paraboloid z = (x^2 + y^2) / 2 R, taken to the segment's frame apart from the package.

    Behind the front the same surface stands upside down: z changes its sign, +x stays away from the axis.
    """
    off, size = 50.0, abs(radius)
    _, component = with_element(radius_mm=radius, conic=-1.0, off_axis_mm=off)
    x, y = np.meshgrid(off + np.linspace(-8, 8, 9), np.linspace(-8, 8, 9))
    z = (x * x + y * y) / (2 * size)
    slope = np.arctan2(off, size)  # of the parent at the segment's middle
    dx, dz = x - off, z - off * off / (2 * size)
    u, w = np.cos(slope) * dx + np.sin(slope) * dz, -np.sin(slope) * dx + np.cos(slope) * dz
    w = w * np.sign(radius)
    q = component.quadric
    left = q.q_xx * u * u + q.q_yy * y * y + q.q_zz * w * w + 2 * q.q_xz * u * w - 2 * w
    np.testing.assert_allclose(left, 0, atol=1e-12)  # rounding of 10 mm


# --- groups and the screen ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PRESETS)
def test_positions_are_told_from_what_is_near(name):
    """Mirror, screen and camera are origins 0, 1 and 2; no part is far from its own."""
    scene = load_scene(name)
    components = components_of(scene)
    origins, numbers = groups_of(scene, components)
    np.testing.assert_array_equal(origins[:3], [np.zeros(3), scene.screen.position_mm, scene.camera.position_mm])
    of = {component.name: number for component, number in zip(components, numbers, strict=True)}
    assert (of["mirror"], of["stop"], of["detector"]) == (0, 2, 2)
    assert all(number == 1 for key, number in of.items() if key.startswith(("window", "panel")))
    assert all(number == 2 for key, number in of.items() if key.startswith("lens"))
    for component, number in zip(components, numbers, strict=True):
        assert np.linalg.norm(component.frame.position_mm - origins[number]) <= FAR_MM
    assert len(origins) == 3


def test_an_element_far_from_all_gets_a_group_that_its_neighbours_share():
    scene, _ = with_element(name="far", position_mm=(2000.0, 0.0, 1500.0))
    near = Element(**(dataclasses.asdict(scene.element[-1]) | {"name": "near", "position_mm": (2000.0, 0.0, 1600.0)}))
    scene = dataclasses.replace(scene, element=(*scene.element, near))
    components = components_of(scene)
    origins, numbers = groups_of(scene, components)
    assert len(origins) == 4
    np.testing.assert_array_equal(origins[3], [2000.0, 0.0, 1500.0])
    assert numbers.tolist() == [0, 2, 2, 2, 3, 3]


@pytest.mark.parametrize(("height", "group"), [(FAR_MM, 0), (FAR_MM * 1.001, 3)])
def test_far_begins_here(height, group):
    scene, _ = with_element(position_mm=(0.0, 0.0, height), facing_mm=(0.0, 0.0, 4000.0))
    origins, numbers = groups_of(scene, components_of(scene))
    assert numbers[-1] == group
    assert len(origins) == max(3, group + 1)


@pytest.mark.parametrize("name", PRESETS)
def test_only_the_panel_of_ghosts_lies_in_the_screen(name):
    scene = load_scene(name)
    components = components_of(scene)
    number = on_screen(scene, components)
    assert (components[number].name if number >= 0 else None) == ("panel" if name == "ghosts" else None)


@pytest.mark.parametrize(
    ("along_mm", "aside_mm", "turn", "found"),
    [(0.0, 0.0, 1, True), (0.0, 35.0, 1, True), (0.0, 0.0, -1, True),  # aside in its plane; its back to the mirror
     (1e-3, 0.0, 1, False), (-1e-3, 0.0, 1, False)],
)  # fmt: skip
def test_what_lies_in_the_screens_plane(along_mm, aside_mm, turn, found):
    """A plate moved along the screen's normal by 1 um no longer does; in the plane or turned over it does."""
    screen = load_scene("sphere").screen
    frame = Frame.looking(screen.position_mm, screen.look_at_mm)
    place = frame.position_mm + along_mm * frame.axes[2] + aside_mm * frame.axes[0]
    scene, _ = with_element(position_mm=tuple(place.tolist()),
                            facing_mm=tuple((place - turn * 4000 * frame.axes[2]).tolist()))  # fmt: skip
    components = components_of(scene)
    assert on_screen(scene, components) == (len(components) - 1 if found else -1)


def test_a_tilted_or_curved_element_at_the_screen_does_not_lie_in_it():
    place = load_scene("sphere").screen.position_mm
    scene, _ = with_element(position_mm=place, facing_mm=(0.1, 0.0, 0.0))  # 2e-5 rad
    assert on_screen(scene, components_of(scene)) == -1
    scene, _ = with_element(position_mm=place, radius_mm=1e6)
    assert on_screen(scene, components_of(scene)) == -1
