"""Checks of the frames of a fringe measurement one by one: each that is wrong is named, with what to do."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.frame_survey import FrameSurvey
from irtscots_cl.measurement.fringe_factors import BRIGHTNESS, LIGHT, MOTION, OTHER, FrameChange, FrameFactors
from irtscots_cl.measurement.fringe_frames import ShownFrames
from irtscots_cl.measurement.quality import ERROR, OK, WARNING, Check

GAIN = 0.02  # a frame whose brightness differs by more from the others of its series is named
SHOWN = 6  # frames in a message
FLAT = 0.3  # contrast over that of the other images, below which an image shows nothing
REFERENCE = 0.1  # share of the pixels that the fringes are outside of dark and white in
AT_ZERO = 0.01  # share of a frame's samples that may be 0
MOVED = 0.3  # pixels of motion beyond which the images are refused
RESIDUAL = 0.02  # of the mean light: residuals of another cause than noise that are named
FALSE_ALARM = 1e-6
BROKEN = 0.05  # the same, where all frames from one on differ: refused

Name = Callable[[int], str]


def check_frame_values(survey: FrameSurvey, name: Name) -> list[Check]:
    """Copies of frames. name: of a frame in messages, by its number."""
    if not survey.copies:
        return [Check("copies", OK, 0.0, 0.0, 0.0, "no two images are the same")]
    told = "; ".join(f"{name(b)} is the same image as {name(a)}" for a, b in survey.copies[:4])
    more = f"; and {len(survey.copies) - 4} more" if len(survey.copies) > 4 else ""
    text = f"{told}{more}: a frame is missing; record it again"
    return [Check("copies", ERROR, float(len(survey.copies)), 0.0, 0.0, text)]


def check_frames(shown: ShownFrames, name: Name, what: Name) -> Check:
    """name: of an image by its number; what: a frame shows."""
    wrong, foreign = shown.wrong, shown.foreign
    if not wrong.size and not foreign.size:
        return Check("frames", OK, 0.0, 0.0, 1e-9, "every image shows its own frame")
    told = [f"{name(int(k))} shows {what(int(shown.shows[k]))}, not {what(int(k))}" for k in wrong]
    for k in foreign:
        seen = "an even picture" if shown.contrast[k] < FLAT else "another picture"
        told.append(f"{name(int(k))} shows {seen}, not {what(int(k))}")
    more = f"; and {len(told) - SHOWN} more" if len(told) > SHOWN else ""
    mend = "record again what is missing" if foreign.size else "mend their order, or record again what is missing"
    text = f"{'; '.join(told[:SHOWN])}{more}: {mend}"
    return Check("frames", ERROR, float(len(told)), 0.0, 1e-9, text)


def check_references(dark_mean: float, white_mean: float, factors: FrameFactors, dark: str, white: str) -> Check:
    """The dark and the white image against each other and the fringes. dark, white: their names; means: of all pixels,
    NaN where there is none."""
    if white_mean < dark_mean:
        text = f"dark {dark} is brighter than white {white}: exchanged, or wrong in the manifest"
        return Check("dark and white", ERROR, dark_mean - white_mean, 0.0, FALSE_ALARM, text)
    share, which = max((factors.white, "white"), (factors.dark, "dark"))
    if share <= REFERENCE:
        return Check("dark and white", OK, share, REFERENCE, FALSE_ALARM, "the fringes lie between dark and white")
    how = f"white {white} is darker" if which == "white" else f"dark {dark} is brighter"
    text = f"{how} than the fringes in {share:.0%} of the pixels: it shows something else; record it again"
    return Check("dark and white", ERROR, share, REFERENCE, FALSE_ALARM, text)


def check_brightness(factors: FrameFactors, series: list[int], name: Name) -> Check:
    """Brightness of the frames within their series, which moves phases. series: numbers of frames."""
    ends = np.cumsum([0, *series])
    within = np.concatenate([
        factors.gains[a:b] / np.median(factors.gains[a:b]) for a, b in pairwise(ends)
    ])  # fmt: skip
    off: FloatArray = np.abs(within - 1)
    largest = float(off.max())
    error = float(factors.gain_error.max())
    known = f"known to {error:.1g}" if error < GAIN else f"known only to {error:.1g}: too few pixels or series tell"
    if factors.undecided:
        text = (
            "the frames differ in brightness, but too few pixels or series tell by how much: "
            f"known only to {error:.1g}, not divided out; keep screen and exposure steady, or take more steps"
        )
        return Check("brightness", WARNING, largest, GAIN, FALSE_ALARM, text)
    if largest <= GAIN:
        done = f"differ by up to {largest:.2%}, which is divided out" if factors.divided else "are equally bright"
        level = OK if error < GAIN else WARNING
        text = f"the frames of a series {done}; {known}"
        if level == WARNING:
            text += "; 1 % of flicker would go unseen into the phases, up to 0.01 rad"
        return Check("brightness", level, largest, GAIN, FALSE_ALARM, text)
    worst = [int(k) for k in np.argsort(-off)[:3] if off[k] > GAIN]
    told = ", ".join(f"{name(k)} {within[k]:.3g} times" for k in worst)
    text = f"{told} as bright as its series; divided out, {known}: exposure or screen varied"
    return Check("brightness", WARNING, largest, GAIN, FALSE_ALARM, text)


def check_changes(factors: FrameFactors, name: Name) -> list[Check]:
    """Light that was added, motion, and frames that do not go with the others."""
    found = {one.kind: one for one in factors.changes if one.kind != BRIGHTNESS}
    if not found:
        value = float(np.nan_to_num(factors.residual))
        if value <= RESIDUAL:
            text = "one light and one place of the camera explain all frames"
            return [Check("changes", OK, value, RESIDUAL, FALSE_ALARM, text)]
        text = (
            f"the frames differ by {value:.1%} of their light from fringes, more than by noise: several things changed "
            "while they were recorded; record them again"
        )
        return [Check("changes", WARNING, value, RESIDUAL, FALSE_ALARM, text)]
    return [_change(one, factors, name) for one in found.values()]


def _change(one: FrameChange, factors: FrameFactors, name: Name) -> Check:
    numbers = sorted({one.first, *one.ties})
    who = "all images, each in its own way," if one.first < 0 else " or ".join(name(k) for k in numbers[:3])
    since = f"from {who} on" if one.stays else f"in {who}"
    if one.kind == LIGHT:
        text = f"{since} light is added, up to {one.size:.1%} of the screen's: a lamp or daylight; record in the dark"
        return Check(LIGHT, WARNING, one.size, 0.0, FALSE_ALARM, text)
    if one.kind == MOTION:
        text = f"{since} the mirror's image lies {one.size:.2g} pixels off: camera or mirror moved; record again"
        return Check(MOTION, ERROR if one.size > MOVED else WARNING, one.size, MOVED, FALSE_ALARM, text)
    assert one.kind == OTHER
    if one.stays:
        text = f"{since} the images do not go with those before: something moved or changed; record again"
        level = ERROR if factors.residual > BROKEN else WARNING
        return Check("changes", level, factors.residual, BROKEN, FALSE_ALARM, text)
    text = f"{who} does not go with the others: something in the way, or part of the image lost; record it again"
    return Check("changes", WARNING, factors.residual, RESIDUAL, FALSE_ALARM, text)


def check_black(factors: FrameFactors, name: Name) -> Check:
    """Samples of whole numbers that are cut off at 0."""
    worst = int(np.argmax(factors.at_zero))
    share = float(factors.at_zero[worst])
    if share <= AT_ZERO:
        return Check("black level", OK, share, AT_ZERO, FALSE_ALARM, "dark fringes are not cut off at 0")
    text = (
        f"{share:.1%} of the samples of {name(worst)} are cut off at 0, which moves phases: raise the camera's black "
        "level, or do not subtract dark images before"
    )
    return Check("black level", WARNING, share, AT_ZERO, FALSE_ALARM, text)
