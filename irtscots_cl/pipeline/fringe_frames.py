"""Places by fringes from frames of unequal brightness: it is divided out, and what else the frames show is checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from irtscots_cl.imaging.fringe_images import FringeImages
from irtscots_cl.imaging.fringe_manifest import DARK, GRAY, WHITE
from irtscots_cl.imaging.fringes import FringeStack
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.colour_mosaic import check_mosaic
from irtscots_cl.measurement.fringe_factors import (
    BRIGHTNESS,
    EQUAL_FRAMES,
    FrameFactors,
    frame_factors,
    without_gains,
)
from irtscots_cl.measurement.fringe_frame_checks import (
    check_black,
    check_brightness,
    check_changes,
    check_frames,
    check_references,
)
from irtscots_cl.measurement.fringe_frames import ShownFrames, frames_shown
from irtscots_cl.measurement.fringe_quality import check_noise
from irtscots_cl.measurement.quality import Check
from irtscots_cl.measurement.screen_coordinates import ScreenCoordinates, screen_coordinates
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.lab_camera import RecordedImages
from irtscots_cl.pipeline.measure import refuse_bad
from irtscots_cl.system import interruption

Prior = dict[str, tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class PlacesByFrames:
    """stack: with the frames' brightness divided out. found: the places. shown: what the images show. factors: of the
    frames. coded: whether a Gray code tells the orders."""

    stack: FringeStack
    found: ScreenCoordinates
    shown: ShownFrames
    factors: FrameFactors
    coded: bool
    checks: list[Check]


def check_light_and_dark(images: FringeImages, stack: FringeStack) -> list[Check]:
    """Checks of the dark and white images by their values alone."""
    checks = []
    if stack.white is not None:
        checks.append(check_mosaic(stack.white - (0.0 if stack.dark is None else stack.dark)))
    dark, white = _means(stack)
    if white < dark:
        checks.append(check_references(dark, white, EQUAL_FRAMES, images.names_of(DARK), images.names_of(WHITE)))
    return checks


def places_by_frames(
    recorded: RecordedImages,
    stack: FringeStack,
    design: dict[str, FloatArray],
    prior: Prior,
    masks: dict[str, Any],
    setup: Setup,
    strict: bool,
) -> PlacesByFrames:
    """Places, what the images show, and the checks of the frames.

    The frames' brightness is divided out where they tell it. masks: the pixels that are "lit" and those to "use". All
    maps are of the images as stored. Raises RefusedImagesError.
    """
    images, lit, use = recorded.images, masks["lit"], masks["use"]
    factors = frame_factors(stack, lit)
    checks = [check_references(*_means(stack), factors, images.names_of(DARK), images.names_of(WHITE))]
    refuse_bad(checks, strict)
    equal = without_gains(stack, factors.gains) if factors.divided else stack
    mask = lit if use is None else lit & use
    found = screen_coordinates(equal, mask=mask, prior=prior)
    taken = _other_steps(stack, found)
    if taken and not factors.divided:  # what looked like other frames may be other steps
        factors = frame_factors(stack, lit, taken)
        if factors.divided:
            equal = without_gains(stack, factors.gains)
            found = screen_coordinates(equal, mask=mask, prior=prior)
    interruption.check()
    coded = bool(images.manifest.numbers(GRAY))
    if coded:
        from irtscots_cl.pipeline.gray_orders import gray_orders  # few fringes come with a Gray code

        found, more = gray_orders(recorded, found, setup)
        checks += more
        refuse_bad(checks, strict)
    shown = frames_shown(equal, found, design)
    frames, name = images.manifest.frames, images.name_in_stack
    checks.append(check_frames(shown, name, lambda k: frames[images.of_stack(k)].text))
    refuse_bad(checks, strict)
    series = [len(steps) for one in stack.sets for steps in one.steps_rad]
    checks += [check_brightness(factors, series, name), *check_changes(factors, name), check_black(factors, name)]
    same = all(one.kind == BRIGHTNESS for one in factors.changes)  # else what changed looks like noise
    checks.append(check_noise(factors.transfer if same else None))
    return PlacesByFrames(equal, found, shown, factors, coded, checks)


def _means(stack: FringeStack) -> tuple[float, float]:
    """Of the dark and of the white images; NaN without."""
    dark, white = (math.nan if one is None else float(np.nanmean(one)) for one in (stack.dark, stack.white))
    return dark, white


def _other_steps(stack: FringeStack, found: ScreenCoordinates) -> list[FloatArray]:
    """The steps of all series, if they are not those said; else none."""
    said = [np.asarray(steps) for one in stack.sets for steps in one.steps_rad]
    taken = [np.asarray(steps) for one in stack.sets for steps in found.axes[one.axis].survey.steps_rad]
    return [] if all(np.array_equal(a, b) for a, b in zip(said, taken, strict=True)) else taken
