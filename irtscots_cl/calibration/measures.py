"""What to measure next: how much of the height's uncertainty each further measurement of the test would remove.

A number measured better (an unknown, or a distance) is one more row of the least-squares problem. The mirror turned, or
a reference mirror in its place, are further images with the same geometry: their rows have the columns of the mirror's
terms turned or replaced, and unknowns of their own, the pose that the mirror then has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from irtscots_cl.calibration.jacobian import jacobian_of
from irtscots_cl.calibration.observability import Observation, covariance_of, triangle_of
from irtscots_cl.calibration.parameters import ANGLE, parameter, zernike_names
from irtscots_cl.calibration.priors import PLACES, distance_gradient
from irtscots_cl.calibration.seen_pixels import FEWEST, on_screen
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.maths.zernike.indices import nm_to_noll, noll_to_nm
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.surface import Surface

SHARE = 0.9  # of what perfect knowledge of a number buys, in mean squares: how well it needs to be measured
PLAN_SHARE = 0.01
REMOUNT_MM, REMOUNT_RAD = 0.05, float(np.radians(0.01))  # of a mirror taken out and put back, to the same stops
REFERENCE_UM = 0.005  # rms figure of a reference that is not known
TURNS = ((0.0, 90.0), (0.0, 120.0), (0.0, 120.0, 240.0))  # degrees
MIRROR_POSE = tuple(f"mirror.{key}" for key in ("x_mm", "y_mm", "z_mm", "tilt_x_rad", "tilt_y_rad", "clocking_rad"))
ABERRATIONS = {
    (2, 0): "power",
    (2, 2): "astigmatism",
    (3, 1): "coma",
    (3, 3): "trefoil",
    (4, 0): "spherical aberration",
}
Further = tuple[str, FloatArray | None, str]  # name, covariance with it, why it cannot be made


@dataclass(frozen=True)
class Measure:
    """A further measurement. sigma: the standard deviation that it needs, in ``unit``; None for one without a number.

    before, after [4]: rms height uncertainty in nm without and with it, less LEFT_AFTER. mainly: the aberration that
    falls most. why_not: the reason if it cannot be made; after is before then.
    """

    name: str
    unit: str
    sigma: float | None
    before_nm: FloatArray
    after_nm: FloatArray
    mainly: str
    why_not: str = ""

    @property
    def buys_nm(self) -> FloatArray:
        """Fall [4] of the rms height uncertainty."""
        return self.before_nm - self.after_nm


def ranked_measures(observation: Observation) -> list[Measure]:
    """All further measurements, those that buy most height first, whatever terms are removed from it."""
    p, before = observation.count, observation.covariance()
    found = [_number(observation, before, *number) for number in _numbers(observation)]
    own = _with_pose(observation, observation.setup.chief_rays, *observation.response.seen.pixels)
    for name, covariance, why_not in (*_turned(observation, own), *_references(observation, own)):
        after = before[p:, p:] if covariance is None else covariance
        found.append(_measure(observation, name, "", None, before[p:, p:], after, why_not))
    return sorted(found, key=lambda measure: -measure.buys_nm.max())


def plan(observation: Observation, steps: int = 6) -> list[Measure]:
    """Numbers to measure one after the other, each the one that buys most of what the ones before it left.

    Piston and tilt are removed. It ends where a number buys less than PLAN_SHARE of what is left.
    """
    numbers, covariance, found = _numbers(observation), observation.covariance(), []
    p = observation.count
    for _ in range(steps):
        choices = [_number(observation, covariance, *number) for number in numbers]
        best = max(range(len(choices)), key=lambda k: choices[k].buys_nm[0])
        if choices[best].buys_nm[0] < PLAN_SHARE * choices[best].before_nm[0]:
            break
        found.append(choices[best])
        covariance = _knowing(covariance, numbers[best][2], p)[0]
    return found


def _numbers(observation: Observation) -> list[tuple[str, str, FloatArray]]:
    """Names, units and gradients [p] by t of the numbers that can be measured."""
    scene, names = observation.setup.scene, observation.priors.names
    found = [(name, parameter(name, scene).unit, observation.root[k]) for k, name in enumerate(names)]
    for k, first in enumerate(PLACES):
        for second in PLACES[k + 1 :]:
            gradient = distance_gradient(scene, first, second, names)
            if gradient.any():
                found.append((f"{first} to {second}", "mm", gradient @ observation.root))
    return found


def _knowing(covariance: FloatArray, gradient: FloatArray, count: int) -> tuple[FloatArray, float]:
    """The covariance once a number was measured so well that it buys SHARE, and the standard deviation of that."""
    spread = covariance[:, :count] @ gradient
    square = float(gradient @ spread[:count])
    variance = square * (1 / SHARE - 1)
    return covariance - np.outer(spread, spread) / (square + variance), float(np.sqrt(variance))


def _number(observation: Observation, before: FloatArray, name: str, unit: str, gradient: FloatArray) -> Measure:
    p = observation.count
    after, sigma = _knowing(before, gradient, p)
    return _measure(observation, name, unit, sigma, before[p:, p:], after[p:, p:])


def _measure(
    observation: Observation,
    name: str,
    unit: str,
    sigma: float | None,
    before: FloatArray,
    after: FloatArray,
    why_not: str = "",
) -> Measure:
    variances: dict[tuple[int, int], list[FloatArray]] = {}
    for k, noll in enumerate(observation.nolls):
        n, m = noll_to_nm(noll)
        variances.setdefault((n, abs(m)), []).append(np.array([before[k, k], after[k, k]]))
    fall = {nm: -float(np.diff(np.sqrt(np.sum(both, axis=0)))[0]) for nm, both in variances.items()}
    most = max(fall, key=lambda nm: fall[nm])
    mainly = ABERRATIONS.get(most, f"the terms n = {most[0]}, m = {most[1]}") if fall[most] > 0 else ""
    return Measure(name, unit, sigma, observation.rms_nm(before), observation.rms_nm(after), mainly, why_not)


def zernike_turn(nolls: Sequence[int], angle_rad: float) -> FloatArray:
    """Matrix [q, q] from Zernike coefficients of a mirror to those seen after it was turned from x towards y.

    Raises ValueError if a term stands without its partner.
    """
    place = {noll: k for k, noll in enumerate(nolls)}
    matrix = np.zeros((len(nolls), len(nolls)))
    for noll, k in place.items():
        n, m = noll_to_nm(noll)
        partner = nm_to_noll(n, -m)
        if partner not in place:
            raise ValueError(f"Zernike terms {noll} and {partner} turn into each other: both must be among the terms")
        matrix[k, k] = np.cos(m * angle_rad)
        if m:
            matrix[place[partner], k] = np.sin(m * angle_rad)  # cosine into sine, and sine into minus cosine
    return matrix


def _turned(observation: Observation, own: FloatArray) -> list[Further]:
    """Covariances [q, q] of the mirror's terms with further images of it turned about its own axis.

    own: the triangle of _with_pose for the mirror.
    """
    scene = observation.setup.scene
    found: list[Further] = []
    for angles in TURNS:
        name = f"mirror at {', '.join(f'{angle:.0f}' for angle in angles[:-1])} and {angles[-1]:.0f} degrees"
        if scene.mirror.off_axis_mm > 0:
            found.append((name, None, "an off-axis segment looks different when it is turned"))
            continue
        blocks = [zernike_turn(observation.nolls, float(np.radians(angle))) for angle in angles]
        found.append((name, _joint(observation, own, blocks), ""))
    return found


def _with_pose(observation: Observation, chief: ChiefRays, row: FloatArray, column: FloatArray) -> FloatArray:
    """Triangle [k, p + q + 6] of images by chief rays: t, Zernike terms in um, and the pose in remounts."""
    names = (*observation.priors.names, *zernike_names(observation.nolls), *MIRROR_POSE)
    p, q = observation.count, len(observation.nolls)
    columns = jacobian_of(chief, names, row, column).reshape(-1, len(names))
    columns *= observation.response.seen.step / observation.noise_mm
    columns[:, :p] = columns[:, :p] @ observation.root
    scene = observation.setup.scene
    columns[:, p + q :] *= [REMOUNT_RAD if parameter(n, scene).unit == ANGLE else REMOUNT_MM for n in MIRROR_POSE]
    return triangle_of(columns)


def _joint(observation: Observation, rows: FloatArray, blocks: Sequence[FloatArray]) -> FloatArray:
    """Covariance [q, q] of the mirror's terms from several images.

    rows: of _with_pose. blocks [q, q]: of each image, from the mirror's terms to those seen. In the first the mirror is
    where the world is; in every other its pose is unknown by a remount.
    """
    p, q, pose = observation.count, len(observation.nolls), len(MIRROR_POSE)
    width = p + q + pose * (len(blocks) - 1)
    stacked = [observation.prior_rows(width), np.eye(width)[p + q :]]
    for k, block in enumerate(blocks):
        image = np.zeros((len(rows), width))
        image[:, :p], image[:, p : p + q] = rows[:, :p], rows[:, p : p + q] @ block
        if k:
            first = p + q + pose * (k - 1)
            image[:, first : first + pose] = rows[:, p + q :]
        stacked.append(image)
    return covariance_of(stacked)[p : p + q, p : p + q]


@dataclass(frozen=True)
class _OtherMirror(ChiefRays):
    """The chief rays of a scene with another surface in the mirror's place."""

    other: Surface | None = None

    @property
    def surface(self) -> Surface:
        assert self.other is not None
        return self.other


