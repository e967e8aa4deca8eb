"""Rays along a given sequence of elements, beside the independent tracer; focus and blur of paths in closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from oracle import sequence as oracle

from irtscots_cl.maths.frame import Frame
from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.optics.elements.components import Component, components_of
from irtscots_cl.optics.elements.path_focus import path_focus
from irtscots_cl.optics.elements.sequential_rays import trace_sequence
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene

LENSES = {"sphere-singlet": ["lens.front", "lens.back"], "sphere-doublet": ["lens.front", "lens.cement", "lens.back"]}
GHOST = ["lens.front", "lens.back (r)", "lens.front (r)", "lens.back"]
EVENTS = {"": 0, "(r)": 1, "(s)": 2}
LOCAL = Frame(np.zeros(3), np.eye(3))
DOWN = (0.0, 0.0, -1.0)


def events_of(components, *names):
    """Events by name, such as "lens.back (r)"."""
    numbers = {component.name: number for number, component in enumerate(components)}
    split = [name.partition(" ") for name in names]
    return [(numbers[name], EVENTS[mark]) for name, _, mark in split]


def unit(vector):
    return np.asarray(vector, float) / np.linalg.norm(vector)


# --- rays ---------------------------------------------------------------------------------------------------


def oracle_steps(scene, names):
    """The independent tracer's surfaces of a path of a preset lens."""
    by_name = dict(zip((element.name for element in scene.element), oracle.lens_of(scene), strict=True))
    steps, forward = [], True
    for name, _, mark in (name.partition(" ") for name in names):
        step = by_name[name]
        if mark:
            step, forward = replace(step, mirror=True), not forward
        elif not forward:
            step = replace(step, index_in=step.index_out, index_out=step.index_in)
        steps.append(step)
    return steps


def rays_to_the_stop(scene, count=200):
    """From points of the screen to the mirror: those that a sphere sends back through about the stop."""
    generator, (x, y, _) = np.random.default_rng(1), oracle.axes_of(scene.screen)
    u, v = generator.uniform(-0.4, 0.4, (2, count, 1))
    start = np.array(scene.screen.position_mm) + u * x + v * y
    return start, np.column_stack([generator.uniform(-376, 376, (count, 2)), np.zeros(count)]) - start


@pytest.mark.parametrize(
    ("name", "lens"),
    [*LENSES.items(), ("sphere-singlet", GHOST), ("sphere-singlet", GHOST[:3] + GHOST[1:])],
    ids=["singlet", "doublet", "ghost", "second ghost"],
)
def test_rays_go_where_the_oracle_says(name, lens):
    """From the screen by the mirror through a real lens to the detector's plane, point by point."""
    scene = load_scene(name)
    components = components_of(scene)
    start, directions = rays_to_the_stop(scene)
    points, ways = trace_sequence(components, events_of(components, "mirror", *lens, "detector"), start, directions)
    mirror = oracle.Step(np.zeros(3), np.array([0.0, 0.0, 1.0]), scene.mirror.radius_mm, mirror=True)
    forward, along = start, oracle.unit(directions)
    for k, step in enumerate([mirror, *oracle_steps(scene, lens)]):
        # of a ghost too, a surface is met next to its vertex
        forward, along, _ = oracle.pass_step(step, forward, along)
        np.testing.assert_allclose(points[k], forward, rtol=0, atol=1e-11)  # rounding of 4 m: 1e-12, a few times
        np.testing.assert_allclose(ways[k], along, rtol=0, atol=1e-12)
    _, _, z = oracle.axes_of(scene.camera)
    detector = oracle.Step(np.array(scene.camera.position_mm) + scene.camera.detector_distance_mm * z, z)
    np.testing.assert_allclose(points[-1], oracle.meet(detector, forward, along), rtol=0, atol=1e-10)  # as above
    np.testing.assert_allclose(ways[-1], ways[-2], rtol=0, atol=1e-15)  # to its frame and back


