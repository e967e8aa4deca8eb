"""Which frame of a fringe measurement each image really shows: swapped, repeated, or of another series.

Every image is compared with what each frame should look like where its pixels see the screen. For the places several
answers are tried, since a wrong frame spoils the places that it takes part in: of the design, of all series, and
of each series alone; the one that explains most images counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from irtscots_cl.imaging.fringes import FringeSet, FringeStack
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates, ScreenCoordinates

SAMPLE = 4000  # pixels
FITS = 0.25  # another frame is shown where it leaves at most this part of what the own one leaves unexplained
UNEXPLAINED = 0.05  # of an image's variance, below which nothing is asked


@dataclass(frozen=True)
class ShownFrames:
    """Of N images: shows, the frame that each shows, its own unless another one is clearly better; unexplained, the
    share of its variance that its own frame leaves."""

    shows: IntArray
    unexplained: FloatArray

    @property
    def wrong(self) -> IntArray:
        """Numbers of the images that show another frame."""
        return np.flatnonzero(self.shows != np.arange(len(self.shows)))


def frames_shown(
    stack: FringeStack, found: ScreenCoordinates, design: Mapping[str, FloatArray] | None = None
) -> ShownFrames:
    """What the images of a stack show. design: by axis, fractions [rows, columns] that the design's pixels see."""
    pixels = np.flatnonzero(found.mask)
    pixels = pixels[:: max(1, len(pixels) // SAMPLE)]
    shown = [_relative(image, stack, pixels) for image in _images(stack)]
    images = np.stack([standard(image) for image in shown])
    templates, start = [], 0
    for one in stack.sets:
        own = images[start : start + one.count]
        tried = (
            _templates(one, found.axes[one.axis], place) for place in _places(found.axes[one.axis], pixels, design)
        )
        templates.append(max(tried, key=lambda made: float(np.nansum(np.sum(own * made, axis=1) > 0.9))))
        start += one.count
    return matched(images, np.concatenate(templates))


def matched(images: FloatArray, templates: FloatArray) -> ShownFrames:
    """Which template each image shows. Both [frames, n], as `standard` makes them."""
    alike = images @ templates.T  # correlations [images, frames]
    own = np.diagonal(alike)
    best = np.argmax(alike, axis=1)
    left, least = 1 - own**2, 1 - np.maximum(alike.max(axis=1), 0.0) ** 2
    left = np.where(own > 0, left, 1.0)
    other = (left > UNEXPLAINED) & (least < FITS * left)
    return ShownFrames(np.where(other, best, np.arange(len(images))), left)


def _images(stack: FringeStack) -> Iterator[FloatArray]:
    for number in range(len(stack.sets)):
        for _, _, images in stack.series(number):
            yield from (np.asarray(image, float) for image in images)


def _relative(image: FloatArray, stack: FringeStack, pixels: IntArray) -> FloatArray:
    """Samples [n] over the light of the white screen where that is known."""
    values = image.ravel()[pixels]
    if stack.white is None:
        return values
    dark = 0.0 if stack.dark is None else np.asarray(stack.dark, float).ravel()[pixels]
    light = np.asarray(stack.white, float).ravel()[pixels] - dark
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(light > 0, (values - dark) / light, np.nan)


def standard(values: FloatArray) -> FloatArray:
    """Values without their mean, of length 1; 0 where unknown."""
    known = np.isfinite(values)
    centred = np.where(known, values - (values[known].mean() if known.any() else 0.0), 0.0)
    length = np.linalg.norm(centred)
    return centred / length if length > 0 else centred


def _places(one: AxisCoordinates, pixels: IntArray, design: Mapping[str, FloatArray] | None) -> Iterator[FloatArray]:
    """Fractions [n] to try."""
    if design is not None:
        yield design[one.fringes.axis].ravel()[pixels]
    yield one.fraction.ravel()[pixels]
    near = one.fraction if design is None else design[one.fringes.axis]
    start = near.ravel()[pixels]
    for k, periods in enumerate(one.fringes.periods):
        turns = one.phase_rad[k].ravel()[pixels] / (2 * np.pi)
        place = 1 - start if one.fringes.reverse else start
        gap = turns - periods * place
        place = place + (gap - np.rint(gap)) / periods
        yield 1 - place if one.fringes.reverse else place


def _templates(fringes: FringeSet, one: AxisCoordinates, place: FloatArray) -> FloatArray:
    """What the frames of a set look like in pixels at these places [n]: [frames, n], each without mean, of length 1."""
    at = 1 - place if fringes.reverse else place
    rows = [
        standard(np.cos(2 * np.pi * periods * at - one.survey.sign * np.asarray(step)))
        for periods, steps in zip(fringes.periods, one.survey.steps_rad, strict=True)
        for step in steps
    ]
    return np.stack(rows)
