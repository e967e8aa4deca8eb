"""The unknowns of a test's geometry by name: what they are, their units, and scenes in which they have other values.

Values are changes from the scene's. Signs: shifts are in the world (the mirror's frame), turns are right-handed about
the device's own x, y, z; several turns of one device make one rotation vector. Pixels and distortion are those of the
camera's picture as OpenCV counts it (y down). A mirror that moves is, in its own frame, the inverse move of camera and
screen, made after their own.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from irtscots_cl.calibration.poses import seen_from_moved_mirror, shifted, turned_in_place
from irtscots_cl.optics.camera_model import CameraModel
from irtscots_cl.scene.camera_intrinsics import Intrinsics, picture_size
from irtscots_cl.scene.instrument import Camera, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.screen_shape import MAX_ORDER, ScreenShape
from irtscots_cl.scene.validation import nearest

LENGTH, ANGLE, PIXEL, RELATIVE, MICROMETRE = "mm", "rad", "px", "relative", "um"
DISTORTION = ("k1", "k2", "p1", "p2", "k3")
_SCALES = {LENGTH: 0.5, ANGLE: np.radians(0.1), PIXEL: 0.5, RELATIVE: 1e-3, MICROMETRE: 1.0}
_EDGE_STRETCH = 1e-3  # of the image's half diagonal: what a distortion coefficient of one scale does there
_SAG = re.compile(r"screen\.sag_([0-9]{1,2})_([0-9]{1,2})_mm")
_ZERNIKE = re.compile(r"zernike\.([1-9][0-9]{0,2})_um")


@dataclass(frozen=True)
class Parameter:
    """An unknown. unit: "mm", "rad", "px", "um" or "relative"; "" for a number without one. text: what it changes.

    scale: a change of the usual size, in its unit: what a careful set-up without calibration leaves, no bound.
    """

    name: str
    unit: str
    scale: float
    text: str


def _fixed() -> dict[str, tuple[str, str]]:
    """Unit and text of the names without numbers in them."""
    found = {}
    for part in ("camera", "screen", "mirror"):
        turn = "roll" if part == "camera" else "clocking"
        for axis in "xyz":
            found[f"{part}.{axis}_mm"] = (LENGTH, f"{part}'s place along the world's {axis}, its orientation kept")
        for axis in "xy":
            found[f"{part}.tilt_{axis}_rad"] = (ANGLE, f"turn of the {part} about its own {axis}")
        found[f"{part}.{turn}_rad"] = (ANGLE, f"turn of the {part} about its own z")
    found["camera.principal_x_px"] = (PIXEL, "principal point in the picture, to the right")
    found["camera.principal_y_px"] = (PIXEL, "principal point in the picture, down")
    found["camera.focal_relative"] = (RELATIVE, "both focal lengths in pixels")
    found["camera.aspect_relative"] = (RELATIVE, "the focal length along y alone")
    for key in DISTORTION:
        found[f"camera.{key}"] = ("", f"distortion coefficient {key}")
    found["screen.pitch_relative"] = (RELATIVE, "both pitches of the screen")
    found["screen.pitch_y_relative"] = (RELATIVE, "the screen's pitch along y alone")
    found["mirror.radius_relative"] = (RELATIVE, "the mirror's vertex radius")
    found["mirror.conic"] = ("", "the mirror's conic constant")
    return found


_FIXED = _fixed()
_OF_CURVED = ("mirror.radius_relative", "mirror.conic")
_SAGS = ("screen.sag_2_0_mm", "screen.sag_1_1_mm", "screen.sag_0_2_mm")


def parameter(name: str, scene: Scene) -> Parameter:
    """The unknown of a name, for a scene. Raises ValueError for an unknown name, or what a flat mirror has not."""
    if name in _OF_CURVED and scene.mirror.is_flat:
        raise ValueError(f"unknown {name!r}: a flat mirror has none")
    if name in _FIXED:
        unit, text = _FIXED[name]
        if name.removeprefix("camera.") in DISTORTION:
            return Parameter(name, unit, _distortion_scale(name.removeprefix("camera."), scene.camera), text)
        return Parameter(name, unit, 1e-3 if name == "mirror.conic" else float(_SCALES[unit]), text)
    if sag := _SAG.fullmatch(name):
        i, j = (int(group) for group in sag.groups())
        if i + j > MAX_ORDER:
            raise ValueError(f"unknown {name!r}: the powers of a screen's sag must have a sum of at most {MAX_ORDER}")
        return Parameter(name, LENGTH, 0.1, f"height of the screen's pixels as (u/U)^{i} (v/V)^{j}")
    if zernike := _ZERNIKE.fullmatch(name):
        if int(zernike[1]) > 861:
            raise ValueError(f"unknown {name!r}: a Noll index must be from 1 to 861")
        return Parameter(
            name, MICROMETRE, float(_SCALES[MICROMETRE]), f"Zernike term {zernike[1]} (Noll) of the mirror"
        )
    raise ValueError(f"unknown {name!r}: {nearest(name, [*_FIXED, *_SAGS, 'zernike.4_um'])}")


def known_parameters(scene: Scene) -> dict[str, Parameter]:
    """All unknowns of a scene's geometry by name, without the Zernike terms; of the screen's sag the second order.

    A flat mirror has neither radius nor conic constant.
    """
    without = _OF_CURVED if scene.mirror.is_flat else ()
    return {name: parameter(name, scene) for name in (*_FIXED, *_SAGS) if name not in without}


def zernike_names(nolls: Iterable[int]) -> tuple[str, ...]:
    """The names of Zernike terms (Noll) of the mirror."""
    return tuple(f"zernike.{noll}_um" for noll in nolls)


def sag_powers(name: str) -> tuple[int, int] | None:
    """Powers (i, j) of a name such as screen.sag_2_0_mm; None for others."""
    found = _SAG.fullmatch(name)
    return (int(found[1]), int(found[2])) if found else None


def zernike_noll(name: str) -> int | None:
    """Noll index of a name such as zernike.4_um; None for others."""
    found = _ZERNIKE.fullmatch(name)
    return int(found[1]) if found else None


def disk_radius_mm(mirror: Mirror) -> float:
    """Radius of the disk of a mirror's Zernike terms: that of the scene's own terms, or the mirror's."""
    return mirror.zernike[0].radius_mm if mirror.zernike else mirror.diameter_mm / 2


