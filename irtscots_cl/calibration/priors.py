"""What is known about a test's geometry before its images: standard deviations of its unknowns, and of distances."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from irtscots_cl.calibration.parameters import ANGLE, LENGTH, PIXEL, known_parameters, parameter
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.model import Scene

PLACES = ("camera", "screen", "mirror")
_BY_UNIT = {LENGTH: 0.5, ANGLE: float(np.radians(0.1)), PIXEL: 0.5}
_BY_NAME = {
    "camera.focal_relative": 1e-3,
    "camera.aspect_relative": 1e-4,
    "screen.pitch_relative": 1e-4,
    "screen.pitch_y_relative": 1e-4,
}
_SAG_MM = 0.1
_OF_SCALE = 0.1  # of a distortion coefficient: 1e-4 of the image's half diagonal in its corners


@dataclass(frozen=True)
class Distance:
    """A measured distance between two of PLACES (aperture's centre, screen's middle, mirror's vertex).

    sigma_mm: its standard deviation. Raises ValueError for other places, the same place twice, or a sigma of 0 or less.
    """

    first: str
    second: str
    sigma_mm: float

    def __post_init__(self) -> None:
        for place in (self.first, self.second):
            if place not in PLACES:
                raise ValueError(f"distance: {place!r} must be one of {', '.join(PLACES)}")
        if self.first == self.second:
            raise ValueError(f"distance: from {self.first!r} to itself; must be between two places")
        if not 0 < self.sigma_mm < np.inf:
            raise ValueError(f"distance: sigma_mm = {self.sigma_mm}: must be a finite number above 0")

    @property
    def name(self) -> str:
        return f"{self.first} to {self.second}"


@dataclass(frozen=True)
class Priors:
    """sigma: {name of an unknown: standard deviation in its unit}; the unknowns are independent, but for distances."""

    sigma: Mapping[str, float]
    distances: tuple[Distance, ...] = ()

    def __post_init__(self) -> None:
        for name, value in self.sigma.items():
            if not 0 < value < np.inf:
                raise ValueError(f"prior of {name} = {value}: must be a finite number above 0")

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.sigma)

    def root(self, scene: Scene) -> FloatArray:
        """Matrix L [p, p] with L L^T the covariance of the unknowns, in the order of ``names``."""
        sigma = np.array([self.sigma[name] for name in self.names])
        information = np.eye(len(sigma))  # in units of the sigmas
        for distance in self.distances:
            row = distance_gradient(scene, distance.first, distance.second, self.names) * sigma / distance.sigma_mm
            information += np.outer(row, row)
        root: FloatArray = sigma[:, None] * np.linalg.inv(np.linalg.cholesky(information)).T
        return root


def default_priors(scene: Scene, names: Iterable[str] | None = None) -> Priors:
    """What a careful set-up without a calibration of its own leaves.

    0.5 mm, 0.1 degree, 0.5 pixel of the principal point, 0.1 % of the focal length, 0.01 % of aspect, pitch and, in the
    image's corners, of distortion; 0.1 mm of the screen's flatness, a micrometre of Zernike terms. names: by default
    those of the camera and the screen; a mirror's move is the same as one of both, and its form is what is measured.
    """
    if names is None:
        names = [name for name in known_parameters(scene) if not name.startswith("mirror.")]
    return Priors({name: _default_sigma(name, scene) for name in names})


def scene_priors(scene: Scene) -> Priors:
    """The default priors, with what the scene's table [calibration.known] says in their place or besides.

    Raises ValueError for a name in it that is no unknown and no distance.
    """
    priors = default_priors(scene)
    if scene.calibration is None:
        return priors
    from irtscots_cl.scene.calibration_known import distance_ends  # imported late: few scenes have the table

    sigma, distances = dict(priors.sigma), []
    for name, known in scene.calibration.known.items():
        if (ends := distance_ends(name)) is not None:
            distances.append(Distance(*ends, known.sigma))
            continue
        try:
            parameter(name, scene)
        except ValueError as error:
            raise ValueError(f"scene {scene.name}: calibration.known: {error}") from None
        sigma[name] = known.sigma
    return Priors(sigma, tuple(distances))


def _default_sigma(name: str, scene: Scene) -> float:
    known = parameter(name, scene)
    if name in _BY_NAME:
        return _BY_NAME[name]
    if name.startswith("screen.sag"):
        return _SAG_MM
    if known.unit in _BY_UNIT:
        return _BY_UNIT[known.unit]
    return known.scale * (_OF_SCALE if name.startswith("camera.") else 1.0)


def distance_gradient(scene: Scene, first: str, second: str, names: Sequence[str]) -> FloatArray:
    """Derivatives [p] of the distance between two of PLACES by the unknowns ``names``, per unit of each."""
    places = {"camera": scene.camera.position_mm, "screen": scene.screen.position_mm, "mirror": (0.0, 0.0, 0.0)}
    away = np.subtract(places[second], places[first])
    away = away / np.linalg.norm(away)
    gradient = np.zeros(len(names))
    for sign, place in ((-1.0, first), (1.0, second)):
        for k, axis in enumerate("xyz"):
            if f"{place}.{axis}_mm" in names:
                gradient[names.index(f"{place}.{axis}_mm")] = sign * away[k]
    return gradient