def test_an_off_axis_mirror_reflects_as_its_surface_does():
    scene = load_scene("off-axis")
    start, directions = rays_to_the_stop(scene)
    points, ways = trace_sequence(components_of(scene), [(0, 0)], start, directions)
    expected, along = Surface.of(scene.mirror).meet(start, directions)
    np.testing.assert_allclose(points[0], expected, rtol=0, atol=1e-11)  # rounding of the way
    np.testing.assert_allclose(ways[0], oracle.unit(along), rtol=0, atol=1e-13)


@pytest.mark.parametrize("focal", [16.0, -30.0])
@pytest.mark.parametrize("side", [1, -1])
def test_a_paraxial_lens_takes_a_point_to_its_image(focal, side):
    """All lines through (2, -3, -40) before the lens go on along lines through the image, from either side."""
    lens = Component("lens", "lens", "plane", LOCAL, focal_length_mm=focal)
    point = np.array([2.0, -3.0, -40.0 * side])
    at = np.column_stack([np.random.default_rng(2).uniform(-5, 5, (50, 2)), np.zeros(50)])
    (met,), (ways,) = trace_sequence([lens], [(0, 0)], np.tile(point, (50, 1)), at - point)
    image = 1 / (1 / focal - 1 / 40)
    np.testing.assert_allclose(met, at, rtol=0, atol=1e-13)  # rounding
    np.testing.assert_allclose(np.linalg.norm(ways, axis=-1), 1, rtol=1e-15)
    assert (np.sign(ways[:, 2]) == side).all()
    landed = met + (image * side / ways[:, 2])[:, None] * ways
    expected = [-2.0 * image / 40, 3.0 * image / 40, image * side]
    np.testing.assert_allclose(landed, np.tile(expected, (50, 1)), rtol=0, atol=1e-12)  # rounding


def sphere(kind="mirror", radius=10.0, **values):
    return Component("ball", kind, "quadric", LOCAL, Quadric.conic(radius), **values)


def test_a_ray_in_a_bowl_meets_it_again_and_again():
    """A circle's chords turn by pi less twice the angle of incidence. The second way begins next to the vertex."""
    incidence = math.asin(0.9)
    points, ways = trace_sequence([sphere()], [(0, 0)] * 3, [(-9.0, 0.0, 10.0)], [DOWN])
    turned = -incidence + (math.pi - 2 * incidence) * np.arange(3)  # about (0, 0, 10), from the vertex
    expected = np.column_stack([10 * np.sin(turned), np.zeros(3), 10 - 10 * np.cos(turned)])
    np.testing.assert_allclose(points[:, 0], expected, rtol=0, atol=1e-13)  # rounding
    np.testing.assert_allclose(ways[1, 0], unit(points[2, 0] - points[1, 0]), rtol=0, atol=1e-13)


GLASS = {"index_front": 1.5, "index_back": 1.0}
STEEP = unit([1.0, 0.0, -1.0])


@pytest.mark.parametrize(
    ("component", "event", "start", "direction", "met"),
    [
        (sphere(), 0, (12.0, 0.0, 10.0), DOWN, False),  # beside it
        (sphere(), 0, (1.0, 0.0, -1.0), DOWN, False),  # it lies behind
        (sphere(), 0, (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), True),  # a mirror's back is black
        (sphere(), 0, (-30.0, 0.0, 15.0), (1.0, 0.0, 0.0), False),  # the half that is none of it
        (Component("glass", "refractor", "plane", LOCAL, **GLASS), 0, (0.0, 0.0, 1.0), STEEP, True),  # total reflection
        (Component("plate", "mirror", "plane", LOCAL), 0, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), False),  # along it
        (Component("plate", "absorber", "plane", LOCAL), 0, (0.0, 0.0, 1.0), DOWN, True),
        (sphere("scattering"), 2, (0.0, 0.0, 1.0), DOWN, True),
        (Component("lens", "lens", "plane", LOCAL), 2, (0.0, 0.0, 1.0), DOWN, True),
    ],
    ids=["beside", "behind", "back", "other half", "total reflection", "along", "absorber", "scatterer", "lens (s)"],
)
def test_where_no_light_goes_on_there_is_nan(component, event, start, direction, met):
    (points,), (ways,) = trace_sequence([component], [(0, event)], [start], [direction])
    assert np.isfinite(points).all() == met and np.isnan(points).any() != met
    assert np.isnan(ways).all()


