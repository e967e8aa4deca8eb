"""Which pixels of a fringe measurement are used and why others are not, and checks of its images against the design."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from scipy.stats import chi2

from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.fringe_frames import ShownFrames
from irtscots_cl.measurement.fringe_light import LightPhases, place_mm
from irtscots_cl.measurement.photon_transfer import PhotonTransfer
from irtscots_cl.measurement.quality import (
    ERROR,
    FEW,
    LEVELS,
    OK,
    WARNING,
    Check,
    orientation_check,
    outline_check,
)
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates, ScreenCoordinates
from irtscots_cl.optics.setup import Setup

WRONG_ORDER = 0.01  # probability, from which on a pixel is not used
MISFIT = 1e-9  # chance of a pixel's misfit between its series, below which it is not used
SATURATED = 0.01  # share of the mirror's pixels with saturated samples, from which on it is named
ALONE = 3.0  # times the median image's saturated share: an image that is named
NOT_A_LINE = 0.3  # of the variance of noise: a departure from a line over light that is named
BLUR = 0.2  # relative difference of a series' modulation from the design's, from which on it is named


class Reason(IntEnum):
    """Why a pixel of the mirror is not used; USED: it is."""

    USED = 0
    MASKED = 1  # by the user's mask
    DARK = 2  # sees no fringes
    SATURATED = 3  # too few samples are left of a series
    ORDER = 4  # which fringe it sees is in doubt
    DISAGREE = 5  # its series tell different places: light from elsewhere, motion, an edge
    EDGE = 6  # less than half of it is on the mirror, by the outline in the picture
    MARK = 7  # it sees a fiducial
    BAD = 8  # of the camera: by the map of bad pixels, dead or saturated in the flat frames


REASONS = {
    Reason.MASKED: "masked",
    Reason.DARK: "without fringes",
    Reason.SATURATED: "with too few samples, saturated or missing",
    Reason.ORDER: "with a fringe order in doubt",
    Reason.DISAGREE: "whose series disagree",
    Reason.EDGE: "off the mirror's edge in the picture",
    Reason.MARK: "on fiducials",
    Reason.BAD: "bad by the camera's map or flat frames",
}


@dataclass(frozen=True)
class Exclusions:
    """reason: [rows, columns] of the images as stored, a Reason each, also off the mirror."""

    reason: IntArray = field(repr=False)

    @property
    def used(self) -> BoolArray:
        usable: BoolArray = self.reason == Reason.USED
        return usable

    def counts(self, on_mirror: BoolArray) -> dict[str, int]:
        """Pixels of the mirror by reason, named in small letters."""
        found = np.bincount(self.reason[on_mirror], minlength=len(Reason))
        return {reason.name.lower(): int(found[reason]) for reason in Reason}


def exclusions(
    found: ScreenCoordinates,
    lit: BoolArray,
    use: BoolArray | None = None,
    *,
    edge: BoolArray | None = None,
    marks: BoolArray | None = None,
    bad: BoolArray | None = None,
) -> Exclusions:
    """The reason for every pixel. lit: those that see fringes. use: those that may be used; None: all. edge: those off
    the mirror by its outline. marks: those that see a fiducial. bad: of the camera; None: none."""
    reason = np.where(lit, Reason.USED, Reason.DARK)
    for one in found.axes.values():
        freedom = np.maximum(np.isfinite(one.phase_rad).sum(0) - 1, 0)
        limit = np.where(freedom > 0, chi2.isf(MISFIT, np.maximum(freedom, 1)) / np.maximum(freedom, 1), np.inf)
        with np.errstate(invalid="ignore"):
            tests = (
                (Reason.SATURATED, ~np.isfinite(one.phase_rad).all(0) & ~np.isfinite(one.fraction)),
                (Reason.ORDER, (one.wrong > WRONG_ORDER) | ~np.isfinite(one.fraction)),
                (Reason.DISAGREE, one.misfit > limit),
            )
        for kind, wrong in tests:
            reason[(reason == Reason.USED) & wrong] = kind
    if edge is not None:
        reason[edge & ((reason == Reason.USED) | (reason == Reason.DISAGREE))] = Reason.EDGE
    if marks is not None:
        reason[marks] = Reason.MARK
    if bad is not None:
        reason[bad] = Reason.BAD
    if use is not None:
        reason[~use] = Reason.MASKED
    return Exclusions(reason.astype(np.int64))


def check_notes(found: ScreenCoordinates) -> list[Check]:
    """What the images themselves show to be other than said, a warning each; an error where they are no measurement."""
    surveys = [one.survey for one in found.axes.values()]
    checks = [Check("fringes", ERROR, 1.0, 0.0, 0.0, fault) for one in surveys for fault in one.faults]
    checks += [Check("fringes", WARNING, 1.0, 0.0, 0.0, note) for one in surveys for note in one.notes]
    return checks or [Check("fringes", OK, 0.0, 0.0, 0.0, "the fringes are as said: steps, periods, directions")]


def check_light(
    found: ScreenCoordinates, phases: Mapping[str, LightPhases], setup: Setup, used: BoolArray
) -> list[Check]:
    """Modulation of the series over that of the lowest, against the design's light. used: [rows, columns] upright."""
    from irtscots_cl.imaging.orientation import upright

    checks = []
    for axis, one in found.axes.items():
        amplitude = upright(one.amplitude, setup.scene.camera.detector.orientation)
        measured, expected = (_over_lowest(maps, one, used) for maps in (amplitude, phases[axis].modulation))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = measured / expected
        off = np.nan_to_num(np.abs(ratio - 1))
        worst = int(np.argmax(off))
        value, periods = float(off[worst]), one.fringes.periods[worst]
        if value <= BLUR:
            text = f"the modulation of the {axis} fringes falls as the design's light has it"
            checks.append(Check(f"modulation {axis}", OK, value, BLUR, 1e-6, text))
            continue
        text = (
            f"{axis} fringes of {periods:g} periods have {ratio[worst]:.2f} of the modulation that the design's light "
            "has, relative to the lowest series: the aperture's diameter, the focus, the screen's gamma or stray light"
        )
        checks.append(Check(f"modulation {axis}", WARNING, value, BLUR, 1e-6, text))
    return checks


