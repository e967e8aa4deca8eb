"""Orientation of images and scans, from the centroids: flipped, turned, reversed or exchanged."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray

CLEARLY = 0.5  # of the misfit as recorded: another orientation that leaves less is the right one
SIMILAR = 0.01  # misfit beyond the least: orientations that a symmetric set-up cannot tell apart
MAX_NAMES = 3

# Name of a change of the image: what undoes it. Applied to maps [rows, columns].
IMAGES = {
    "": lambda a: a,
    "the rows upside down": lambda a: a[::-1],
    "the columns mirrored": lambda a: a[:, ::-1],
    "the image turned by half a turn": lambda a: a[::-1, ::-1],
    "rows and columns exchanged": lambda a: a.T,
    "the image turned by a quarter": lambda a: a.T[::-1],
    "the image turned by a quarter the other way": lambda a: a.T[:, ::-1],
    "rows and columns exchanged about the other diagonal": lambda a: a.T[::-1, ::-1],
}


@dataclass(frozen=True)
class Orientation:
    """misfit: mean square difference of the centroids from the design, relative to the design's own variation, as
    recorded; best_misfit: in the best orientation. names: of the simplest best ones; empty for the recorded one."""

    misfit: float
    best_misfit: float
    names: tuple[str, ...]

    @property
    def is_wrong(self) -> bool:
        return bool(self.names) and self.best_misfit < CLEARLY * self.misfit


def best_orientation(
    centroids_mm: list[FloatArray], design_mm: list[FloatArray], centres_mm: list[float]
) -> Orientation:
    """The orientation in which the centroids x, y [rows, columns] fit the design's best.

    All eight orientations of the image, both directions of both scans, and both scans exchanged are tried. A common
    offset of all centroids counts for nothing: a tilted mirror makes one. centres_mm: of the scans, about which a
    reversed scan turns.
    """
    found: list[tuple[float, int, str]] = []
    for (name, change), exchanged in itertools.product(IMAGES.items(), (False, True)):
        x, y = (change(c - centre) for c, centre in zip(centroids_mm, centres_mm, strict=True))
        if x.shape != design_mm[0].shape:
            continue
        if exchanged:
            x, y = y, x
        for sign_x, sign_y in itertools.product((1, -1), repeat=2):
            words = [name] if name else []
            words += ["the scans exchanged"] if exchanged else []
            words += [f"the {axis} scan reversed" for axis, sign in (("x", sign_x), ("y", sign_y)) if sign < 0]
            found.append((_misfit(sign_x * x, sign_y * y, design_mm), len(words), " and ".join(words)))
    here = found[0][0]
    best = min(found)[0]
    if not np.isfinite(best) or here <= best + SIMILAR:
        return Orientation(here, best, ())
    similar = sorted((count, misfit, words) for misfit, count, words in found if misfit <= best + SIMILAR)
    simplest = [words for count, _, words in similar if count == similar[0][0]]
    return Orientation(here, best, tuple(simplest[:MAX_NAMES]))


def _misfit(x: FloatArray, y: FloatArray, design_mm: list[FloatArray]) -> float:
    known = np.isfinite(x + y + design_mm[0] + design_mm[1])
    if np.count_nonzero(known) < 4:
        return np.inf
    left = sum(np.var((own - design)[known]) for own, design in zip((x, y), design_mm, strict=True))
    whole = sum(np.var(design[known]) for design in design_mm)
    return float(left / whole) if whole > 0 else np.inf
