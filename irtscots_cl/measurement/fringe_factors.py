"""What changed between the frames of a fringe measurement: brightness, added light, the camera's place.

A pixel's samples are offset + cosine cos d + sine sin d in every series, with one offset for all: the screen's mean
light. That leaves of N frames in S series N - 1 - 2 S numbers a pixel, which hold noise, harmonics, and whatever was
not the same in all frames. A frame's change is common to all pixels: m of them tell it to noise / sqrt(m). The changes
are fitted to all pixels together, each pixel's own light eliminated. Since all pixels have the same steps, that needs
the samples' products alone: with R the projector on what the light leaves, M [N, m] the samples' change by each frame's
parameter and Y the samples, the normal equations are R * (M M') and the sums over pixels of M * (R Y).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm
from scipy.stats import f as f_ratio

from irtscots_cl.imaging.fringes import FringeStack
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.fringe_fit import NULL, FrameFit
from irtscots_cl.measurement.fringe_noise import estimate_noise
from irtscots_cl.measurement.fringe_samples import FrameSamples, FringeLight, frame_samples
from irtscots_cl.measurement.photon_transfer import PhotonTransfer, photon_transfer
from irtscots_cl.system import interruption

LEAST_PIXELS = 100  # with all their samples
ROUNDS = 20  # of finding gains, which are no small changes
SETTLED = 1e-5
LIMITS = (0.1, 10.0)  # of a gain
PRIOR = 0.3  # standard deviation of a gain before the images say more: what they do not tell stays at 1
FALSE_ALARM = 1e-6  # chance that equal frames are found to differ
BRIGHTNESS, LIGHT, MOTION, OTHER = "brightness", "light", "motion", "other"
FALSE_GAINS = 1e-4  # the same of gains, which do no harm where they are divided out
OF_ONE = 0.9  # of what gains of all frames explain beyond chance: so much by one frame's gain will do
RIVAL = 30.0  # chi-square by which one frame must explain more than any other
CLEAR = 0.3  # standard error of the gains over the gains' own difference, up to which they are divided out
MODEL_GAIN = 0.001  # standard deviation: what a screen's values in whole numbers may feign
ALONE = 0.1  # of the largest gain's difference: the others' are less where one frame differs
LEAST = {LIGHT: 0.003, MOTION: 0.03}  # parts of the light, pixels: less is not told
MOST = 0.7  # of what noise and harmonics leave, that a change must explain to be believed
OF_SERIES = 0.97  # of what gains of all frames explain: so much by one gain for each series will do
NEARLY = 0.9  # of what changes of all frames explain: so much by one frame, or from one frame on, is the answer
USEFUL = 0.02  # of a sample's noise, that the light of all leaves in its residual
OUTLIER = 10.0  # times the noise's variance: a pixel at an edge
MODEL = 0.003  # of the light: what the screen's values in whole numbers and high harmonics may leave of it
TIE = 0.95  # of what the best frame explains: another one cannot be told from it
EXCESS = 1.3  # mean square of the residuals over that of noise, below which nothing is left to explain


@dataclass(frozen=True)
class FrameChange:
    """What changed. kind: BRIGHTNESS, LIGHT (added to the screen's), MOTION (of the camera) or OTHER. first: number of
    the frame that differs, or, with `stays`, from which on all do; -1 where many differ, each in its own way. size:
    factor of the light; added light over the screen's mean; pixels; of the frame that differs most. explained: part of
    what noise and harmonics leave unexplained. ties: other frames that explain as much. added: of LIGHT, [N] parts of
    the screen's mean light."""

    kind: str
    first: int
    stays: bool
    size: float
    explained: float
    ties: tuple[int, ...] = ()
    added: FloatArray | None = field(default=None, repr=False)


@dataclass(frozen=True)
class FrameFactors:
    """gains: [N] brightness of the frames over their median; gain_error: [N] standard errors, near PRIOR where the
    frames do not tell. changes: what is beyond chance, brightness first. excess: mean square of the residuals over
    that of noise, as recorded and with the gains divided out; NaN where too few pixels tell. residual: rms of what is
    then not noise, over the screen's mean light. at_zero: [N] share of the samples that are 0 in whole numbers. white:
    share of the pixels that are brighter in fringes than in the white image; dark: darker than in the dark one.
    undecided: whether frames differ beyond chance, by gains that are known too badly to divide by. transfer: noise
    against light, from differences of neighbours."""

    gains: FloatArray
    gain_error: FloatArray
    changes: tuple[FrameChange, ...]
    excess: tuple[float, float]
    residual: float
    at_zero: FloatArray = field(repr=False)
    white: float = 0.0
    dark: float = 0.0
    undecided: bool = False
    transfer: PhotonTransfer | None = field(default=None, repr=False)

    @property
    def divided(self) -> bool:
        """Whether the gains are worth dividing by."""
        return bool(np.any(self.gains != 1.0))


EQUAL_FRAMES = FrameFactors(np.ones(1), np.zeros(1), (), (1.0, 1.0), 0.0, np.zeros(1))


def frame_factors(stack: FringeStack, mask: BoolArray, steps_rad: Sequence[FloatArray] | None = None) -> FrameFactors:
    """What changed between the frames of a stack. mask: [rows, columns] that see the mirror.

    steps_rad: of all series of all sets; None: as said. All pixels must have one light in all series.
    """
    said = [np.asarray(s, float) for one in stack.sets for s in one.steps_rad]
    light = FringeLight.of(said if steps_rad is None else list(steps_rad))
    count = len(light.basis)
    samples = frame_samples(stack, mask)
    unknown = FrameFactors(
        gains=np.ones(count),
        gain_error=np.full(count, PRIOR),
        changes=(),
        excess=(math.nan, math.nan),
        residual=math.nan,
        at_zero=samples.at_zero,
        white=samples.white,
        dark=samples.black,
    )
    if light.freedom < 1 or samples.values.shape[1] < LEAST_PIXELS:
        return unknown
    noise = _sigma(light, samples)
    if noise is None:
        return unknown
    sigma, transfer = noise
    gains, error, brightness, undecided, before, after = _believed_gains(light, samples, sigma)
    changes = [] if brightness is None else [brightness]
    if not np.array_equal(gains, np.ones(count)):
        again = _sigma(light, samples.divided(gains))
        transfer = None if again is None else again[1]
    other = _other_change(after, samples, sigma, gains)
    changes += [] if other is None else [other]
    over = max(after.square - after.freedom, 0.0) / after.freedom * float(np.mean(sigma**2))
    return replace(
        unknown,
        gains=gains,
        gain_error=error,
        changes=tuple(changes),
        excess=(before.excess, after.excess),
        residual=math.sqrt(over) / samples.mean_light,
        undecided=undecided,
        transfer=transfer,
    )


def without_gains(stack: FringeStack, gains: FloatArray) -> FringeStack:
    """The stack with its frames divided by gains [N]; samples that are saturated become no numbers."""
    return replace(stack, frames=_DividedFrames(stack, gains), saturation=math.inf)


@dataclass(frozen=True)
class _DividedFrames(Sequence[NDArray[Any]]):
    stack: FringeStack
    gains: FloatArray

    def __len__(self) -> int:
        return len(self.gains)

    @overload
    def __getitem__(self, number: int) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, number: slice) -> list[NDArray[Any]]: ...
    def __getitem__(self, number: int | slice) -> NDArray[Any] | list[NDArray[Any]]:
        if isinstance(number, slice):
            return [self[k] for k in range(*number.indices(len(self)))]
        values = np.asarray(self.stack.frames[number])
        dark = 0.0 if self.stack.dark is None else np.asarray(self.stack.dark, np.float32)
        divided = dark + (values.astype(np.float32) - dark) / np.float32(self.gains[number])
        return np.where(values < self.stack.saturation, divided, np.float32(np.nan))


