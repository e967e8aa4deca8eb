"""A whole real test, independent of the package: camera, mirror, screen, and rays both ways between them.

The mirror is the oracle's own (`tracer.OracleMirror`): a conic of either sign of its radius, or a plane (infinite),
with Zernike terms. World = the mirror's frame. A fault moves, turns or changes one thing, by the names of unknowns.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from oracle import tracer
from oracle.panel import Panel, Sheet, sag_sheet
from oracle.picture import Eye

ORDERINGS = {"noll_um": "noll", "fringe_um": "fringe", "osa_um": "osa"}


def mirror_of(table: dict) -> tracer.OracleMirror:
    """The mirror of a scene file's table [mirror]; a radius of infinity is a plane."""
    terms = []
    for zernike in table.get("zernike", ()):
        for key, ordering in ORDERINGS.items():
            if key in zernike:
                values = {int(j): value for j, value in zernike[key].items()}
                terms.append(SimpleNamespace(radius_mm=zernike["radius_mm"], ordering=ordering, coefficients_um=values))
    plain = {"conic": 0.0, "off_axis_mm": 0.0, "obscuration_mm": 0.0, "reflectance": 1.0}
    return tracer.OracleMirror(SimpleNamespace(**(plain | table | {"zernike": terms})))


@dataclass(frozen=True)
class Path:
    """One ray each, [...]: start on the aperture, mirror point, away [..., 3] from it to the screen, (u, v) there."""

    start: np.ndarray
    mirror: np.ndarray
    away: np.ndarray
    u: np.ndarray
    v: np.ndarray


@dataclass(frozen=True)
class Rig:
    eye: Eye
    mirror: tracer.OracleMirror
    panel: Panel

    @classmethod
    def of(cls, scene: str | dict, sheet: Sheet | None = None, plate: str = "offset") -> Rig:
        """The test of a scene file's text or tables."""
        tables = tomllib.loads(scene) if isinstance(scene, str) else scene
        screen = Panel.of(tables["screen"], sheet, plate)
        return cls(Eye.of(tables["camera"]), mirror_of(tables["mirror"]), screen)

    def back(self, row, column, a=0.0, b=0.0) -> Path:
        """From places of the upright grid through aperture points (a, b), by way of the mirror, to the screen."""
        start, towards = self.eye.looks_along(row, column, a, b)
        point = self.mirror.meet(start, towards)
        away = self.mirror.reflect(point, towards)
        return Path(start, point, away, *self.panel.meets(point, away))

    def forth(self, u, v, directions):
        """From screen places (u, v) along world directions: mirror points [..., 3], then (row, column, a, b)."""
        start = self.panel.leaves(u, v, directions)
        point = self.mirror.meet(start, directions)
        return point, *self.eye.receives(point, self.mirror.reflect(point, directions))

    def image_of(self, u, v, a, b, row, column, rounds: int = 30):
        """(row, column) whose ray through (a, b) comes from (u, v), by Newton's method from a first guess."""
        row, column, u, v = (np.array(k, float) for k in np.broadcast_arrays(row, column, u, v))
        for _ in range(rounds):
            here = self.back(row, column, a, b)
            right, left = self.back(row, column + 0.1, a, b), self.back(row, column - 0.1, a, b)
            above, below = self.back(row + 0.1, column, a, b), self.back(row - 0.1, column, a, b)
            uc, vc = (right.u - left.u) / 0.2, (right.v - left.v) / 0.2
            ur, vr = (above.u - below.u) / 0.2, (above.v - below.v) / 0.2
            miss_u, miss_v, turn = here.u - u, here.v - v, uc * vr - ur * vc
            step_c, step_r = (vr * miss_u - ur * miss_v) / turn, (uc * miss_v - vc * miss_u) / turn
            row, column = row - step_r, column - step_c
            if max(np.max(np.abs(step_r)), np.max(np.abs(step_c))) < 1e-12:
                break
        return row, column

    def pixel_grid(self) -> tuple[np.ndarray, np.ndarray]:
        """(row, column) [rows, columns] of the pixels' centres."""
        columns, rows = self.eye.size
        return np.meshgrid(np.arange(rows) * 1.0, np.arange(columns) * 1.0, indexing="ij")


# --- faults ---------------------------------------------------------------------------------------------------------


def turned_about(vectors, axis, angle: float) -> np.ndarray:
    """Vectors [..., 3] turned about a unit axis by the right-hand rule (Rodrigues)."""
    along = (vectors @ axis)[..., None] * axis
    return along + math.cos(angle) * (vectors - along) + math.sin(angle) * np.cross(axis, vectors)


