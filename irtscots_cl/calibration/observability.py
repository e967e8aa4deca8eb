"""What the images of a design will say about its geometry and its mirror, before any image exists.

The centroids of all pixels are linear in the unknowns t of the geometry (in units of their priors) and in the Zernike
terms z of the mirror: places = B t + A z + noise, with t ~ N(0, 1) and z free. Least squares gives their covariance,
with the geometry's uncertainty carried into the mirror's. z has no piston and tilt: the world is the mirror's frame, so
a mirror that is shifted or tilted is a camera and a screen that are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.calibration.height_response import LEFT_AFTER, HeightResponse
from irtscots_cl.calibration.jacobian import centroid_jacobian
from irtscots_cl.calibration.parameters import disk_radius_mm, zernike_names
from irtscots_cl.calibration.priors import Priors
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene

NOLLS = tuple(range(4, 37))  # to radial order 7
TILTS = (2, 3)
NOISE_PITCHES = 0.01  # of the screen: the standard error of a centroid, where nothing else is said
SMALLEST = 1e-9  # relative singular value of the Zernike terms' columns: below it the pixels do not tell them apart


def default_noise_mm(scene: Scene) -> float:
    """A hundredth of the screen's pitch."""
    return NOISE_PITCHES * min(scene.screen.pitch_xy_mm)


@dataclass(frozen=True)
class Observation:
    """The images' information, small enough to be combined with more.

    root [p, p]: of the priors' covariance, from t to the unknowns' units. columns [2 n, p + q]: of B and A over the
    noise, t first, z in um. tilts [2 n, 2]: the same of the mirror's tilts, Noll 2 and 3. triangle [p + q, p + q]: R of
    the QR decomposition of columns, without the priors. height_gram [4, q, q]: c^T G c is the mean square in nm^2 of
    the Zernike terms c in um over the pixels, less LEFT_AFTER.
    """

    setup: Setup = field(repr=False)
    priors: Priors
    nolls: tuple[int, ...]
    noise_mm: float
    response: HeightResponse = field(repr=False)
    root: FloatArray = field(repr=False)
    columns: FloatArray = field(repr=False)
    tilts: FloatArray = field(repr=False)
    triangle: FloatArray = field(repr=False)
    height_gram: FloatArray = field(repr=False)

    @property
    def count(self) -> int:
        """Number p of unknowns of the geometry."""
        return len(self.priors.names)

    def prior_rows(self, width: int) -> FloatArray:
        """The priors of t as rows [p, width] of a least-squares problem whose first columns are t."""
        return np.eye(self.count, width)

    def covariance(self, *more: FloatArray) -> FloatArray:
        """Covariance [p + q, p + q] of t and z from the images, the priors and further rows [.., p + q]."""
        width = self.triangle.shape[1]
        return covariance_of([self.triangle, self.prior_rows(width), *more])

    def rms_nm(self, covariance: FloatArray) -> FloatArray:
        """Rms [4] in nm over the mirror of a covariance [q, q] in um^2 of the Zernike terms, less LEFT_AFTER."""
        square = np.einsum("kij,ij->k", self.height_gram, covariance)
        rms: FloatArray = np.sqrt(np.maximum(square, 0.0))
        return rms


def observe(
    setup: Setup | Scene,
    priors: Priors,
    noise_mm: float | None = None,
    nolls: Sequence[int] = NOLLS,
    response: HeightResponse | None = None,
) -> Observation:
    """The information of a design's images. noise_mm: standard error of each centroid along each axis.

    response: that of the set-up, if it is there already. Where it leaves pixels out, those that stay stand for them.
    Raises ValueError for noise that is not positive, or Zernike terms that the pixels do not tell apart.
    """
    setup = Setup.of(setup)
    noise_mm = default_noise_mm(setup.scene) if noise_mm is None else noise_mm
    if not 0 < noise_mm < np.inf:
        raise ValueError(f"noise = {noise_mm} mm: must be a finite number above 0")
    response = response or HeightResponse.of(setup)
    seen, nolls = response.seen, tuple(nolls)
    root = priors.root(setup.scene)
    weight = seen.step / noise_mm
    names = (*priors.names, *zernike_names((*TILTS, *nolls)))
    jacobian = centroid_jacobian(setup, names, seen.pixels).reshape(-1, len(names)) * weight
    geometry, tilts, mirror = np.split(jacobian, (len(priors.names), len(priors.names) + len(TILTS)), axis=1)
    scaled = mirror / np.linalg.norm(mirror, axis=0)
    if len(scaled) < len(nolls) or np.linalg.svd(scaled, compute_uv=False)[-1] < SMALLEST:
        raise ValueError(f"the {len(scaled) // 2} pixels do not tell {len(nolls)} Zernike terms apart; ask for fewer")
    columns = np.concatenate([geometry @ root, mirror], axis=1)
    triangle, gram = triangle_of(columns), _height_gram(response, nolls, disk_radius_mm(setup.scene.mirror))
    return Observation(setup, priors, nolls, noise_mm, response, root, columns, tilts, triangle, gram)


