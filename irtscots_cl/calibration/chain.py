"""Derivatives away from the scene that changes are counted from.

centroid_jacobian is by further changes of a scene that has been moved. Turns do not add up, and relative changes
multiply: this is what a change of the unknowns, as counted from the original scene, is as a further change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from irtscots_cl.calibration.poses import rotation
from irtscots_cl.maths.arrays import FloatArray

_SHIFTS = {part: tuple(f"{part}.{axis}_mm" for axis in "xyz") for part in ("camera", "screen", "mirror")}
_TURNS = {
    part: (f"{part}.tilt_x_rad", f"{part}.tilt_y_rad", f"{part}.{'roll' if part == 'camera' else 'clocking'}_rad")
    for part in ("camera", "screen", "mirror")
}


def further_changes(values: Mapping[str, float], names: Sequence[str]) -> tuple[tuple[str, ...], FloatArray]:
    """Names [k] and matrix [k, names]: the further changes of a scene moved by `values`, per change of `names`."""
    columns = [_column(name, values) for name in names]
    rows = tuple(dict.fromkeys(row for column in columns for row in column))
    matrix = np.array([[column.get(row, 0.0) for column in columns] for row in rows]).reshape(len(rows), len(names))
    return rows, matrix


def _column(name: str, values: Mapping[str, float]) -> dict[str, float]:
    part = name.partition(".")[0]
    if part in _SHIFTS and name in _SHIFTS[part]:
        turn = _vector(_TURNS["mirror"], values)  # the world of the moved scene is that of the turned mirror
        return _mixed(name, _SHIFTS[part], rotation(turn).T) if turn.any() else {name: 1.0}
    if part in _TURNS and name in _TURNS[part]:
        turn = _vector(_TURNS[part], values)
        return _mixed(name, _TURNS[part], _added_turn(turn)) if turn.any() else {name: 1.0}
    return {name: 1.0 / (1.0 + values.get(name, 0.0)) if name.endswith("_relative") else 1.0}


def _vector(names: Sequence[str], values: Mapping[str, float]) -> FloatArray:
    return np.array([values.get(name, 0.0) for name in names])


def _mixed(name: str, names: tuple[str, ...], matrix: FloatArray) -> dict[str, float]:
    return dict(zip(names, matrix[:, names.index(name)].tolist(), strict=True))


def _added_turn(vector_rad: FloatArray) -> FloatArray:
    """The right Jacobian of the rotation group: rotation(v + d) = rotation(v) rotation(this @ d) to first order in d.

    Chirikjian, Stochastic Models, Information Theory, and Lie Groups, vol. 2, 2012, section 10.6.
    """
    x, y, z = vector_rad
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = float(np.linalg.norm(vector_rad))
    if angle < 1e-3:  # the series: its next terms are below 1e-16
        first, second = 1 / 2 - angle**2 / 24, 1 / 6 - angle**2 / 120
    else:
        first, second = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    found: FloatArray = np.eye(3) - first * cross + second * cross @ cross
    return found
