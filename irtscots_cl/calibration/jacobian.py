"""How the design's centroids (u, v) on the screen move with the unknowns of a test's geometry.

A centroid is reported as a place on the grid of the design: the number of the screen's pixel times the design's pitch,
wherever that pixel may be in truth. The derivatives are those of the pixels' chief rays, exact to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from irtscots_cl.calibration.parameters import (
    DISTORTION,
    disk_radius_mm,
    moved,
    parameter,
    sag_powers,
    zernike_noll,
)
from irtscots_cl.calibration.ray_changes import RayChanges, ray_changes
from irtscots_cl.calibration.seen_pixels import sees
from irtscots_cl.maths import lens_distortion
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.maths.zernike.polynomials import zernike, zernike_gradient
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.screen_surface import MeasuredPoints
from irtscots_cl.optics.setup import Setup
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.camera_intrinsics import Intrinsics
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption

AT_ONCE = 2**15  # pixels at a time: 60 MB
DIFFERENCE = 1e-3  # of a parameter's scale, where derivatives are differences
FORM_STEP = 1e-3  # of the mirror's radius and conic: five points of differences leave 1e-12 of the derivative
Pixels = tuple[ArrayLike, ArrayLike]


def centroid_jacobian(setup: Setup | Scene, names: Sequence[str], pixels: Pixels | None = None) -> FloatArray:
    """Derivatives d(u, v)/d(unknown) [2, n, p] in mm per unit, for n pixels and the p unknowns ``names``.

    pixels: (row, column), each [n], of the upright grid, also between pixels' centres; by default every pixel's centre,
    row by row. NaN for chief rays that miss the mirror's surface or the screen's. Raises ValueError for unknown names.
    """
    chief = Setup.of(setup).chief_rays
    return jacobian_of(chief, names, *_pixels(chief, pixels))


def jacobian_of(chief: ChiefRays, names: Sequence[str], row: FloatArray, column: FloatArray) -> FloatArray:
    """As centroid_jacobian, of chief rays that may have a surface of their own; row, column [n]."""
    result = np.empty((len(names), 2, len(row)))
    columns = [_column(name, chief.scene) for name in names]
    for first in range(0, len(row), AT_ONCE):
        interruption.check()
        part = slice(first, first + AT_ONCE)
        changes = ray_changes(chief, row[part], column[part])
        for k, of in enumerate(columns):
            result[k, :, part] = of(changes)
    return np.moveaxis(result, 0, -1)


def design_centroids(scene: Scene | Setup, design: Scene | Setup, pixels: Pixels | None = None) -> FloatArray:
    """Places (u, v) [2, n] in mm on the design's grid that the pixels of a scene see, by their chief rays.

    pixels: as for centroid_jacobian. The scene's screen has as many pixels as the design's, which may have moved.
    """
    setup = Setup.of(scene)
    _, u, v = setup.chief_rays.reverse(*_pixels(setup.chief_rays, pixels))
    return _on_grid(np.stack([u, v]), setup.scene, Setup.of(design).scene)


def centroids_and_view(
    scene: Scene | Setup, design: Scene | Setup, pixels: Pixels | None = None
) -> tuple[FloatArray, BoolArray]:
    """As design_centroids; and of which pixels [n] the chief rays go by way of the scene's mirror to its screen."""
    setup = Setup.of(scene)
    points, u, v = setup.chief_rays.reverse(*_pixels(setup.chief_rays, pixels))
    return _on_grid(np.stack([u, v]), setup.scene, Setup.of(design).scene), sees(setup, points, u, v)


def _on_grid(places_mm: FloatArray, scene: Scene, design: Scene) -> FloatArray:
    """Places (u, v) [2, ...] of a scene's grid on the design's: of the same pixel numbers."""
    grid, other = scene.screen, design.screen
    axes = zip(places_mm, grid.centre_offset_mm, grid.pitch_xy_mm, other.centre_offset_mm, other.pitch_xy_mm,
               strict=True)  # fmt: skip
    return np.stack([(place - offset) * (there / pitch) + back for place, offset, pitch, back, there in axes])


def _pixels(chief: ChiefRays, pixels: Pixels | None) -> tuple[FloatArray, FloatArray]:
    rows, columns = chief.shape
    row, column = np.divmod(np.arange(rows * columns), columns) if pixels is None else pixels
    row, column = np.broadcast_arrays(np.asarray(row, float), np.asarray(column, float))
    return row.ravel(), column.ravel()


