"""The unknowns that a user names, and what [calibration.known] and the defaults say of them.

An unknown that the scene does not name has a default standard deviation (priors.default_priors), unless such defaults
are not wanted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from irtscots_cl.calibration.parameters import DISTORTION, known_parameters, parameter, zernike_names
from irtscots_cl.calibration.priors import default_priors
from irtscots_cl.scene.calibration_known import Knowledge, distance_ends
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError

DEFAULT = "default"  # source of a prior that the scene does not give
MAX_NOLL = 861
_POSE = ("x_mm", "y_mm", "z_mm", "tilt_x_rad", "tilt_y_rad")
GROUPS = {
    "camera": tuple(f"camera.{key}" for key in (*_POSE, "roll_rad")),
    "screen": tuple(f"screen.{key}" for key in (*_POSE, "clocking_rad")),
    "mirror": tuple(f"mirror.{key}" for key in (*_POSE, "clocking_rad")),
    "intrinsics": ("camera.principal_x_px", "camera.principal_y_px", "camera.focal_relative"),
    "distortion": tuple(f"camera.{key}" for key in DISTORTION),
    "shape": ("screen.sag_2_0_mm", "screen.sag_1_1_mm", "screen.sag_0_2_mm"),
}


@dataclass(frozen=True)
class Prior:
    """sigma: standard deviation in the unknown's unit; NaN: nothing is known. source: in words."""

    sigma: float
    source: str


@dataclass(frozen=True)
class KnownDistance:
    """A measured distance between the middles of two of camera, screen and mirror."""

    name: str
    ends: tuple[str, str]
    mm: float
    sigma: float
    source: str

    def of(self, scene: Scene) -> float:
        """The distance in a scene, in mm."""
        return _distance_mm(scene, *self.ends)


def named_unknowns(text: str, scene: Scene) -> tuple[str, ...]:
    """The names in a list such as "camera, screen.z_mm, zernike.4-15", each once.

    A word is a name, a group of GROUPS, a pattern such as "camera.tilt_*", or a range of Noll indices. Raises
    ValueError for others, with the nearest name.
    """
    found: list[str] = []
    for word in filter(None, (word.strip() for word in text.split(","))):
        if word in GROUPS:
            names: Sequence[str] = GROUPS[word]
        elif word.startswith("zernike.") and word.count("-") == 1 and not word.endswith("_um"):
            names = _nolls(word)
        elif "*" in word and (matched := [name for name in known_parameters(scene) if fnmatchcase(name, word)]):
            names = matched
        else:
            names = [parameter(word, scene).name]
        found += [name for name in names if name not in found]
    return tuple(found)


def _nolls(word: str) -> tuple[str, ...]:
    first, last = word.removeprefix("zernike.").split("-")
    if not (first.isdigit() and last.isdigit() and 1 <= int(first) <= int(last) <= MAX_NOLL):
        raise ValueError(f"unknown {word!r}: a range of Noll indices is zernike.4-15, from 1 to {MAX_NOLL}")
    return zernike_names(range(int(first), int(last) + 1))


def priors_of(names: Sequence[str], scene: Scene, *, defaults: bool = True, source: str = "scene") -> dict[str, Prior]:
    """The priors of some unknowns. defaults: whether an unknown without one gets its default.

    source: the scene's file, for messages. Raises SceneError for keys of [calibration.known] that are no unknowns.
    """
    own = _known(scene)
    for key in own:
        try:
            _ = distance_ends(key) or parameter(key, scene)
        except ValueError as error:
            raise SceneError(f"{source}: calibration.known: {error}") from None
    usual = default_priors(scene, names).sigma
    found = {}
    for name in names:
        if name in own:
            found[name] = Prior(own[name].sigma, own[name].source or "calibration.known")
        else:
            found[name] = Prior(usual[name], DEFAULT) if defaults else Prior(np.nan, "none")
    return found


def distances_of(scene: Scene) -> tuple[KnownDistance, ...]:
    """The distances of [calibration.known]; one without a value is as in the scene."""
    found = []
    for name, known in _known(scene).items():
        if (ends := distance_ends(name)) is not None:
            mm = _distance_mm(scene, *ends) if known.mm is None else known.mm
            found.append(KnownDistance(name, ends, mm, known.sigma, known.source or "calibration.known"))
    return tuple(found)


def _distance_mm(scene: Scene, first: str, second: str) -> float:
    places = {"camera": scene.camera.position_mm, "screen": scene.screen.position_mm, "mirror": (0.0, 0.0, 0.0)}
    return math.dist(places[first], places[second])


def _known(scene: Scene) -> Mapping[str, Knowledge]:
    return scene.calibration.known if scene.calibration is not None else {}
