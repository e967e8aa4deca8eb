"""The components of a non-sequential trace: the mirror, the camera and the scene's further elements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.frame import Frame
from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.optics.camera_model import CameraModel, camera_frame
from irtscots_cl.optics.screen_model import screen_frame
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError

STOP_RIM = 4.0  # radius of the camera's front plate, in detector diagonals: no light passes outside it
FAR_MM = 1000.0  # distance from the origins of groups beyond which an element has its own origin
PLANE = Quadric(0.0, 0.0, 0.0)
REFRACTORS = ("refractor", "coated")  # kinds between two media
SLIGHT_MM, SLIGHT_SLOPE = 0.01, 1e-5  # of a design's departure: no more than a mirror's usual deviations
COPLANAR = 1e-9  # relative distance below which an element lies in the screen's plane


@dataclass(frozen=True)
class Component:
    """One element. shape: "plane", "quadric" or "deviated"; kind: of a kernels/elements/interact_*.cl.

    frame: z towards its front (the detector's and the camera's lens: along the light). outer_mm, inner_mm: radii of the
    aperture; half_mm: half of its width and height. reflectance: of a refractor; NaN means Fresnel's. scatter: a
    ScatterModel (scene/scatter/lobe.py), or None.
    """

    name: str
    kind: str
    shape: str
    frame: Frame
    quadric: Quadric = PLANE
    outer_mm: float = np.inf
    inner_mm: float = 0.0
    half_mm: tuple[float, float] = (np.inf, np.inf)
    reflectance: float = np.nan
    index_front: float = 1.0
    index_back: float = 1.0
    focal_length_mm: float = np.inf
    transmittance: float = 1.0
    coating_index: float = 1.0
    scatter: object = None

    @property
    def rim_mm(self) -> float:
        """Radius of the smallest disk about the vertex that contains the aperture."""
        return float(min(self.outer_mm, np.hypot(*self.half_mm)))

    @property
    def refracts(self) -> bool:
        return self.kind in REFRACTORS


def components_of(scene: Scene) -> tuple[Component, ...]:
    """The mirror, the camera, and the scene's elements, in that order."""
    return (_mirror(scene), *_camera(scene), *(_element(e) for e in scene.element))


def _mirror(scene: Scene) -> Component:
    surface = Surface.of(scene.mirror)
    if surface.design:
        _check_slight(scene, surface)
    plain = "plane" if scene.mirror.is_flat else "quadric"
    shape = "deviated" if surface.departures else plain
    frame = Frame(np.zeros(3), np.eye(3))
    return Component("mirror", "mirror", shape, frame, surface.quadric, surface.aperture_radius_mm,
                surface.obscuration_radius_mm, reflectance=scene.mirror.reflectance,
                scatter=scene.mirror.scatter)  # fmt: skip


def _check_slight(scene: Scene, surface: Surface) -> None:
    """Raise SceneError for a design that departs so far from its conic that paths may not look at the conic alone.

    Which element a ray meets, and where paths lead, is found with the conic.
    """
    points = [departure.spread(surface.aperture_radius_mm) for departure in surface.design]
    height, *slopes = surface.departure_at(*(np.concatenate(axis) for axis in zip(*points, strict=True)))
    if np.abs(height).max() > SLIGHT_MM or np.abs(slopes).max() > SLIGHT_SLOPE:
        limits = f"{SLIGHT_MM:g} mm and slopes of {SLIGHT_SLOPE:g}"
        must = f"depart from the conic by at most {limits} in non-sequential traces, which look for elements with it"
        raise SceneError(f"scene {scene.name}: mirror: must {must}")