def _height_gram(response: HeightResponse, nolls: Sequence[int], radius_mm: float) -> FloatArray:
    seen = response.seen
    x, y = (v[seen.mask] / radius_mm for v in (seen.x_mm, seen.y_mm))
    maps_nm = np.stack([zernike(noll, x, y) for noll in nolls]) * 1e3
    rests = (response.without(maps_nm, terms) for terms in LEFT_AFTER)
    return np.stack([rest @ rest.T / len(x) for rest in rests])


def triangle_of(rows: FloatArray) -> FloatArray:
    """R [k, k] of the QR decomposition of rows [.., k]: all that they say about k unknowns."""
    triangle: FloatArray = np.linalg.qr(rows, mode="r")  # type: ignore[assignment]  # NumPy's types leave R alone out
    return triangle


def covariance_of(blocks: Sequence[FloatArray]) -> FloatArray:
    """Covariance [k, k] of the unknowns of a least-squares problem with rows of unit noise in blocks [.., k]."""
    triangle = triangle_of(np.concatenate(blocks))
    scale = np.abs(np.diag(triangle))
    inverse = np.linalg.solve(triangle / scale[:, None], np.diag(1 / scale))
    covariance: FloatArray = inverse @ inverse.T
    return covariance


@dataclass(frozen=True)
class Direction:
    """A combination of unknowns that the images leave open.

    change: {name: change in its unit} of one standard deviation after the images. left: its length over that of the
    priors: 1 where the images say nothing about it. rms_nm [4]: of its height map, less LEFT_AFTER. height_nm [rows,
    columns]: the map, less piston and tilt.
    """

    change: dict[str, float]
    left: float
    rms_nm: FloatArray
    height_nm: FloatArray = field(repr=False)

    def main_parts(self, priors: Priors, share: float = 0.1) -> list[str]:
        """Names of the unknowns that make more than a share of its square, in units of their priors, largest first."""
        parts = {name: (value / priors.sigma[name]) ** 2 for name, value in self.change.items()}
        total = sum(parts.values()) or 1.0
        return sorted((name for name in parts if parts[name] > share * total), key=lambda name: -parts[name])


def weak_directions(observation: Observation, heights_mm: FloatArray, count: int = 6) -> list[Direction]:
    """The directions that leave most height, largest first: principal axes of the height maps' covariance.

    heights_mm [p, n]: maps of the unknowns per unit, as HeightResponse.heights_mm gives them.
    """
    response, p = observation.response, observation.count
    value, vector = np.linalg.eigh(observation.covariance()[:p, :p])
    half = vector * np.sqrt(np.maximum(value, 0.0))  # of the covariance of t
    maps = response.without((observation.root.T @ heights_mm).T.T, LEFT_AFTER[0]) * 1e6
    axes = np.linalg.svd(half.T @ maps, full_matrices=False)[0].T
    found = []
    for axis in axes[: min(count, p)]:
        t = half @ axis
        height = t @ maps
        unknowns = observation.root @ t
        found.append(
            Direction(
                dict(zip(observation.priors.names, unknowns.tolist(), strict=True)),
                float(np.linalg.norm(t)),
                response.left(height[None])[0],
                response.seen.on_grid(height),
            )
        )
    return found


@dataclass(frozen=True)
class ZernikeError:
    """Standard deviations in um of a Zernike term (Noll).

    noise_um: from the centroids' noise, with the geometry known. geometry_um: from the geometry that priors and images
    leave open. total_um: of both. uncalibrated_um: from the priors' geometry, if the design's is taken for true.
    """

    noll: int
    noise_um: float
    geometry_um: float
    total_um: float
    uncalibrated_um: float


def zernike_errors(observation: Observation) -> tuple[ZernikeError, ...]:
    """The standard deviation of every Zernike term, with the geometry's covariance carried through."""
    p = observation.count
    geometry, mirror = np.split(observation.columns, [p], axis=1)
    total = np.diag(observation.covariance()[p:, p:])
    noise = np.diag(covariance_of([mirror]))
    # what a fit of the mirror alone, whose tilt is removed afterwards, makes of the priors' geometry
    free = np.concatenate([observation.tilts, mirror], axis=1)
    uncalibrated = np.sum(np.linalg.lstsq(free, geometry)[0][len(TILTS) :] ** 2, axis=1)
    squares = (noise, total - noise, total, uncalibrated)
    roots = np.sqrt(np.maximum(np.stack(squares, -1), 0.0))
    return tuple(ZernikeError(noll, *row) for noll, row in zip(observation.nolls, roots.tolist(), strict=True))