def moved(scene: Scene, changes: Mapping[str, float]) -> Scene:
    """The scene with other values of the unknowns. changes: {name: change from the scene's value, in its unit}.

    Elements of the scene stay where they are. Raises ValueError for unknown names, SceneError for a scene that cannot
    be.
    """
    for name in changes:
        parameter(name, scene)
    values = {name: float(value) for name, value in changes.items() if value != 0}
    camera = _with_intrinsics(_moved_device(scene.camera, "camera", "roll", values), values)
    screen = _with_grid(_moved_device(scene.screen, "screen", "clocking", values), values)
    shift, turn = _shift(values, "mirror"), _turn(values, "mirror", "clocking")
    if any(shift) or any(turn):
        camera, screen = seen_from_moved_mirror(camera, shift, turn), seen_from_moved_mirror(screen, shift, turn)
    return replace(scene, camera=camera, screen=screen, mirror=_changed_mirror(scene.mirror, values))


def _shift(values: Mapping[str, float], part: str) -> list[float]:
    return [values.get(f"{part}.{axis}_mm", 0.0) for axis in "xyz"]


def _turn(values: Mapping[str, float], part: str, about_z: str) -> list[float]:
    return [values.get(f"{part}.{key}_rad", 0.0) for key in ("tilt_x", "tilt_y", about_z)]


def _moved_device(device: Any, part: str, about_z: str, values: Mapping[str, float]) -> Any:
    shift, turn = _shift(values, part), _turn(values, part, about_z)
    device = turned_in_place(device, turn) if any(turn) else device
    return shifted(device, shift) if any(shift) else device


