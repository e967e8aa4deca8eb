"""Orientation of images and scans, from the centroids: flipped, turned, reversed or exchanged."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from irtscots_cl.imaging.orientation import CHANGES, UNDONE_BY
from irtscots_cl.maths.arrays import FloatArray

CLEARLY = 0.5  # of the misfit as recorded: another orientation that leaves less is the right one
SIMILAR = 0.01  # misfit beyond the least: orientations that a symmetric set-up cannot tell apart
MAX_NAMES = 3

# Name of a change of the image: what undoes it. Applied to maps [rows, columns].
IMAGES = {CHANGES[word]: undo for word, undo in UNDONE_BY.items()}


@dataclass(frozen=True)
class Orientation:
    """misfit: mean square difference of the centroids from the design, relative to the design's own variation, as
    recorded; best_misfit: in the best orientation. names: of the simplest best ones; empty for the recorded one.
    images: of each name, the change of the image in it, a word of scene.instrument.ORIENTATIONS. alike: names of the
    simplest others that fit as well as what is named, or as the recorded one: a symmetric set-up does not tell.
    """

    misfit: float
    best_misfit: float
    names: tuple[str, ...]
    images: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()

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
    found: list[tuple[float, int, str, str]] = []
    for (image, change), exchanged in itertools.product(UNDONE_BY.items(), (False, True)):
        x, y = (change(c - centre) for c, centre in zip(centroids_mm, centres_mm, strict=True))
        if x.shape != design_mm[0].shape:
            continue
        if exchanged:
            x, y = y, x
        for sign_x, sign_y in itertools.product((1, -1), repeat=2):
            words = [CHANGES[image]] if CHANGES[image] else []
            words += ["the scans exchanged"] if exchanged else []
            words += [f"the {axis} scan reversed" for axis, sign in (("x", sign_x), ("y", sign_y)) if sign < 0]
            found.append((_misfit(sign_x * x, sign_y * y, design_mm), len(words), " and ".join(words), image))
    here = found[0][0]
    best = min(found)[0]
    if not np.isfinite(best):
        return Orientation(here, best, ())
    similar = sorted((count, misfit, words, image) for misfit, count, words, image in found if misfit <= best + SIMILAR)
    if here <= best + SIMILAR:
        return Orientation(here, best, (), (), tuple(words for count, _, words, _ in similar if count))
    simplest = [entry[2:] for entry in similar if entry[0] == similar[0][0]][:MAX_NAMES]
    alike = [words for _, _, words, _ in similar if words not in {name for name, _ in simplest}]
    return Orientation(here, best, *zip(*simplest, strict=True), tuple(alike))


def _misfit(x: FloatArray, y: FloatArray, design_mm: list[FloatArray]) -> float:
    known = np.isfinite(x + y + design_mm[0] + design_mm[1])
    if np.count_nonzero(known) < 4:
        return np.inf
    left = sum(np.var((own - design)[known]) for own, design in zip((x, y), design_mm, strict=True))
    whole = sum(np.var(design[known]) for design in design_mm)
    return float(left / whole) if whole > 0 else np.inf