def _references(observation: Observation, own: FloatArray) -> list[Further]:
    """Covariances [q, q] of the mirror's terms with images of a reference in its place, known to REFERENCE_UM rms.

    own: as in _turned.
    """
    setup, seen = observation.setup, observation.response.seen
    known = f", known to {REFERENCE_UM * 1e3:.0f} nm rms"
    found: list[Further] = []
    found.append((f"reference of the mirror's own form{known}", _with_reference(observation, own), ""))
    flat = replace(setup.chief_rays.surface, quadric=Quadric(0.0, 0.0, 0.0), design=(), deviation=())
    name, chief = f"reference flat{known}", _OtherMirror(setup.scene, flat)
    row, column = (v.ravel() for v in np.meshgrid(seen.row, seen.column, indexing="ij"))
    points, u, v = chief.reverse(row, column)
    with np.errstate(invalid="ignore"):
        use = chief.surface.contains(points[:, 0], points[:, 1]) & on_screen(setup, u, v)
    if np.count_nonzero(use) < FEWEST:
        found.append((name, None, f"the camera sees the screen in it through {np.count_nonzero(use)} pixels"))
        return found
    rows = _with_pose(observation, chief, row[use], column[use])
    return [*found, (name, _with_reference(observation, rows), "")]


def _with_reference(observation: Observation, rows: FloatArray) -> FloatArray:
    """Covariance [q, q] of the mirror's terms from its image and one of a reference; rows: of _with_pose."""
    p, q, pose = observation.count, len(observation.nolls), len(MIRROR_POSE)
    width = p + 2 * q + pose
    own = np.zeros((p + q, width))
    own[:, : p + q] = observation.triangle
    other = np.zeros((len(rows), width))
    other[:, :p], other[:, p + q :] = rows[:, :p], rows[:, p:]
    figure = np.eye(width)[p + q : p + 2 * q] * np.sqrt(q) / REFERENCE_UM
    remount = np.eye(width)[p + 2 * q :]
    covariance = covariance_of([observation.prior_rows(width), own, other, figure, remount])
    return covariance[p : p + q, p : p + q]