def _moved(device, quantity: str, value: float):
    """An Eye or Panel moved along a world axis, or turned about an axis of its own."""
    if quantity in ("x_mm", "y_mm", "z_mm"):
        return dataclasses.replace(device, place=device.place + value * np.eye(3)["xyz".index(quantity[0])])
    axis = {"tilt_x_rad": 0, "tilt_y_rad": 1, "roll_rad": 2, "clocking_rad": 2}[quantity]
    return dataclasses.replace(device, axes=turned_about(device.axes, device.axes[axis], value))


def _seen_from_mirror(device, quantity: str, value: float):
    """A device in the frame of a mirror that has moved or turned about its own vertex."""
    if quantity in ("x_mm", "y_mm", "z_mm"):
        return _moved(device, quantity, -value)
    axis = np.eye(3)[{"tilt_x_rad": 0, "tilt_y_rad": 1, "clocking_rad": 2}[quantity]]
    place, axes = turned_about(device.place, axis, -value), turned_about(device.axes, axis, -value)
    return dataclasses.replace(device, place=place, axes=axes)


def with_fault(rig: Rig, name: str, value: float) -> Rig:
    """The test with one unknown moved by value: `camera.x_mm`, `screen.clocking_rad`, `mirror.radius_relative`, ..."""
    part, quantity = name.split(".", 1)
    if part == "zernike":
        return dataclasses.replace(rig, mirror=_with_zernike(rig.mirror, int(quantity.removesuffix("_um")), value))
    if part == "camera":
        return dataclasses.replace(rig, eye=_changed_eye(rig.eye, quantity, value))
    if part == "screen":
        return dataclasses.replace(rig, panel=_changed_panel(rig.panel, quantity, value))
    if quantity in ("radius_relative", "conic"):
        table = SimpleNamespace(**vars(rig.mirror.mirror))
        table.radius_mm *= 1 + value * (quantity == "radius_relative")
        table.conic += value * (quantity == "conic")
        return dataclasses.replace(rig, mirror=tracer.OracleMirror(table))
    eye, panel = (_seen_from_mirror(device, quantity, value) for device in (rig.eye, rig.panel))
    return dataclasses.replace(rig, eye=eye, panel=panel)


def _with_zernike(mirror: tracer.OracleMirror, noll: int, value_um: float) -> tracer.OracleMirror:
    table = SimpleNamespace(**vars(mirror.mirror))
    radius = table.zernike[0].radius_mm if table.zernike else table.diameter_mm / 2
    extra = SimpleNamespace(radius_mm=radius, ordering="noll", coefficients_um={noll: value_um})
    table.zernike = [*table.zernike, extra]
    return tracer.OracleMirror(table)


def _changed_eye(eye: Eye, quantity: str, value: float) -> Eye:
    changes = {
        "principal_x_px": lambda: {"centre": (eye.centre[0] + value, eye.centre[1])},
        "principal_y_px": lambda: {"centre": (eye.centre[0], eye.centre[1] + value)},
        "focal_relative": lambda: {"scale": (eye.scale[0] * (1 + value), eye.scale[1] * (1 + value))},
        "aspect_relative": lambda: {"scale": (eye.scale[0], eye.scale[1] * (1 + value))},
    }
    if quantity in changes:
        return dataclasses.replace(eye, **changes[quantity]())
    if quantity in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"):
        terms = list(eye.terms)
        terms[("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6").index(quantity)] += value
        return dataclasses.replace(eye, terms=tuple(terms))
    return _moved(eye, quantity, value)


def _changed_panel(panel: Panel, quantity: str, value: float) -> Panel:
    """A changed pitch keeps the lines' grid coordinates and stretches the sheet: that is what goes unnoticed."""
    if quantity in ("pitch_relative", "pitch_y_relative"):
        wide = 1 + value if quantity == "pitch_relative" else 1.0
        return dataclasses.replace(panel, sheet=_stretched(panel.sheet, wide, 1 + value))
    if quantity.startswith("sag_"):
        i, j = (int(k) for k in quantity.split("_")[1:3])
        half = [n * p / 2 for n, p in zip(panel.size, panel.pitch, strict=True)]
        return dataclasses.replace(panel, sheet=_summed(panel.sheet, sag_sheet([(i, j, value)], *half, panel.offset)))
    return _moved(panel, quantity, value)


def _stretched(sheet: Sheet, wide: float, high: float) -> Sheet:
    def stretched(u, v):
        point, along_u, along_v = sheet(u, v)
        scale = np.array([wide, high, 1.0])
        return point * scale, along_u * scale, along_v * scale

    return stretched


def _summed(sheet: Sheet, sag: Sheet) -> Sheet:
    def summed(u, v):
        point, *tangents = sheet(u, v)
        extra, *extra_tangents = sag(u, v)
        point[..., 2] += extra[..., 2]
        for tangent, addition in zip(tangents, extra_tangents, strict=True):
            tangent[..., 2] += addition[..., 2]
        return point, *tangents

    return summed
