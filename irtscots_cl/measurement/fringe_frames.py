"""Which frame of a fringe measurement each image really shows: swapped, repeated, or of another series.

Every image is compared with what each frame should look like where its pixels see the screen. For the places several
answers are tried, since a wrong frame spoils the places that it takes part in: of the design, of all series, and
of each series alone; the one that explains most images counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from irtscots_cl.imaging.fringes import FringeSet, FringeStack
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates, ScreenCoordinates

SAMPLE = 4000  # pixels
FITS = 0.25  # another frame is shown where it leaves at most this part of what the own one leaves unexplained
UNEXPLAINED = 0.05  # of an image's variance, below which nothing is asked
FOREIGN = 0.3  # of an image's variance, above which it is no frame of fringes, if others are much better
TIMES = 4.0  # the median of all images
LEAST_PIXELS = 30  # without saturated samples, for a judgement


@dataclass(frozen=True)
class ShownFrames:
    """Of N images: shows, the frame that each shows, its own unless another one is clearly better; unexplained, the
    share of its variance that its own frame leaves, NaN where too few samples are left; contrast, the image's own over
    that of the median image; saturated, the share of samples that are no measurement."""

    shows: IntArray
    unexplained: FloatArray
    contrast: FloatArray
    saturated: FloatArray

    @property
    def wrong(self) -> IntArray:
        """Numbers of the images that show another frame."""
        return np.flatnonzero(self.shows != np.arange(len(self.shows)))

    @property
    def foreign(self) -> IntArray:
        """Numbers of the images that show no frame of fringes at all, while most others show theirs."""
        known = np.isfinite(self.unexplained)
        typical = float(np.median(self.unexplained[known])) if known.any() else 1.0
        with np.errstate(invalid="ignore"):
            none = self.unexplained > max(FOREIGN, TIMES * typical)
        return np.flatnonzero(none & (self.shows == np.arange(len(self.shows))))


def frames_shown(
    stack: FringeStack, found: ScreenCoordinates, design: Mapping[str, FloatArray] | None = None
) -> ShownFrames:
    """What the images of a stack show. design: by axis, fractions [rows, columns] that the design's pixels see."""
    pixels = np.flatnonzero(found.mask)
    pixels = pixels[:: max(1, len(pixels) // SAMPLE)]
    images = np.stack([_relative(image, stack, pixels) for image in _images(stack)])
    templates, start = [], 0
    for one in stack.sets:
        own = images[start : start + one.count]
        tried = [
            _templates(one, found.axes[one.axis], place) for place in _places(found.axes[one.axis], pixels, design)
        ]
        templates.append(most_alike(own, tried))
        start += one.count
    return matched(images, np.concatenate(templates))


def matched(images: FloatArray, frames: FloatArray) -> ShownFrames:
    """Which frame each image shows. images: [N, n] samples, NaN where unknown. frames: [N, n] what each should show."""
    known = np.isfinite(images)
    alike = np.stack([_correlations(image, of, frames) for image, of in zip(images, known, strict=True)])
    enough = known.sum(1) >= LEAST_PIXELS
    own = np.diagonal(alike)
    best = np.argmax(alike, axis=1)
    left, least = 1 - own**2, 1 - np.maximum(alike.max(axis=1), 0.0) ** 2
    left = np.where(own > 0, left, 1.0)
    other = (left > UNEXPLAINED) & (least < FITS * left) & enough
    spread = np.array([np.std(image[of]) if of.any() else np.nan for image, of in zip(images, known, strict=True)])
    middle = float(np.nanmedian(spread)) if np.isfinite(spread).any() else 1.0
    return ShownFrames(
        np.where(other, best, np.arange(len(images))),
        np.where(enough, left, np.nan),
        spread / max(middle, 1e-300),
        1 - known.mean(1),
    )


def _correlations(image: FloatArray, known: BoolArray, frames: FloatArray) -> FloatArray:
    """Of an image's known samples [n] with frames [N, n]: [N]; 0 where too few are known."""
    shown = frames[:, known]
    if shown.shape[1] < LEAST_PIXELS:
        return np.zeros(len(frames))
    there = np.isfinite(shown).all(0)
    centred, values = shown[:, there], image[known][there]
    centred = centred - centred.mean(1, keepdims=True)
    values = values - values.mean()
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = centred @ values / (np.linalg.norm(centred, axis=1) * np.linalg.norm(values))
    found: FloatArray = np.nan_to_num(alike)
    return found


def most_alike(images: FloatArray, tried: Sequence[FloatArray]) -> FloatArray:
    """Of several sets of frames [N, n] that in which most images [N, n] are alike to their own."""

    def fits(frames: FloatArray) -> int:
        own = [
            _correlations(image, np.isfinite(image), frame[None])[0]
            for image, frame in zip(images, frames, strict=True)
        ]
        return int(np.sum(np.array(own) > 0.9))

    return max(tried, key=fits)


def _images(stack: FringeStack) -> Iterator[FloatArray]:
    for number in range(len(stack.sets)):
        for _, _, images in stack.series(number):
            yield from (np.asarray(image, float) for image in images)


def _relative(image: FloatArray, stack: FringeStack, pixels: IntArray) -> FloatArray:
    """Samples [n] over the light of the white screen where that is known; NaN where saturated or no number."""
    values = image.ravel()[pixels]
    values = np.where(values < stack.saturation, values, np.nan)
    if stack.white is None:
        return values
    dark = 0.0 if stack.dark is None else np.asarray(stack.dark, float).ravel()[pixels]
    light = np.asarray(stack.white, float).ravel()[pixels] - dark
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(light > 0, (values - dark) / light, np.nan)


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
    """What the frames of a set look like in pixels at these places [n]: [frames, n]."""
    at = 1 - place if fringes.reverse else place
    rows = [
        np.cos(2 * np.pi * periods * at - one.survey.sign * np.asarray(step))
        for periods, steps in zip(fringes.periods, one.survey.steps_rad, strict=True)
        for step in steps
    ]
    return np.stack(rows)