Column = Callable[[RayChanges], FloatArray]  # (du, dv) [2, n] per unit of an unknown


def _column(name: str, scene: Scene) -> Column:
    """The derivatives by one unknown."""
    parameter(name, scene)
    part, _, what = name.partition(".")
    axis = "xyz".find(what.removeprefix("tilt_")[0])
    is_shift, is_turn = what[1:] == "_mm", what.endswith("_rad")
    axis = 2 if what in ("roll_rad", "clocking_rad") else axis
    if is_shift or is_turn:
        one = np.eye(3)[axis]
        return partial({"camera": _camera, "screen": _screen, "mirror": _mirror}[part], one, is_turn)
    if (noll := zernike_noll(name)) is not None:
        return partial(_zernike, noll, disk_radius_mm(scene.mirror))
    if part == "mirror":
        return partial(_form, scene, what)
    if part == "camera":
        return partial(_intrinsics, what)
    if scene.screen.cover_glass is not None and (scene.screen.shape is not None or sag_powers(name) is not None):
        return partial(_differences, name)  # the glass bends with the pixels
    if (powers := sag_powers(name)) is not None:
        return partial(_sag, powers)
    return partial(_pitch, what)


def _camera(one: FloatArray, is_turn: bool, changes: RayChanges) -> FloatArray:
    """Of a camera moved along the world's axis ``one``, or turned about its own."""
    if not is_turn:
        return _along(changes.by_place, one)
    return _turned_camera(changes, one @ changes.chief.camera_frame.axes)


def _turned_camera(changes: RayChanges, axis: FloatArray) -> FloatArray:
    turn = np.cross(axis, changes.along)
    return _sum(changes.by_place, changes.reach[:, None] * turn) + _sum(changes.by_direction, turn)


def _screen(one: FloatArray, is_turn: bool, changes: RayChanges) -> FloatArray:
    if not is_turn:
        return _along(changes.by_screen, one)
    frame = changes.chief.screen_frame
    return _turned_screen(changes, one @ frame.axes, frame.position_mm)


def _turned_screen(changes: RayChanges, axis: FloatArray, about_mm: FloatArray) -> FloatArray:
    found = _sum(changes.by_screen, np.cross(axis, changes.screen_points - about_mm))
    return found if changes.by_screen_turn is None else found + changes.by_screen_turn @ axis


def _mirror(one: FloatArray, is_turn: bool, changes: RayChanges) -> FloatArray:
    """Of a moved mirror: camera and screen make the inverse move."""
    if not is_turn:
        return -_along(changes.by_place, one) - _along(changes.by_screen, one)
    shift = np.cross(one, changes.start)
    return -_along(changes.by_place, shift) - _turned_camera(changes, one) - _turned_screen(changes, one, np.zeros(3))


def _zernike(noll: int, radius_mm: float, changes: RayChanges) -> FloatArray:
    x, y = changes.points[:, 0] / radius_mm, changes.points[:, 1] / radius_mm
    slopes = np.stack(zernike_gradient(noll, x, y), -1) / radius_mm
    return 1e-3 * (changes.by_height * zernike(noll, x, y) + _sum(changes.by_slope, slopes))


def _form(scene: Scene, key: str, changes: RayChanges) -> FloatArray:
    """Of the mirror's vertex radius or conic constant, by five-point differences of its design."""
    mirror, (x, y) = scene.mirror, changes.points[:, :2].T
    found = np.zeros((3, len(x)))
    for step, weight in ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)):
        radius = mirror.radius_mm * (1 + step * FORM_STEP * (key == "radius_relative"))
        conic = mirror.conic + step * FORM_STEP * (key == "conic")
        found += weight / FORM_STEP * _design_at(mirror, radius, conic, x, y)
    moved_by: FloatArray = changes.by_height * found[0] + _sum(changes.by_slope, found[1:].T)
    return moved_by


def _design_at(mirror: Mirror, radius_mm: float, conic: float, x: FloatArray, y: FloatArray) -> FloatArray:
    """Height of the design with another conic, and its slopes, [3, n]."""
    if mirror.asphere is not None:  # a segment's frame is on the surface, terms included
        design = Surface.of(replace(mirror.nominal(), radius_mm=radius_mm, conic=conic))
        return np.stack([design.sag(x, y), *design.gradient(x, y)])
    quadric = Quadric.conic(radius_mm, conic, mirror.off_axis_mm)
    height = quadric.meet(x, y, 0.0, 0.0)
    return np.stack([height, *quadric.gradient(x, y, height)])