def test_a_ray_that_ends_leaves_the_others_alone():
    """And what is lost stays lost. Total reflection reflects."""
    components = [
        sphere(),
        Component("detector", "detector", "plane", replace(LOCAL, position_mm=np.array([0.0, 0.0, 5.0]))),
    ]
    start = np.array([[0.0, 0.0, 9.0], [12.0, 0.0, 9.0], [0.0, 3.0, 9.0]])
    points, ways = trace_sequence(components, [(0, 0), (1, 0)], start, np.tile(DOWN, (3, 1)))
    assert np.isnan(points[:, 1]).all() and np.isnan(ways[:, 1]).all()
    assert np.isfinite(points[:, ::2]).all() and np.isfinite(ways[:, ::2]).all()
    glass = Component("glass", "refractor", "plane", LOCAL, **GLASS)
    _, (ways,) = trace_sequence([glass], [(0, 1)], [(0.0, 0.0, 1.0)], [STEEP])
    np.testing.assert_allclose(ways, [STEEP * [1, 1, -1]], atol=1e-15)


# --- focus and blur -----------------------------------------------------------------------------------------

ORDER = 1e-6  # relative: of close rays at 1e-3 of the stop's radius


def focus_of(scene, *names):
    components = components_of(scene)
    return path_focus(components, events_of(components, *names))


def with_elements(*elements, **camera):
    scene = load_scene("sphere")
    return replace(scene, element=elements, camera=replace(scene.camera, **camera))


def camera_of(scene):
    """Centre of the stop, unit vector of the light through it, distances of object and detector, focal length."""
    camera = scene.camera
    position, look = np.array(camera.position_mm), np.array(camera.look_at_mm)
    distance = camera.detector_distance_mm or camera.image_distance_mm
    return position, unit(position - look), math.dist(position, look), distance, camera.focal_length_mm


def image_at(focal, distance):
    return 1 / (1 / focal - 1 / distance)


def plate(at, axis, thickness, index):
    """Two faces; light along the axis meets `near` first."""
    faces = ((-thickness / 2, "near", 1.0, index), (thickness / 2, "far", index, 1.0))
    return [
        Element(name, "refractor", tuple(at + z * axis), tuple(at + (z - 1000) * axis), diameter_mm=50.0,
                index_front=front, index_back=back)
        for z, name, front, back in faces
    ]  # fmt: skip


THROUGH = ["near", "far"]
TWICE = ["near", "far (r)", "near (r)", "far"]


@pytest.mark.parametrize("name", ["sphere", "sphere-deviated", "off-axis", "sphere-window", "baffled"])
def test_a_focused_camera_is_sharp(name):
    focus_mm, blur_mm = focus_of(load_scene(name), "mirror", "lens", "detector")
    assert abs(focus_mm) < 1e-8 and 0 <= blur_mm < 1e-9  # rounding of 4 m over the close rays' 1e-3


@pytest.mark.parametrize("name", LENSES)
def test_the_presets_real_lenses_are_sharp(name):
    focus_mm, blur_mm = focus_of(load_scene(name), "mirror", *LENSES[name], "detector")
    assert abs(focus_mm) < 2e-6 and 0 <= blur_mm < 2e-7  # lengths are told to 1e-6 mm


