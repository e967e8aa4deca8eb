"""What fiducials say of the mapping between picture and mirror, and the change of the scene that would explain it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.fiducial_mapping import FiducialMap
from irtscots_cl.measurement.quality import OK, WARNING, Check
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.instrument import Camera

SIGMAS = 5.0  # 6e-7 for Gaussian noise
LEAST_PX = 0.3  # mapping error from which on it is named, if it is certain
TELLING = 3.0  # standard errors, from which on turn and scale are part of the suggestion
ROUNDS = 3  # of Gauss-Newton
SHOWN = 6  # names in a message


@dataclass(frozen=True)
class SceneChange:
    """A camera that has the marks where the picture has them. keys: what to set, as in a scene file. rms_mm: of the
    mapping error that would be left."""

    camera: Camera
    keys: dict[str, object]
    rms_mm: float

    @property
    def text(self) -> str:
        return ", ".join(f"{key} = {value}" for key, value in self.keys.items())


def suggested_change(found: FiducialMap, chief: ChiefRays) -> SceneChange | None:
    """The camera's direction, with its roll and its focal length where the marks tell them; None without enough marks.

    A camera that stands elsewhere, or another place of the mirror before it, looks nearly the same.
    """
    if not found.is_enough:
        return None
    camera = chief.scene.camera
    errors = np.sqrt(np.diag(found.move_covariance))
    places = np.array([one.place_px for one in found.found if one is not None])
    true = found.marks.points_mm[found.matched]
    tell = [abs(found.turn_rad) > TELLING * errors[3], abs(found.scale - 1) > TELLING * errors[2]]

    def changed(unknowns: FloatArray) -> Camera:
        x, y = np.array(camera.look_at_mm[:2]) + unknowns[:2]
        z = camera.look_at_mm[2] + float(chief.surface.sag(x, y) - chief.surface.sag(*np.array(camera.look_at_mm[:2])))
        return replace(
            camera,
            look_at_mm=(round(float(x), 4), round(float(y), 4), round(z, 4)),
            roll_deg=round(camera.roll_deg + math.degrees(unknowns[2]) * tell[0], 5),
            focal_length_mm=round(camera.focal_length_mm * (1 + unknowns[3] * tell[1]), 6),
        )

    def left(unknowns: FloatArray) -> FloatArray:
        other = ChiefRays(replace(chief.scene, camera=changed(unknowns)))
        misfit: FloatArray = (other.reverse(*places.T)[0][:, :2] - true).ravel()
        return misfit

    unknowns = np.array([*-found.offset_mm, -found.turn_rad, found.scale - 1])
    steps = np.array([0.5, 0.5, 1e-3, 1e-3])  # beyond the rounding of the keys
    for _ in range(ROUNDS):
        slopes = np.stack([(left(unknowns + step) - left(unknowns - step)) / 2 for step in np.diag(steps)], -1)
        unknowns = unknowns - steps * (np.linalg.pinv(slopes) @ left(unknowns))
    best = changed(unknowns)
    keys: dict[str, object] = {"camera.look_at_mm": list(best.look_at_mm)}
    keys |= {"camera.roll_deg": best.roll_deg} if tell[0] else {}
    keys |= {"camera.focal_length_mm": best.focal_length_mm} if tell[1] else {}
    return SceneChange(best, keys, float(np.sqrt(2 * np.mean(left(unknowns) ** 2))))


def fiducial_checks(found: FiducialMap, change: SceneChange | None) -> list[Check]:
    """Which marks were found, and how far the mapping is off by them."""
    checks = [_marks(found)]
    if found.is_enough:
        checks.append(_mapping(found, change))
        checks.append(_left(found))
    if found.alike:
        text = f"the marks fit as well with {' or with '.join(found.alike)}: they do not tell the images' orientation"
        checks.append(Check("fiducial orientation", WARNING, float(len(found.alike)), 0.0, 1e-6, text))
    return checks


def _marks(found: FiducialMap) -> Check:
    total, there = len(found.found), int(found.matched.sum())
    names = [mark.name for mark in found.marks.marks]
    told = []
    missing = [names[k] for k, one in enumerate(found.found) if one is None and k not in found.near_mm]
    if missing:
        told.append(f"not found: {_some(missing)}")
    if found.near_mm:
        off = [f"{names[k]} ({value:.3g} mm off)" for k, value in found.near_mm.items()]
        told.append(f"not where the others have it: {_some(off)}")
    if len(found.strays):
        at = [f"row {row:.0f}, column {column:.0f}" for row, column in found.strays]
        told.append(f"{len(at)} more that look like marks: {_some(at)}")
    text = f"{there} of {total} marks found{'; ' if told else ''}{'; '.join(told)}"
    if there == total:
        return Check("fiducials", OK, float(there), float(total), 1e-6, text)
    if not found.is_enough:
        why = "lie on one line" if there >= 4 else "are too few"
        text += f"; those found {why} to tell offset, turn and scale: no mapping error"
    return Check("fiducials", WARNING, float(there), float(total), 1e-6, text)


def _some(words: list[str]) -> str:
    return ", ".join(words[:SHOWN]) + (f" and {len(words) - SHOWN} more" if len(words) > SHOWN else "")


def _mapping(found: FiducialMap, change: SceneChange | None) -> Check:
    errors = np.sqrt(np.diag(found.move_covariance))
    (x, y), value = found.offset_mm, found.rms_mm()
    mm = float(np.mean([shape.scale for shape in found.shapes]))
    limit = max(LEAST_PX * mm, SIGMAS * float(np.hypot(*errors[:2])))
    told = (
        f"the marks lie {value:.3g} mm rms from their places by the design's camera: offset {x:+.3g}, {y:+.3g} mm (+- "
        f"{errors[:2].max():.2g}), turn {found.turn_rad * 1e3:+.3g} mrad (+- {errors[3] * 1e3:.2g}), scale "
        f"{found.scale:.5f} (+- {errors[2]:.1g})"
    )
    if value <= limit:
        return Check("fiducial mapping", OK, value, limit, 1e-6, told)
    if change is not None:
        told += f"; {change.text} would leave {change.rms_mm:.3g} mm, as might a camera or a mirror in another place"
    return Check("fiducial mapping", WARNING, value, limit, 1e-6, told)


def _left(found: FiducialMap) -> Check:
    left, error = found.left_mm[found.matched], found.standard_error_mm[found.matched]
    value = found.rms_mm(left=True)
    noise = float(np.sqrt(np.mean(np.sum(error**2, -1))))
    mm = float(np.mean([shape.scale for shape in found.shapes]))
    limit = max(LEAST_PX * mm, SIGMAS * noise)
    text = f"without offset, turn and scale the marks lie {value:.3g} mm rms from their places (noise: {noise:.2g} mm)"
    if value <= limit:
        return Check("fiducial residual", OK, value, limit, 1e-6, text)
    names = [mark.name for mark, there in zip(found.marks.marks, found.matched, strict=True) if there]
    worst = int(np.argmax(np.hypot(*left.T)))
    text += (
        f", {names[worst]} {np.hypot(*left[worst]):.3g} mm: the camera's distortion or position, the mirror's shape, "
        "or the table of marks differs"
    )
    return Check("fiducial residual", WARNING, value, limit, 1e-6, text)
