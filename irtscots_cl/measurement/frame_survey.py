"""What recorded frames show by their values alone: those that are copies of another, and the camera's ceiling."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.system import interruption

LEAST = 20  # samples at a ceiling
TIMES = 4.0  # as many at the ceiling as at any of the values next below it
BELOW = 4  # of these values


@dataclass(frozen=True)
class FrameSurvey:
    """copies: pairs of frames (first, later one) with equal values. ceiling: value that many samples of whole numbers
    stop at, infinite where none is seen."""

    copies: tuple[tuple[int, int], ...]
    ceiling: float


def survey_frames(frames: Sequence[NDArray[Any]] | NDArray[Any]) -> FrameSurvey:
    """Survey of frames [rows, columns] of any real type, one after the other."""
    first: dict[bytes, int] = {}
    copies = []
    counts: NDArray[Any] = np.zeros(1, np.int64)
    for k in range(len(frames)):
        interruption.check()
        image = np.ascontiguousarray(frames[k])
        digest = hashlib.blake2b(image.tobytes(), digest_size=16).digest()
        if digest in first and np.ptp(image) > 0:
            copies.append((first[digest], k))
        first.setdefault(digest, k)
        if image.dtype.kind == "u" and image.dtype.itemsize <= 2:
            own = np.bincount(image.ravel())
            longer, shorter = (own, counts) if len(own) > len(counts) else (counts, own)
            counts = longer.astype(np.int64)
            counts[: len(shorter)] += shorter
    return FrameSurvey(tuple(copies), _ceiling(counts))


def _ceiling(counts: NDArray[Any]) -> float:
    """The highest value where samples pile up, of the numbers of samples by value."""
    values = np.flatnonzero(counts)
    if len(values) <= BELOW:
        return math.inf
    below = counts[values[-1 - BELOW : -1]]
    if counts[values[-1]] < LEAST or counts[values[-1]] < TIMES * below.max():
        return math.inf
    return float(values[-1])