def _sigma(light: FringeLight, samples: FrameSamples) -> tuple[FloatArray, PhotonTransfer | None] | None:
    """Noise [n] of the samples, from the differences of neighbours: what is smooth over the image is not in it. And
    noise against light."""
    rest = light.rest_noise
    degrees = round(float(np.trace(rest)))
    if degrees < 1:
        return None
    square = 2 * np.square(rest @ samples.along_x)
    freedom = np.full(square.shape[1], float(degrees))
    signal = samples.values.mean(0)
    noise = estimate_noise(square.sum(0), freedom, signal)
    if noise is None:
        return None
    variance = noise.variance(signal)
    if not variance.min() > 0:
        return None
    own = np.diagonal(rest)
    useful = own > USEFUL
    # the variance that a frame's residual has is a mean of those of all frames
    seen = np.square(rest[useful]) @ (light.part(samples.values) - samples.dark) / own[useful, None]
    within = samples.inside & (square.sum(0) < freedom * variance * OUTLIER)
    squares = square[useful] / own[useful, None]
    independent = degrees / max(int(useful.sum()), 1)
    return np.sqrt(variance), photon_transfer(squares[:, within].ravel(), seen[:, within].ravel(), independent)


def _gains(
    light: FringeLight, samples: FrameSamples, sigma: FloatArray, groups: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Gains [N], their median 1, and the covariance [N, N] of their logarithms without what is common to all. groups:
    [N, q] frames with a gain in common."""
    count = len(light.basis)
    gains = np.ones(count)
    for _ in range(ROUNDS):
        interruption.check()
        fit = FrameFit.of(light, samples, sigma, gains)
        normal, scores = fit.by_instrument(samples.divided(gains), sigma)
        normal, scores = groups.T @ normal @ groups, groups.T @ scores
        # by chance directions that are not determined may have the wrong sign
        damping = 1 / PRIOR**2 + 2 * max(0.0, -float(np.linalg.eigvalsh((normal + normal.T) / 2)[0]))
        inner = groups @ np.linalg.inv(normal + damping * np.eye(groups.shape[1]))
        change = np.clip(inner @ scores.sum(1), -0.5, 1.0)
        gains = gains * (1 + change)
        gains = np.clip(gains / np.median(gains), *LIMITS)
        if np.abs(change - change.mean()).max() < SETTLED:
            break
    whole = np.eye(count) - 1 / count  # a common gain is the light's
    # the scores' own scatter, as noise is not the same in bright and dark frames, and what damping keeps of PRIOR
    spread = inner @ (scores @ scores.T + (damping * PRIOR) ** 2 * np.eye(groups.shape[1])) @ inner.T
    return gains, whole @ (spread + MODEL_GAIN**2 * np.eye(count)) @ whole


def _hypotheses(count: int) -> Iterator[tuple[int, bool, FloatArray]]:
    """Frames that differ alike: one, or all from one on. (frame, whether all from it on, [N])."""
    for k in range(count):
        yield k, False, np.eye(count)[k]
    for k in range(1, count):
        yield k, True, np.where(np.arange(count) >= k, 1.0, 0.0)


def _believed_gains(
    light: FringeLight, samples: FrameSamples, sigma: FloatArray
) -> tuple[FloatArray, FloatArray, FrameChange | None, bool, FrameFit, FrameFit]:
    """Gains [N] to divide by, their errors, what they say, whether more differ than can be told, and the fits as
    recorded and with the gains divided out."""
    count = len(light.basis)
    gains, covariance = _gains(light, samples, sigma, np.eye(count))
    before = FrameFit.of(light, samples, sigma, np.ones(count))
    after = FrameFit.of(light, samples, sigma, gains)
    if after.excess > EXCESS:
        # more than brightness has changed, which may look like gains within a series: those would move its phases
        of_series = np.repeat(np.eye(len(light.steps)), np.diff(light.ends), axis=0)
        common, of_common = _gains(light, samples, sigma, of_series)
        instead = FrameFit.of(light, samples, sigma, common)
        if before.square - instead.square > OF_SERIES * (before.square - after.square):
            gains, covariance, after = common, of_common, instead
    error = np.sqrt(np.diagonal(covariance))
    brightness = _brightness(before, after, gains, covariance)
    beyond = _chance(np.log(gains), covariance, samples.values.shape[1]) < FALSE_GAINS
    undecided = brightness is None and beyond and after.excess < EXCESS
    if brightness is None and beyond:
        # beyond chance, but known badly if each frame may have its own: does one frame explain it?
        alone = _one_frame(before, samples, sigma)
        if alone is not None:
            one, of_one = _gains(light, samples, sigma, np.eye(count)[:, [alone]])
            instead = FrameFit.of(light, samples, sigma, one)
            if before.square - instead.square > OF_ONE * (before.square - after.square - light.freedom):
                gains, after = one, instead
                brightness = _brightness(before, after, gains, of_one)
                undecided = brightness is None and undecided
    if brightness is not None and after.excess > EXCESS:
        rival = _other_change(before, samples, sigma, np.ones(count))
        if rival is not None and rival.kind != OTHER and rival.explained > brightness.explained:
            brightness = None
    if brightness is None:
        return np.ones(count), error, None, undecided, before, before
    return gains, error, brightness, False, before, after


def _one_frame(fit: FrameFit, samples: FrameSamples, sigma: FloatArray) -> int | None:
    """The frame whose gain explains most; None if another one explains as much."""
    normal, scores = fit.by_instrument(samples, sigma)
    own = np.maximum(np.diagonal(normal), 1 / PRIOR**2)
    gained = np.square(scores.sum(1)) / own
    second, first = np.sort(gained)[-2:]
    return int(np.argmax(gained)) if first - second > RIVAL else None


def _brightness(before: FrameFit, after: FrameFit, gains: FloatArray, covariance: FloatArray) -> FrameChange | None:
    """None where the gains are those of equal frames, or do not explain what noise leaves, or are known so badly that
    dividing by them would do harm."""
    gained = before.square - after.square
    over = before.square - before.freedom
    if not gained > MOST * over or gains.min() < 1.01 * LIMITS[0] or gains.max() > 0.99 * LIMITS[1]:
        return None  # a gain at its limit: a frame without its light
    off = np.log(gains)
    if _chance(off, covariance, before.left.shape[1]) > FALSE_GAINS:
        return None
    own = off - off.mean()
    if np.trace(covariance) - (len(off) - 1) * MODEL_GAIN**2 > CLEAR**2 * float(own @ own):
        return None
    worst = int(np.argmax(np.abs(off)))
    alone = np.delete(np.abs(off), worst).max() < ALONE * abs(off[worst])
    share = gained / max(over, gained)
    return FrameChange(BRIGHTNESS, worst if alone else -1, False, float(gains[worst]), share)


def _chance(off: FloatArray, covariance: FloatArray, pixels: int) -> float:
    """That equal frames give such logarithms of gains [N]: of all together, and of the largest alone. The covariance
    is one that so many pixels tell."""
    freedom = len(off) - 1
    own = off - off.mean()
    square = float(own @ np.linalg.pinv(covariance, rcond=NULL, hermitian=True) @ own)
    together = float(f_ratio.sf(square * (pixels - freedom) / (freedom * (pixels - 1)), freedom, pixels - freedom))
    largest = float((np.abs(off) / np.sqrt(np.diagonal(covariance))).max())
    return min(together, 2 * len(off) * float(norm.sf(largest))) if pixels > freedom else 1.0


def _other_change(fit: FrameFit, samples: FrameSamples, sigma: FloatArray, gains: FloatArray) -> FrameChange | None:
    """The likeliest change beside gains, if what is left is more than noise."""
    over = fit.square - fit.freedom
    if fit.excess < EXCESS or over / fit.freedom * np.mean(sigma**2) < (MODEL * samples.mean_light) ** 2:
        return None
    found = [_linear(kind, fit, samples, sigma, gains) for kind in (LIGHT, MOTION)]
    best = max((one for one in found if one is not None), key=lambda one: one.explained, default=None)
    return _free(fit) if best is None else best


def _linear(
    kind: str, fit: FrameFit, samples: FrameSamples, sigma: FloatArray, gains: FloatArray
) -> FrameChange | None:
    """A change of light or of the camera's place, if that explains most of what is left."""
    over = fit.square - fit.freedom
    count = len(gains)
    one = np.ones((count, 1))
    if kind == LIGHT:
        across = [(part - part.mean()) / max(np.ptp(part), 1.0) for part in (samples.column, samples.row)]
        shapes = np.stack([one * part / sigma for part in (np.ones_like(sigma), *across)])
    else:
        sides = (samples.along_x, samples.along_y)
        shapes = np.stack([-fit.light.part(side / gains[:, None]) / sigma for side in sides])
    normal, right = fit.explained(shapes)

    def gained(chosen: FloatArray) -> tuple[float, FloatArray]:
        """By changes of frames [N, q] alike; and the changes [K, q]."""
        all_kinds = np.kron(np.eye(len(shapes)), chosen)
        part, of_part = all_kinds.T @ normal @ all_kinds, all_kinds.T @ right
        found = np.linalg.pinv(part, rcond=NULL, hermitian=True) @ of_part
        return float(found @ of_part), found.reshape(len(shapes), -1)

    whole, found = gained(np.eye(count))
    if not whole > chi2.isf(FALSE_ALARM, right.size) or whole < MOST * over:
        return None
    tried = [(*gained(chosen[:, None]), k, stays) for k, stays, chosen in _hypotheses(count)]
    most, change, first, stays = max(tried, key=lambda one: one[0])
    alike = next(chosen for k, also, chosen in _hypotheses(count) if (k, also) == (first, stays))
    added = change[0, 0] * alike
    ties = [k for gain, _, k, also in tried if also == stays and k != first and gain > TIE * most]
    if most < NEARLY * whole:
        most, change, first, stays, ties, added = whole, found, -1, False, [], found[0]
    size = float(np.hypot(*change).max() if kind == MOTION else np.abs(change[0]).max() / samples.mean_light)
    if size < LEAST[kind]:
        return None
    of_light = added / samples.mean_light if kind == LIGHT else None
    return FrameChange(kind, first, stays, size, min(most / over, 1.0), tuple(ties), of_light)


def _free(fit: FrameFit) -> FrameChange | None:
    """A frame that is unlike the others, or from which on all are, in any way: fits without it, or of both parts."""
    count, over = len(fit.light.basis), fit.square - fit.freedom
    tried = []
    for k, stays, chosen in _hypotheses(count):
        # a part that lacks a series' steps has no more parameters than frames
        parts = (chosen == 0, chosen == 1) if stays else (chosen == 0,)
        left, freedom = 0.0, 0
        for part in parts:
            basis = fit.light.basis[part]
            rest = np.eye(len(basis)) - basis @ np.linalg.pinv(basis)
            left += float(np.square(rest @ fit.left[part]).sum())
            freedom += round(float(np.trace(rest)))
        if freedom:
            own = freedom * fit.left.shape[1]
            # what is left over noise, as a share of what there was, both for each degree of freedom
            share = 1 - max(left / own - 1, 0.0) / (over / fit.freedom)
            tried.append((share, not stays, k))
    best = max((share for share, _, _ in tried), default=0.0)
    if best < MOST:
        return None
    good = [(single, k) for share, single, k in tried if share > TIE * best]
    alike = sorted(k for single, k in good if single == max(good)[0])
    return FrameChange(OTHER, alike[0], not max(good)[0], math.sqrt(fit.excess), min(best, 1.0), tuple(alike[1:]))