def _over_lowest(maps: FloatArray, one: AxisCoordinates, used: BoolArray) -> FloatArray:
    """Medians [series] over the used pixels of maps [series, rows, columns] over those of the lowest series."""
    lowest = int(np.argmin(one.fringes.periods))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.asarray(maps, float)[:, used] / np.asarray(maps[lowest], float)[used]
    return np.array([np.nanmedian(row) if np.isfinite(row).any() else np.nan for row in share])


def check_geometry(found: ScreenCoordinates, setup: Setup, lit: BoolArray, used: BoolArray) -> list[Check]:
    """Orientation and outline. lit, used: [rows, columns] upright."""
    screen = setup.scene.screen
    places = [np.where(used, place_mm(found.axes[axis], setup), np.nan) for axis in "xy"]
    checks = [orientation_check(setup, places, list(screen.centre_offset_mm))]
    if checks[0].level == OK:
        checks.append(outline_check(lit, setup))
    return checks


def check_pixels(counts: Mapping[str, int]) -> Check:
    """Whether enough of the mirror's pixels are used. counts: by reason."""
    named = {reason: counts[reason.name.lower()] for reason in REASONS}
    masked = named.pop(Reason.MASKED)
    whole = sum(counts.values()) - masked - named[Reason.MARK]
    share = counts["used"] / max(whole, 1)
    told = ", ".join(f"{n} {REASONS[reason]}" for reason, n in named.items() if n)
    told += f"{', ' if told and masked else ''}{f'{masked} masked' if masked else ''}"
    told = f" ({told})" if told else ""
    if share >= FEW[0]:
        return Check("pixels", OK, share, FEW[0], 1e-6, f"{share:.1%} of the mirror's pixels are used{told}")
    level = ERROR if share < FEW[1] else WARNING
    limit = FEW[LEVELS.index(level) - 1]
    what = "too few to be measured" if level == ERROR else "the height map is of these alone"
    return Check("pixels", level, share, limit, 1e-6, f"only {share:.1%} of the mirror's pixels are used{told}; {what}")


def check_noise(transfer: PhotonTransfer | None) -> Check:
    """Noise against light: a line, for a camera whose counts are proportional to light and left as they are."""
    if transfer is None:
        text = "too few pixels or steps tell the noise against light"
        return Check("noise", OK, 0.0, NOT_A_LINE, 1e-6, text)
    value = transfer.departs()
    electrons = transfer.electrons_per_count
    told = f"{electrons:.3g} electrons per count" if np.isfinite(electrons) else "no electrons to be told"
    if value <= NOT_A_LINE or transfer.chance > 1e-6:
        return Check("noise", OK, value, NOT_A_LINE, 1e-6, f"the noise is that of light and read-out, {told}")
    text = (
        f"the variance of the noise departs by {value:.0%} from a line over light: images were smoothed, compressed or "
        "given a curve; record raw images"
    )
    return Check("noise", WARNING, value, NOT_A_LINE, 1e-6, text)


def check_saturation(
    found: ScreenCoordinates, on_mirror: BoolArray, ceiling: float, shown: ShownFrames, name: Callable[[int], str]
) -> Check:
    """on_mirror: [rows, columns] as stored. name: of an image in messages."""
    missing = np.zeros(on_mirror.shape, bool)
    for one in found.axes.values():
        missing |= np.nan_to_num(one.missing) > 0
    share = float(missing[on_mirror].mean()) if on_mirror.any() else 0.0
    if share <= SATURATED:
        return Check("saturation", OK, share, SATURATED, 1e-6, f"{share:.1%} of the pixels have saturated samples")
    worst = int(np.argmax(shown.saturated))
    alone = shown.saturated[worst] > ALONE * np.median(shown.saturated)
    which = f", most in {name(worst)} ({shown.saturated[worst]:.0%})" if alone else ""
    text = (
        f"{share:.1%} of the mirror's pixels have samples at {ceiling:.10g}, the highest value{which}: saturated and "
        "left out; expose less"
    )
    return Check("saturation", WARNING, share, SATURATED, 1e-6, text)