def _camera(scene: Scene) -> list[Component]:
    camera, model = scene.camera, CameraModel.of(scene.camera)
    frame, (columns, rows) = camera_frame(camera), camera.detector.pixels
    half = tuple(n * pitch / 2 for n, pitch in zip((columns, rows), model.pitch_mm, strict=True))
    distance = camera.detector_distance_mm or camera.image_distance_mm
    behind = Frame(frame.position_mm + distance * frame.axes[2], frame.axes)
    from_axis = [(at - (n - 1) / 2) * p for at, n, p in
                 zip(model.centre[::-1], (columns, rows), model.pitch_mm, strict=True)]  # fmt: skip
    if any(from_axis):  # the image is upside down: the detector's middle lies where the principal point is from it
        behind = Frame(behind.position_mm + np.array(from_axis) @ frame.axes[:2], frame.axes)
    radius = camera.aperture_diameter_mm / 2
    rim = max(STOP_RIM * 2 * float(np.hypot(*half)), 4 * radius)
    stop = Component("stop", "absorber", "plane", frame, outer_mm=rim, inner_mm=radius)
    lens = Component("lens", "lens", "plane", frame, outer_mm=radius, focal_length_mm=camera.focal_length_mm,
                transmittance=camera.transmittance)  # fmt: skip
    detector = Component("detector", "detector", "plane", behind, half_mm=half)
    return [stop, *([lens] if camera.lens == "paraxial" else []), detector]


def _element(element: Element) -> Component:
    # a frame's z points away from the point it looks at
    away = 2 * np.array(element.position_mm) - np.array(element.facing_mm)
    curved = element.radius_mm is not None
    quadric = PLANE
    if curved:
        quadric = Quadric.conic(element.radius_mm, element.conic, element.off_axis_mm)
    width, height = element.size_mm or (np.inf, np.inf)
    reflectance = element.reflectance
    if reflectance is None:
        reflectance = 1.0 if element.kind == "mirror" else np.nan
    frame = Frame.looking(element.position_mm, away)
    return Component(
        element.name, _kind(element), "quadric" if curved else "plane", frame, quadric,
        (element.diameter_mm or np.inf) / 2, element.obscuration_mm / 2, (width / 2, height / 2), reflectance,
        element.index_front or 1.0, element.index_back or 1.0, element.focal_length_mm or np.inf, element.transmittance,
        element.coating_index or 1.0, element.scatter,
    )  # fmt: skip


def _kind(element: Element) -> str:
    """Kind of the component, the name of a kernels/elements/interact_*.cl file."""
    if element.kind == "refractor":
        return "refractor" if element.coating_index is None else "coated"
    if element.kind in ("absorber", "detector"):
        return "absorber" if element.scatter is None else "diffuser"
    return element.kind


@dataclass(frozen=True)
class Target:
    """A disk about a frame's origin, in its plane z = 0."""

    name: str
    frame: Frame
    radius_mm: float


def targets_of(scene: Scene) -> tuple[Target, ...]:
    """Disks that scattered rays are aimed at, in addition to their lobe, because light there matters.

    They are the camera's aperture; the detector and the mirror, if not only the mirror scatters; important elements.
    """
    components = {component.name: component for component in components_of(scene)}
    camera = scene.camera
    aperture = Target("stop", camera_frame(camera), camera.aperture_diameter_mm / 2)
    names = [element.name for element in scene.element if element.important]
    if any(element.scatter is not None for element in scene.element):
        names = ["detector", "mirror", *names]
    return (aperture, *(Target(name, components[name].frame, components[name].rim_mm) for name in names))


def groups_of(scene: Scene, components: tuple[Component, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Origins [groups, 3] of the rays' positions, and the group of each component [components]; 1 is the screen's."""
    origins = [np.zeros(3), np.array(scene.screen.position_mm), np.array(scene.camera.position_mm)]
    numbers = []
    for component in components:
        distance = [np.linalg.norm(component.frame.position_mm - origin) for origin in origins]
        numbers.append(int(np.argmin(distance)))
        if min(distance) > FAR_MM:
            numbers[-1] = len(origins)
            origins.append(component.frame.position_mm)
    return np.array(origins), np.array(numbers)


def on_screen(scene: Scene, components: tuple[Component, ...]) -> int:
    """Number of the plane component in the screen's plane, on which rays start; -1 if there is none."""
    screen = screen_frame(scene.screen)
    size = np.linalg.norm(screen.position_mm)
    for number, component in enumerate(components):
        away = abs((component.frame.position_mm - screen.position_mm) @ screen.axes[2])
        turned = np.linalg.norm(np.cross(component.frame.axes[2], screen.axes[2]))
        if component.shape == "plane" and away <= COPLANAR * size and turned <= COPLANAR:
            return number
    return -1