def _intrinsics(key: str, changes: RayChanges) -> FloatArray:
    """Of the camera's principal point, focal lengths or distortion."""
    chief = changes.chief
    camera, model = chief.scene.camera, chief.camera_model
    pitch = np.array(model.pitch_mm)[:, None] / model.image_distance_mm
    goal = np.stack([changes.column - model.centre[1], changes.row - model.centre[0]]) * pitch
    if key in DISTORTION:
        goal_change = -_by_coefficient(key, _undistorted(changes), model.distortion)
    elif key.startswith("principal"):
        k = "xy".index(key[10])  # the picture's y points down
        binning = (camera.intrinsics or Intrinsics()).binning
        goal_change = np.zeros_like(goal)
        goal_change[k] = (-1, 1)[k] * pitch[k] / binning[k]
    else:
        goal_change = -goal * np.array([[key == "focal_relative"], [1.0]])
    if model.distortion:
        x, y = _undistorted(changes)
        xx, xy, yy = lens_distortion.distortion_matrix(x, y, model.distortion)
        determinant = xx * yy - xy * xy
        a, b = goal_change
        goal_change = np.stack([(yy * a - xy * b) / determinant, (xx * b - xy * a) / determinant])
    turn = goal_change.T @ chief.camera_frame.axes[:2]
    return _sum(changes.by_place, changes.reach[:, None] * turn) + _sum(changes.by_direction, turn)


def _undistorted(changes: RayChanges) -> FloatArray:
    """Normalised image points [2, n] of a perfect lens, from the rays' directions."""
    model = changes.chief.camera_model
    along = changes.along @ changes.chief.camera_frame.axes[:2].T
    at: FloatArray = along.T + np.array(model.shift)[:, None]
    return at


def _by_coefficient(key: str, at: FloatArray, distortion: tuple[float, ...]) -> FloatArray:
    """Change [2, n] of the distorted points of ``at`` [2, n], y upwards, per unit of a coefficient of the picture."""
    x, y = at
    r2 = x * x + y * y
    if key == "p1":  # of the picture, whose y points down
        return -np.stack([2 * x * y, r2 + 2 * y * y])
    if key == "p2":
        return np.stack([r2 + 2 * x * x, 2 * x * y])
    _, _, _, _, _, k4, k5, k6 = lens_distortion.full(distortion)
    radial = r2 ** {"k1": 1, "k2": 2, "k3": 3}[key] / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return np.stack([x * radial, y * radial])


def _sag(powers: tuple[int, int], changes: RayChanges) -> FloatArray:
    screen = changes.chief.scene.screen
    rise = np.ones_like(changes.u)
    for place, middle, count, pitch, power in zip((changes.u, changes.v), screen.centre_offset_mm, screen.pixels,
                                                  screen.pitch_xy_mm, powers, strict=True):  # fmt: skip
        rise = rise * ((place - middle) / (count * pitch / 2)) ** power
    return _sum(changes.by_screen, rise[:, None] * changes.chief.screen_frame.axes[2])


def _pitch(key: str, changes: RayChanges) -> FloatArray:
    """Of the screen's pitch: a pixel moves away from the grid's middle, unless its place was measured."""
    screen, model = changes.chief.scene.screen, changes.chief.screen_model
    if isinstance(model.surface, MeasuredPoints):
        return np.zeros((2, len(changes.u)))
    away = np.stack([changes.u, changes.v]) - np.array(screen.centre_offset_mm)[:, None]
    away[0] *= key == "pitch_relative"
    if model.surface is None:  # also behind glass, where the grid alone stretches
        stretched: FloatArray = -away
        return stretched
    return _sum(changes.by_screen, away.T @ model.frame.axes[:2])


def _differences(name: str, changes: RayChanges) -> FloatArray:
    design = changes.chief.scene
    step = DIFFERENCE * parameter(name, design).scale
    after, before = (
        design_centroids(moved(design, {name: value}), design, (changes.row, changes.column)) for value in (step, -step)
    )
    return (after - before) / (2 * step)


def _sum(rows: FloatArray, vectors: FloatArray) -> FloatArray:
    """(du, dv) [2, n] of the dots of rows [2, n, k] and vectors [n, k]."""
    found: FloatArray = np.einsum("ank,nk->an", rows, vectors)
    return found


def _along(rows: FloatArray, vector: FloatArray) -> FloatArray:
    """(du, dv) [2, n] of the dots of rows [2, n, 3] and one vector [3]."""
    found: FloatArray = rows @ vector
    return found
