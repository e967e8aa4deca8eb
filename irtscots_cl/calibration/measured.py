"""What one measurement of a set-up gives to its calibration: screen places that pixels saw, and how well.

Several measurements share the unknowns. Where the mirror was turned, its Zernike terms act turned; where something was
moved on purpose, the measurement's scene has it there; where something may have moved by itself, the measurement has
unknowns of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.calibration.chain import further_changes
from irtscots_cl.calibration.jacobian import centroid_jacobian, design_centroids
from irtscots_cl.calibration.parameters import moved, zernike_names, zernike_noll
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.maths.zernike.indices import nm_to_noll, noll_to_nm
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene

AT_ONCE = 2**15  # pixels, where derivatives are made


@dataclass(frozen=True)
class Measurement:
    """n pixels with flat numbers `pixels` and their places (u, v) [2, n] in mm on the screen's grid.

    scene: geometry and mirror as they are believed. errors_mm: [2, n] standard errors, independent. offsets_mm: [2, n]
    what the light of a pixel lies from the chief ray of its centre. mirror_offsets_mm: [2, n] the same of its place
    (x, y) on the mirror. turn_rad: by which the mirror was turned about its axis, from x towards y. knows_mirror: the
    mirror is the scene's, with no terms of its own (a reference). own: names of unknowns that have a value of their own
    here, in addition to the shared one. name: for messages. every: the pixels are of every so many rows and columns.
    """

    scene: Scene
    pixels: IntArray = field(repr=False)
    places_mm: FloatArray = field(repr=False)
    errors_mm: FloatArray = field(repr=False)
    offsets_mm: FloatArray = field(repr=False)
    mirror_offsets_mm: FloatArray = field(repr=False)
    turn_rad: float = 0.0
    knows_mirror: bool = False
    own: tuple[str, ...] = ()
    name: str = "images"
    every: int = 1

    @property
    def shape(self) -> tuple[int, int]:
        """Detector (rows, columns)."""
        columns, rows = self.scene.camera.detector.pixels
        return rows, columns

    def on_grid(self, values: FloatArray) -> FloatArray:
        """Values [..., n] of the pixels as maps [..., rows, columns], NaN elsewhere."""
        rows, columns = self.shape
        maps = np.full((*values.shape[:-1], rows * columns), np.nan)
        maps[..., self.pixels] = values
        return maps.reshape(*values.shape[:-1], rows, columns)

    def place_of(self, chosen: slice | IntArray = slice(None)) -> tuple[IntArray, IntArray]:
        """Row and column of the pixels."""
        row, column = np.divmod(self.pixels[chosen], self.shape[1])
        return row, column

    def parts(self) -> Iterator[slice]:
        """Slices of the pixels, as many at a time as derivatives are made of."""
        for first in range(0, len(self.pixels), AT_ONCE):
            yield slice(first, min(first + AT_ONCE, len(self.pixels)))

    def predicted(self, changes: Mapping[str, float]) -> FloatArray:
        """Places (u, v) [2, n] in mm of the scene with changed unknowns; NaN where a chief ray misses the mirror."""
        setup = Setup(moved(self.scene, changes))
        parts = [design_centroids(setup, self.scene, self.place_of(part)) for part in self.parts()]
        return np.concatenate(parts, axis=-1) + self.offsets_mm

    def jacobian(self, changes: Mapping[str, float], names: Sequence[str], part: slice | IntArray) -> FloatArray:
        """Derivatives [2, n, names] of the places of a part of the pixels by the unknowns, at changed unknowns."""
        scene = moved(self.scene, changes)
        further, matrix = further_changes(changes, names)
        grid = np.divide(self.scene.screen.pitch_xy_mm, scene.screen.pitch_xy_mm)  # places are on the grid as believed
        found: FloatArray = centroid_jacobian(scene, further, self.place_of(part)) @ matrix * grid[:, None, None]
        return found


def from_maps(
    scene: Scene,
    u_mm: FloatArray,
    v_mm: FloatArray,
    error_u_mm: FloatArray | float,
    error_v_mm: FloatArray | float,
    *,
    turn_rad: float = 0.0,
    knows_mirror: bool = False,
    own: tuple[str, ...] = (),
    name: str = "images",
) -> Measurement:
    """A measurement from maps [rows, columns] of the places that the chief rays of the pixels' centres meet.

    NaN in a map: no data. errors: standard errors, maps or one number. Raises ValueError for maps that do not fit.
    """
    columns, rows = scene.camera.detector.pixels
    maps = [np.broadcast_to(np.asarray(m, float), (rows, columns)) if np.ndim(m) == 0 else np.asarray(m, float)
            for m in (u_mm, v_mm, error_u_mm, error_v_mm)]  # fmt: skip
    for key, values in zip(("u_mm", "v_mm", "error_u_mm", "error_v_mm"), maps, strict=True):
        if values.shape != (rows, columns):
            raise ValueError(f"{name}: {key} has shape {values.shape}; must be the detector's {(rows, columns)}")
    good = np.isfinite(maps).all(0) & (maps[2] > 0) & (maps[3] > 0)
    pixels = np.flatnonzero(good)
    u, v, error_u, error_v = (m.ravel()[pixels] for m in maps)
    none = np.zeros((2, len(pixels)))
    return Measurement(
        scene, pixels, np.stack([u, v]), np.stack([error_u, error_v]), none, none, turn_rad, knows_mirror, own, name
    )


@dataclass(frozen=True)
class Shares:
    """How the shared unknowns act in one measurement: its own names [k], matrix [k, unknowns] from all unknowns."""

    names: tuple[str, ...]
    matrix: FloatArray

    def changes(self, values: FloatArray) -> dict[str, float]:
        """{name: value} here, of the values of all unknowns."""
        return dict(zip(self.names, (self.matrix @ values).tolist(), strict=True))


def own_name(measurement: Measurement, name: str) -> str:
    """The name of an unknown that a measurement has for itself."""
    return f"{name} of {measurement.name}"


def all_names(shared: Sequence[str], measurements: Sequence[Measurement]) -> tuple[str, ...]:
    """The shared unknowns, then those that measurements have for themselves."""
    return (*shared, *(own_name(m, name) for m in measurements for name in m.own))


def base_name(name: str) -> str:
    """The name without the measurement that has it for itself."""
    return name.partition(" of ")[0]


def shares_of(measurement: Measurement, names: Sequence[str]) -> Shares:
    """How the unknowns `names` act in a measurement. Raises ValueError for a turned off-axis mirror."""
    if measurement.turn_rad and measurement.scene.mirror.off_axis_mm:
        raise ValueError(
            f"{measurement.name}: the mirror is turned, but mirror.off_axis_mm = "
            f"{measurement.scene.mirror.off_axis_mm:g}: only a mirror of revolution is the same design when turned"
        )
    entries: dict[str, dict[int, float]] = {}
    for k, name in enumerate(names):
        if name != (base := base_name(name)) and name != own_name(measurement, base):
            continue
        for local, weight in _acting(base, measurement).items():
            entries.setdefault(local, {})[k] = weight
    matrix = np.zeros((len(entries), len(names)))
    for row, weights in zip(matrix, entries.values(), strict=True):
        for k, weight in weights.items():
            row[k] = weight
    return Shares(tuple(entries), matrix)


def _acting(name: str, measurement: Measurement) -> dict[str, float]:
    """The unknowns of the measurement's scene that one unit of an unknown changes."""
    noll = zernike_noll(name)
    if noll is None:
        return {name: 1.0}
    if measurement.knows_mirror:
        return {}
    n, m = noll_to_nm(noll)
    if measurement.turn_rad == 0 or m == 0:
        return {name: 1.0}
    # W(phi - t): cos m(phi - t) = cos mt cos m phi + sin mt sin m phi, sin m(phi - t) = cos mt sin m phi - sin mt cos
    (other,) = zernike_names([nm_to_noll(n, -m)])
    angle = abs(m) * measurement.turn_rad
    return {name: math.cos(angle), other: math.sin(angle) * (1.0 if m > 0 else -1.0)}
