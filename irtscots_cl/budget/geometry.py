"""Error sources: the geometry of a test, by the names of the unknowns of irtscots_cl/calibration/parameters.py."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.calibration.jacobian import centroid_jacobian, centroids_and_view, design_centroids
from irtscots_cl.calibration.parameters import moved, parameter
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.scene.model import Scene

PREFIXES = ("camera.", "screen.", "mirror.", "zernike.")


@dataclass(frozen=True)
class Geometry:
    """A number of the geometry that differs from what the measurement takes for true."""

    name: str
    unit: str
    text: str
    usual: float
    kind: Kind = Kind.PARAMETER

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places, exact for any value."""
        return geometry_changes(design, {self.name: value})


def geometry(name: str, scene: Scene) -> Geometry:
    """The source of a name. Raises ValueError for an unknown one."""
    found = parameter(name, scene)
    return Geometry(name, found.unit, found.text, found.scale)


def geometry_changes(design: MeasuredDesign, values: Mapping[str, float]) -> FloatArray:
    """Changes (du, dv) [2, n] of the places when several numbers differ together, exact."""
    there = moved(design.setup.scene, values)
    return design_centroids(there, design.setup, design.seen.pixels) - design.places_mm


def geometry_view(design: MeasuredDesign, values: Mapping[str, float]) -> tuple[FloatArray, BoolArray]:
    """As geometry_changes; and which pixels [n] still see the screen in the mirror. Changes go on beyond the rim."""
    there = moved(design.setup.scene, values)
    places, sees = centroids_and_view(there, design.setup, design.seen.pixels)
    return places - design.places_mm, sees


def geometry_derivatives(design: MeasuredDesign, names: Sequence[str]) -> FloatArray:
    """Changes (du, dv) [names, 2, n] of the places per unit of each number, exact to first order."""
    jacobian = centroid_jacobian(design.setup, names, design.seen.pixels)
    found: FloatArray = np.moveaxis(jacobian, -1, 0)
    return found


def geometry_derivative(design: MeasuredDesign, name: str) -> FloatArray:
    """Changes (du, dv) [2, n] of the places per unit of one number, made once for a design."""
    return design.once(name, lambda: geometry_derivatives(design, [name])[0])
