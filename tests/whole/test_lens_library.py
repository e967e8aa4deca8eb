"""The presets' real lenses beside a public lens library: focal length, image height, spherical aberration.

The library traces a centred system in the camera's frame. Differences of two rays on opposite sides of the axis are
compared: they do not tell of a lens that stands aside or tilted by the rounding of its file.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from oracle import sequence as oracle

from irtscots_cl.optics.elements.components import components_of
from irtscots_cl.optics.elements.sequential_rays import trace_sequence
from irtscots_cl.scene.presets import load_scene

pytest.importorskip("optiland", reason="no lens library: pip install 'irtscots-cl[lens]'")

from optiland.materials import IdealMaterial
from optiland.optic import Optic
from optiland.rays import RealRays

pytestmark = [
    pytest.mark.slow,  # the library compiles itself
    pytest.mark.filterwarnings("ignore:variable .* is not in scope"),  # its compiler talks of itself
]

NAMES = ("sphere-singlet", "sphere-doublet")
TRACERS = ("package", "oracle")
WAVELENGTH_UM = 0.5876  # of no effect: the materials have one index each
AGREED = 1e-6  # relative


def camera_axes(scene):
    """Centre of the stop, and x, y, z of the camera: z along the light."""
    return np.array(scene.camera.position_mm), np.stack(oracle.axes_of(scene.camera))


def library_lens(scene) -> Optic:
    """Stop, lens and detector of a scene, on one axis."""
    position, axes = camera_axes(scene)
    faces = scene.element
    places = [0.0, *((np.array(face.position_mm) - position) @ axes[2] for face in faces)]
    gaps = np.diff([*places, scene.camera.detector_distance_mm])
    optic = Optic()
    optic.surfaces.add(index=0, thickness=math.dist(position, scene.camera.look_at_mm))
    optic.surfaces.add(index=1, thickness=gaps[0], is_stop=True)
    for k, (face, gap) in enumerate(zip(faces, gaps[1:], strict=True), 2):
        # a radius below 0 here has its centre behind the front, where the light goes: above 0 there
        optic.surfaces.add(index=k, radius=-face.radius_mm, thickness=gap, material=IdealMaterial(n=face.index_back))
    optic.surfaces.add(index=len(faces) + 2)
    optic.set_aperture("EPD", scene.camera.aperture_diameter_mm)
    optic.fields.set_type("angle")
    optic.fields.add(y=0.0)
    optic.wavelengths.add(WAVELENGTH_UM, is_primary=True)
    return optic


def library_lands(scene, start, directions):
    """Height on the detector and slope there of rays in the camera's frame, by the library."""
    ones = np.ones(len(start))
    rays = RealRays(*start.T, *directions.T, ones, WAVELENGTH_UM * ones)
    rays = library_lens(scene).surfaces.trace(rays, skip=1)
    return rays.y, rays.M / rays.N


def lands(scene, tracer, start, directions):
    """The same by ours."""
    position, axes = camera_axes(scene)
    start, directions = position + start @ axes, directions @ axes
    behind = position + scene.camera.detector_distance_mm * axes[2]
    if tracer == "package":
        components = components_of(scene)
        numbers = {component.name: number for number, component in enumerate(components)}
        events = [(numbers[name], 0) for name in (*(face.name for face in scene.element), "detector")]
        points, ways = (found[-1] for found in trace_sequence(components, events, start, directions))
    else:
        points, ways = start, directions
        for step in oracle.lens_of(scene):
            points, ways, _ = oracle.pass_step(step, points, ways)
        points = oracle.meet(oracle.Step(behind, axes[2]), points, ways)
    return (points - behind) @ axes[1], (ways @ axes[1]) / (ways @ axes[2])


def half_differences(found):
    """Heights and slopes of rays, less those of their mirror images that follow them, halved."""
    return tuple((value[: len(value) // 2] - value[len(value) // 2 :]) / 2 for value in found)


def pair_of_fans(start, towards):
    """Rays from start to points of the stop [n, 3], and the same on the other side of the axis."""
    start = np.broadcast_to(start, towards.shape)
    over = np.array([1.0, -1.0, 1.0])
    both = np.concatenate([start, start * over]), np.concatenate([towards - start, (towards - start) * over])
    return both[0], oracle.unit(both[1])


def at_height(*heights):
    return np.array([[0.0, height, 0.0] for height in heights])


@pytest.mark.parametrize("tracer", TRACERS)
@pytest.mark.parametrize("name", NAMES)
def test_focal_length(name, tracer):
    """Of a ray 1e-3 mm beside the axis, against the library's paraxial one; and both the preset's 16 mm."""
    scene = load_scene(name)
    start = at_height(1e-3, -1e-3)
    _, (slope,) = half_differences(lands(scene, tracer, start, np.tile([0.0, 0.0, 1.0], (2, 1))))
    focal_length = float(library_lens(scene).paraxial.f2())
    assert -1e-3 / slope == pytest.approx(focal_length, rel=AGREED)
    assert focal_length == pytest.approx(16.0, rel=AGREED)


@pytest.mark.parametrize("tracer", TRACERS)
@pytest.mark.parametrize("name", NAMES)
def test_image_height(name, tracer):
    """Of the mirror's rim, through the stop's centre."""
    scene = load_scene(name)
    position, axes = camera_axes(scene)
    radius, rim = scene.mirror.radius_mm, scene.mirror.diameter_mm / 2
    on_rim = axes @ (np.array([0.0, rim, radius - math.sqrt(radius**2 - rim**2)]) - position)
    rays = pair_of_fans(on_rim, at_height(0.0))
    (height,), _ = half_differences(lands(scene, tracer, *rays))
    (expected,), _ = half_differences(library_lands(scene, *rays))
    assert height == pytest.approx(expected, rel=AGREED)
    assert abs(height) > 2


@pytest.mark.parametrize("tracer", TRACERS)
@pytest.mark.parametrize("name", NAMES)
def test_spherical_aberration(name, tracer):
    """Transverse, of the mirror's vertex: at the aperture's rim and 0.7 of it, told from the close rays' landing."""
    scene = load_scene(name)
    position, axes = camera_axes(scene)
    rim = scene.camera.aperture_diameter_mm / 2
    zones = np.array([1.0, 0.7, 1e-2])
    rays = pair_of_fans(axes @ -position, at_height(*(zones * rim)))
    aberrations = []
    for height, _ in (half_differences(lands(scene, tracer, *rays)), half_differences(library_lands(scene, *rays))):
        close = height[2] / zones[2]  # landing per zone that first order gives, but for 1e-4 of the aberration
        aberrations.append(height[:2] - zones[:2] * close)
    np.testing.assert_allclose(aberrations[0], aberrations[1], rtol=AGREED, atol=0)
    assert aberrations[0][0] / aberrations[0][1] == pytest.approx(0.7**-3, rel=0.02)  # third order
    assert abs(aberrations[0][0]) > 1e-5