@pytest.mark.parametrize("moved_mm", [0.3, -0.2])
def test_a_detector_out_of_focus(moved_mm):
    _, _, _, image, _ = camera_of(load_scene("sphere"))
    scene = with_elements(detector_distance_mm=image + moved_mm)
    focus_mm, blur_mm = focus_of(scene, "mirror", "lens", "detector")
    assert focus_mm == pytest.approx(-moved_mm, rel=ORDER)
    assert blur_mm == pytest.approx(abs(moved_mm) / image * scene.camera.aperture_diameter_mm, rel=ORDER)


@pytest.mark.parametrize(("names", "glass"), [(THROUGH, 1), (TWICE, 3)])
def test_a_plate_before_the_detector(names, glass):
    """Behind the lens every thickness t of glass shortens the light's way by t - t / n; a ghost goes 2 t more of it."""
    thickness, index = 2.0, 1.5
    position, axis, _, image, _ = camera_of(load_scene("sphere"))
    scene = with_elements(*plate(position + 10 * axis, axis, thickness, index))
    focus_mm, blur_mm = focus_of(scene, "mirror", "lens", *names, "detector")
    expected = thickness - glass * thickness / index
    assert focus_mm == pytest.approx(expected, rel=ORDER)
    assert blur_mm == pytest.approx(abs(expected) / image * scene.camera.aperture_diameter_mm, rel=ORDER)


@pytest.mark.parametrize(("names", "glass"), [(THROUGH, 1), (TWICE, 3)])
def test_a_plate_before_the_camera(names, glass):
    thickness, index = 300.0, 1.5
    position, axis, distance, image, focal = camera_of(load_scene("sphere"))
    scene = with_elements(*plate(position - 1000 * axis, axis, thickness, index))
    focus_mm, _ = focus_of(scene, "mirror", *names, "lens", "detector")
    expected = image_at(focal, distance - thickness + glass * thickness / index) - image
    assert abs(expected) > 1e-4
    assert focus_mm == pytest.approx(expected, rel=3e-6)  # 300 times the lens's rounding, and ORDER


def singlet_matrix(names):
    """Paraxial (height, slope) from the stop to the singlet's last face, by transfer, refraction and reflection."""
    position, axis, _, _, _ = camera_of(load_scene("sphere-singlet"))
    faces = {element.name: element for element in load_scene("sphere-singlet").element}
    place = {name: (np.array(face.position_mm) - position) @ axis for name, face in faces.items()}
    matrix, z, index, direction = np.eye(2), 0.0, 1.0, 1
    for name, _, mark in (name.partition(" ") for name in names):
        face = faces[name]
        centre = -1 / face.radius_mm  # curvature, above 0 where the centre lies along the light's first direction
        step = abs(place[name] - z)
        matrix, z = np.array([[1, step], [0, 1]]) @ matrix, place[name]
        if mark:  # slopes are against the way: a mirror's power is 2 c, convex to the light or not
            matrix = np.array([[1, 0], [2 * centre * direction, 1]]) @ matrix
            direction = -direction
        else:
            after = face.index_back if direction > 0 else face.index_front
            power = (after - index) * centre * direction
            matrix, index = np.array([[1, 0], [-power / after, index / after]]) @ matrix, after
    return matrix, z


@pytest.mark.parametrize("names", [GHOST, GHOST[:3] + GHOST[1:]], ids=["two", "four"])
def test_the_singlets_ghosts_by_the_paraxial_matrix(names):
    scene = load_scene("sphere-singlet")
    _, _, distance, detector, _ = camera_of(scene)
    focus_mm, blur_mm = focus_of(scene, "mirror", *names, "detector")
    matrix, z = singlet_matrix(names)
    height, slope = matrix @ [1.0, 1 / distance]
    meets = -height / slope
    assert focus_mm == pytest.approx(meets - (detector - z), rel=ORDER)
    assert focus_mm < -10  # far before it
    assert blur_mm == pytest.approx(abs(height + slope * (detector - z)), rel=ORDER)  # the stop's diameter is 1


FOLD = np.array([-600.0, 350.0, 3800.0])  # aside of the plane of all else: no axis lies in its meridians