def _with_intrinsics(camera: Camera, values: Mapping[str, float]) -> Camera:
    """The camera with changed principal point, focal lengths and distortion."""
    move = [values.get(f"camera.principal_{axis}_px", 0.0) for axis in "xy"]
    stretch = 1 + values.get("camera.focal_relative", 0.0)
    stretches = (stretch, stretch * (1 + values.get("camera.aspect_relative", 0.0)))
    added = [values.get(f"camera.{key}", 0.0) for key in DISTORTION]
    if not any(move) and stretches == (1.0, 1.0) and not any(added):
        return camera
    given = camera.intrinsics or Intrinsics()
    size = picture_size(given, camera.detector.pixels)
    middle = given.principal_point_px or ((size[0] - 1) / 2, (size[1] - 1) / 2)
    own = camera.image_distance_mm / camera.detector.pitch_mm
    focal = [f or own * b for f, b in zip((given.fx, given.fy), given.binning, strict=True)]
    old = given.distortion + (0.0,) * (len(DISTORTION) - len(given.distortion))
    new = (*(a + b for a, b in zip(old, added, strict=False)), *old[len(DISTORTION) :])
    changed = replace(
        given,
        image_size_px=size,
        principal_point_px=(middle[0] + move[0], middle[1] + move[1]),
        fx=focal[0] * stretches[0],
        fy=focal[1] * stretches[1],
        distortion=new if any(added) else given.distortion,
    )
    return replace(camera, intrinsics=changed)


def _with_grid(screen: Screen, values: Mapping[str, float]) -> Screen:
    """The screen with changed pitches and sag."""
    stretch = 1 + values.get("screen.pitch_relative", 0.0)
    stretches = (stretch, stretch * (1 + values.get("screen.pitch_y_relative", 0.0)))
    if stretches != (1.0, 1.0):
        x, y = screen.pitch_xy_mm
        screen = replace(screen, pitch_mm=(x * stretches[0], y * stretches[1]))
    terms = {powers: value for name, value in values.items() if (powers := sag_powers(name)) is not None}
    return replace(screen, shape=_bent(screen.shape, terms)) if terms else screen


def _bent(shape: ScreenShape | None, terms: dict[tuple[int, int], float]) -> ScreenShape:
    """A screen's shape with terms added to its sag; measured points move by as much."""
    if shape is None or shape.sag_mm:
        own = tuple(shape.sag_mm) if shape is not None else ()
        return ScreenShape(sag_mm=(*own, *((i, j, value) for (i, j), value in terms.items())))
    points = []
    for (x, y), point in zip(shape.fractions, shape.points_mm, strict=True):
        rise = sum(value * (2 * x - 1) ** i * (2 * y - 1) ** j for (i, j), value in terms.items())
        points.append((point[0], point[1], (point[2] if len(point) == 3 else 0.0) + rise))
    return replace(shape, points_mm=tuple(points))


def _changed_mirror(mirror: Mirror, values: Mapping[str, float]) -> Mirror:
    """The mirror with another vertex radius and conic constant, and Zernike terms added."""
    changes: dict[str, Any] = {}
    if radius := values.get("mirror.radius_relative"):
        changes["radius_mm"] = mirror.radius_mm * (1 + radius)
    if conic := values.get("mirror.conic"):
        changes["conic"] = mirror.conic + conic
    terms = {noll: value for name, value in values.items() if (noll := zernike_noll(name)) is not None}
    if terms:
        added = ZernikeTerms(radius_mm=disk_radius_mm(mirror), ordering="noll", coefficients_um=terms)
        changes["zernike"] = (*mirror.zernike, added)
    return replace(mirror, **changes) if changes else mirror


def _distortion_scale(key: str, camera: Camera) -> float:
    """The coefficient that moves the image's corners by about _EDGE_STRETCH of their distance from the middle."""
    model, (columns, rows) = CameraModel.of(camera), camera.detector.pixels
    half = np.hypot(columns * model.pitch_mm[0], rows * model.pitch_mm[1]) / 2 / model.image_distance_mm
    power = {"k1": 2, "k2": 4, "k3": 6, "p1": 1, "p2": 1}[key]
    return float(_EDGE_STRETCH / half**power / (3 if key[0] == "p" else 1))
