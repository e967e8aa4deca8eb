"""Whether a camera's calibration frames, exposures and bad pixels can be those of its images."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from irtscots_cl.imaging.lab_frames import FADES_FROM, LabFrames, MeanFrame
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.quality import ERROR, OK, WARNING, Check

FEW_FRAMES = 8  # that are looked at
BLOCKS = 8  # along each side of an image: means over them have little noise
SURE = 4.0  # standard errors of a block's mean
NEGATIVE = (0.02, 0.2)  # light below zero, over the brightest light: warning, error
UNEQUAL = 0.02  # of the brightest light: how far dark or bias frames may lie apart
BAD = 0.05  # share of the pixels
CLIPPED = 0.01  # share of the flat frames' pixels
CHANGED = (0.05, 0.2)  # of the brightest light: difference between images of one frame: warning, error
RATIO = (0.03, 0.2)  # relative difference of the images' brightness from what their exposures say: warning, error
LEAST_CONTRAST = 10.0  # counts, between bright and dark parts, that a ratio of exposures is found from


def camera_checks(lab: LabFrames, name: Callable[[str, int], str]) -> list[Check]:
    """All checks. name: of a calibration frame in messages, by the kind and its number."""
    low, high = light_range(lab)
    checks = [check_dark(low, high)] if lab.calibration.dark is not None or lab.calibration.bias is not None else []
    checks += check_levels(lab.calibration.means, high, name)
    checks += check_flat(lab.calibration.means.get("flat"))
    if lab.calibration.bad is not None:
        checks.append(check_bad(lab.calibration.bad, lab.calibration.dead))
    return checks + check_repeats(lab, high) + check_exposures(lab)


def some_frames(lab: LabFrames) -> list[int]:
    """Numbers of a few frames, spread over all."""
    return sorted({round(k) for k in np.linspace(0, len(lab) - 1, FEW_FRAMES)})


def light_range(lab: LabFrames) -> tuple[float, float]:
    """Of the mean of a few frames: the least mean light of a block of pixels, with the most that noise may take off it,
    and the brightest parts' light."""
    total, count = np.zeros(lab.shape), np.zeros(lab.shape)
    for k in some_frames(lab):
        values = lab[k]
        known = np.isfinite(values)
        total[known] += values[known]
        count += known
    light = np.full(lab.shape, np.nan)
    np.divide(total, count, out=light, where=count > 0)
    means = block_means(light)
    if not np.isfinite(means).any():
        return math.nan, math.nan
    steps = np.abs(np.diff(light, axis=1))
    noise = float(np.nanmedian(steps)) / 0.954 if np.isfinite(steps).any() else 0.0  # of a normal difference
    error = noise / math.sqrt(max(1.0, light.size / len(means)))
    return float(np.nanmin(means)) + SURE * error, float(np.nanpercentile(light, 99))


def block_means(image: FloatArray) -> FloatArray:
    """Means [blocks] of an image's blocks; NaN for those of which half is unknown."""
    rows, columns = (min(BLOCKS, n) for n in image.shape)
    blocks = [b for band in np.array_split(image, rows) for b in np.array_split(band, columns, axis=1)]
    return np.array([np.nanmean(b) if np.isfinite(b).sum() * 2 > b.size else math.nan for b in blocks])


def check_dark(low: float, high: float) -> Check:
    """Whether the images are brighter than the dark frames. low, high: see light_range."""
    value = -low / max(high, 1e-9) if low < 0 else 0.0
    if not value > NEGATIVE[0]:
        return Check("dark", OK, value, NEGATIVE[0], 1e-6, "no part of the images is darker than the dark frames")
    level = ERROR if value > NEGATIVE[1] else WARNING
    text = (
        f"parts of the images are {-low:.3g} counts darker than the dark or bias frames, the brightest {high:.3g} "
        "counts above them: other exposure or gain, light on the dark frames, or the files are swapped"
    )
    return Check("dark", level, value, NEGATIVE[LEVEL_LIMIT[level]], 1e-6, text)


LEVEL_LIMIT = {WARNING: 0, ERROR: 1}


def check_levels(means: Mapping[str, MeanFrame], high: float, name: Callable[[str, int], str]) -> list[Check]:
    """Whether the dark and bias frames are alike among themselves."""
    checks = []
    for kind in ("bias", "dark", "flat dark"):
        if kind not in means or means[kind].count < 2:
            continue
        levels = np.asarray(means[kind].levels)
        off = np.abs(levels - np.median(levels))
        worst = int(np.argmax(off))
        value = float(off[worst] / max(high, 1e-9))
        if value > UNEQUAL:
            text = (
                f"{name(kind, worst)} has {levels[worst]:.4g} counts in the mean, the {kind} frames' median "
                f"{np.median(levels):.4g}: light, or another exposure"
            )
            checks.append(Check(f"{kind} frames", WARNING, value, UNEQUAL, 1e-6, text))
    return checks