def folded(radius):
    """A curved mirror that sends the light of the mirror's vertex into the camera; and its angle of incidence."""
    position = np.array(load_scene("sphere").camera.position_mm)
    to_mirror, to_camera = unit(-FOLD), unit(position - FOLD)
    front = FOLD + 100 * unit(to_mirror + to_camera)
    element = Element("fold", "mirror", tuple(FOLD), tuple(front), radius_mm=radius, diameter_mm=100.0)
    angle = math.acos(to_mirror @ to_camera) / 2
    return with_elements(element, look_at_mm=tuple(FOLD), focus_distance_mm=4166.747), angle, math.dist(position, FOLD)


@pytest.mark.parametrize("radius", [2000.0, -900.0])
def test_two_meridians_that_meet_apart(radius):
    """Coddington's equations; the mean in vergence behind the lens, and the longer axis of the patch."""
    scene, angle, gap = folded(radius)
    _, _, _, image, focal = camera_of(scene)
    powers = 2 / (radius * math.cos(angle)), 2 * math.cos(angle) / radius
    behind_fold = [1 / (power - 1 / np.linalg.norm(FOLD)) for power in powers]
    vergences = [1 / focal + 1 / (meets - gap) for meets in behind_fold]
    focus_mm, blur_mm = focus_of(scene, "mirror", "fold", "lens", "detector")
    assert focus_mm == pytest.approx(2 / sum(vergences) - image, rel=ORDER * 10)  # a small difference
    assert blur_mm == pytest.approx(max(abs(1 - image * vergence) for vergence in vergences), rel=ORDER * 10)
    assert abs(vergences[0] - vergences[1]) > 1e-4


def test_a_camera_without_a_lens():
    scene = with_elements(lens="elements", detector_distance_mm=50.0)
    _, _, distance, _, _ = camera_of(scene)
    focus_mm, blur_mm = focus_of(scene, "mirror", "detector")
    assert focus_mm == pytest.approx(-(distance + 50), rel=ORDER)
    assert blur_mm == pytest.approx((distance + 50) / distance, rel=ORDER)


def test_the_object_is_the_last_scatterer_the_mirror_or_what_comes_last_before_the_camera():
    position, axis, _, image, focal = camera_of(load_scene("sphere"))
    scene = with_elements(*plate(position - 500 * axis, axis, 1e-3, 1.5), detector_distance_mm=image + 0.1)
    direct = focus_of(scene, "mirror", *THROUGH, "lens", "detector")
    assert focus_of(scene, "mirror (s)", *THROUGH, "lens", "detector") == direct
    assert focus_of(scene, "near", "mirror", *THROUGH, "lens", "detector") == direct
    assert focus_of(scene, "mirror", "near (r)", "mirror", *THROUGH, "lens", "detector") == direct
    assert focus_of(scene, "mirror (s)", "near (r)", "mirror", *THROUGH, "lens", "detector") != direct
    on_plate = image_at(focal, 500) - image - 0.1
    assert focus_of(scene, "mirror", "near", "far (s)", "lens", "detector")[0] == pytest.approx(on_plate, rel=1e-5)
    assert focus_of(scene, "far", "lens", "detector")[0] == pytest.approx(on_plate, rel=1e-5)  # half the plate


@pytest.mark.parametrize("names", [[], ["detector"], ["lens", "detector"], ["mirror", "lens (s)", "detector"]])
def test_light_of_no_such_object_has_no_focus(names):
    assert np.isnan(focus_of(load_scene("sphere"), *names)).all()


def test_a_line_of_sight_that_meets_nothing_has_no_focus():
    scene, _, _ = folded(2000.0)
    aside = {"position_mm": (300.0, 200.0, 3000.0), "facing_mm": (300.0, 200.0, 1.0)}
    scene = replace(scene, element=(replace(scene.element[0], radius_mm=60.0, **aside),))
    assert np.isnan(focus_of(scene, "mirror", "fold", "lens", "detector")).all()
