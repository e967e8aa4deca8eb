"""Pairs of unknowns whose effects on the images are nearly the same: moved against each other, the images stay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.calibration.height_response import HeightResponse
from irtscots_cl.maths.arrays import FloatArray

MOST_DIFFERENT = 0.02  # of an effect that no multiple of the other's makes


@dataclass(frozen=True)
class Lookalike:
    """differ: rms share of the first's effect on the centroids that no multiple of the second's makes. ratio: units of
    the second that have the effect of one of the first. rms_nm [4]: height that half a unit of the first leaves with
    half as much of the second against it, less LEFT_AFTER."""

    first: str
    second: str
    differ: float
    ratio: float
    rms_nm: FloatArray = field(repr=False)


def lookalikes(
    names: Sequence[str], jacobian: FloatArray, heights_mm: FloatArray, response: HeightResponse
) -> list[Lookalike]:
    """The pairs among names [p] that differ by at most MOST_DIFFERENT, the most alike first.

    jacobian [2 n, p]: of the centroids; heights_mm [p, n]: the unknowns' height maps per unit.
    """
    lengths = np.linalg.norm(jacobian, axis=0)
    known = np.flatnonzero(lengths > 0).tolist()
    found = []
    for place, i in enumerate(known):
        for j in known[place + 1 :]:
            ratio = float(jacobian[:, i] @ jacobian[:, j] / lengths[j] ** 2)
            differ = float(np.linalg.norm(jacobian[:, i] - ratio * jacobian[:, j]) / lengths[i])
            if differ <= MOST_DIFFERENT:
                apart = (heights_mm[i] - ratio * heights_mm[j]) / 2
                found.append(Lookalike(names[i], names[j], differ, ratio, response.left(apart[None])[0] * 1e6))
    return sorted(found, key=lambda pair: pair.differ)