def check_flat(flat: MeanFrame | None) -> list[Check]:
    """Whether the flat frames are saturated in parts."""
    if flat is None:
        return []
    share = float(flat.saturated.mean())
    if share <= CLIPPED:
        return [Check("flat", OK, share, CLIPPED, 1e-6, f"{share:.1%} of the flat frames' pixels are saturated")]
    text = f"{share:.1%} of the flat frames' pixels are saturated: taken as bad; expose the flat frames less"
    return [Check("flat", WARNING, share, CLIPPED, 1e-6, text)]


def check_bad(bad: BoolArray, dead: BoolArray | None) -> Check:
    """Whether few pixels are bad. dead: those of them that only the flat frames show."""
    share, count = float(bad.mean()), int(bad.sum())
    by_flat = 0 if dead is None else int(dead.sum())
    text = f"{count} bad pixels ({share:.2%})" + (f", {by_flat} of them by the flat frames" if by_flat else "")
    if share <= BAD:
        return Check("bad pixels", OK, share, BAD, 1e-6, text)
    return Check("bad pixels", WARNING, share, BAD, 1e-6, f"{text}: a camera has few; is the map the right one?")


def check_repeats(lab: LabFrames, high: float) -> list[Check]:
    """Whether images of equal exposure that make one frame are alike. high: see light_range."""
    worst, names = 0.0, ("", "")
    for number in some_frames(lab):
        recorded = dict(zip(lab.recorded(number), lab.exposures_s, strict=True))
        for time in set(recorded.values()):
            first, *others = (k for k, own in recorded.items() if own == time)
            expected = block_means(np.asarray(lab.frames[first], float)) if others else np.zeros(0)
            for other in others:
                off = float(np.nanmax(np.abs(block_means(np.asarray(lab.frames[other], float)) - expected)))
                if off > worst:
                    worst, names = off, (lab.recorded_name(other), lab.recorded_name(first))
    value = worst / max(high, 1e-9)
    if len(lab.exposures_s) == len(set(lab.exposures_s)):
        return []
    if value <= CHANGED[0]:
        return [Check("repeats", OK, value, CHANGED[0], 1e-6, "the images of a frame are alike")]
    text = (
        f"{names[0]} and {names[1]}, of the same frame, differ by {worst:.3g} counts of {high:.3g} at most: "
        'another order ("together", "in turn"), other frames than the manifest\'s, or light that changed'
    )
    level = ERROR if value > CHANGED[1] else WARNING
    return [Check("repeats", level, value, CHANGED[LEVEL_LIMIT[level]], 1e-6, text)]


def check_exposures(lab: LabFrames) -> list[Check]:
    """Whether images of several exposures are as bright as these say."""
    checks = []
    times = [time for time in lab.exposures_s if time is not None]
    for time in sorted(set(times) - {min(times, default=0.0)}):
        told = time / min(times)
        ratio = _brightness_ratio(lab, min(times), time)
        what = f"images of {time:g} s are {ratio:.4g} times as bright as those of {min(times):g} s"
        if not math.isfinite(ratio):
            text = f"images of {time:g} s and {min(times):g} s share too little contrast to compare them"
            checks.append(Check("exposures", WARNING, math.nan, RATIO[0], 0.0, text))
            continue
        off = abs(ratio / told - 1)
        if off <= RATIO[0]:
            checks.append(Check("exposures", OK, off, RATIO[0], 1e-6, f"{what}, the times say {told:.4g}"))
            continue
        level = ERROR if off > RATIO[1] else WARNING
        text = (
            f"{what}, the times say {told:.4g}: exposures_s in another order, another order of the images "
            '("together", "in turn"), a shutter\'s delay, or a camera that is not linear'
        )
        checks.append(Check("exposures", level, off, RATIO[LEVEL_LIMIT[level]], 1e-6, text))
    return checks


def _brightness_ratio(lab: LabFrames, short: float, long: float) -> float:
    """Brightness at one exposure over that at another: from the difference of bright and dark samples, so that no
    offset counts. NaN where they have too little contrast."""
    sums = np.zeros((2, 3))  # dark, bright samples; number, counts at the short and at the long exposure
    for number in some_frames(lab):
        recorded = dict(zip(lab.recorded(number), lab.exposures_s, strict=True))
        images = [
            np.mean([np.asarray(lab.frames[k], float) for k, own in recorded.items() if own == time], axis=0)
            for time in (short, long)
        ]
        use = np.isfinite(images[0] + images[1]) & (images[1] < FADES_FROM * lab.saturation)
        use &= images[0] < FADES_FROM * lab.saturation
        if lab.calibration.bad is not None:
            use &= ~lab.calibration.bad
        if use.any():
            sums += _halves(images[0][use], images[1][use])
    if (sums[:, 0] == 0).any():
        return math.nan
    means = sums[:, 1:] / sums[:, :1]
    contrast = means[1] - means[0]
    return float(contrast[1] / contrast[0]) if contrast[0] > 0 and contrast[1] > LEAST_CONTRAST else math.nan


def _halves(short: FloatArray, long: FloatArray) -> FloatArray:
    """Number and sums of both, [dark, bright] by the long exposure."""
    middle = float(np.mean(np.percentile(long, [2, 98])))
    bright = long > middle
    return np.array([[part.sum(), short[part].sum(), long[part].sum()] for part in (~bright, bright)], float)
