"""How many periods the highest series of a set may have: what its noise, its modulation and its orders allow."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from irtscots_cl.maths.arrays import BoolArray
from irtscots_cl.measurement.pattern_design.camera import DesignCamera
from irtscots_cl.measurement.pattern_design.families import LOWEST, periods_of
from irtscots_cl.measurement.pattern_design.fringe_errors import (
    Fringes,
    emitted,
    phase_errors,
    place_errors_mm,
    signal_of,
)
from irtscots_cl.measurement.pattern_design.heights import HeightNoise
from irtscots_cl.measurement.pattern_design.orders import wrong_orders
from irtscots_cl.measurement.pattern_design.pixels import SeenPixels

SAFE = 1e-6  # probability of wrong orders
EXCEPT = 0.01  # share of the pixels that may be worse: they are told and left out
PER_DECADE = 16  # highest numbers of periods that are tried
ROUNDS = 10  # of halving the gap between the highest safe one and the next


@dataclass(frozen=True)
class SafePeriods:
    """found: whether any set is safe. highest: most periods of one that is; why: what forbids more: modulation,
    ambiguity, screen pixels, or that the phase of one series must tell one place. best: the periods
    of the safe set with the least height error, or of the least periods tried where none is."""

    found: bool
    highest: float
    why: str
    best: tuple[float, ...]


@dataclass(frozen=True)
class Tried:
    """One set. bad: "" for a safe one, else why not. nm: its height error."""

    fringes: Fringes
    bad: str
    nm: float


def highest_safe(
    seen: SeenPixels,
    camera: DesignCamera,
    kind: Fringes,
    frames: int,
    heights: HeightNoise,
    limit: float = SAFE,
    gamma: float = 1.0,
) -> SafePeriods:
    """Search sets of the kind's family, series and steps by their highest number of periods.

    frames: of both axes that the set is recorded in. A set is safe if the sinusoids' amplitude is above the noise of a
    frame and wrong orders are less probable than the limit, in all pixels but EXCEPT of them.
    """
    series, most = len(kind.periods), seen.most_periods
    if series == 1:
        highest = np.array([LOWEST])
    else:
        least = 1.5 * LOWEST
        if most <= least:
            return SafePeriods(False, 0.0, "screen pixels", periods_of(kind.family, series, least))
        count = max(2, int(np.ceil(PER_DECADE * np.log10(most / least))) + 1)
        highest = np.geomspace(least, most, count)

    def of_highest(top: float) -> Tried:
        return tried(
            seen, camera, replace(kind, periods=periods_of(kind.family, series, top)), frames, heights, limit, gamma
        )

    all_tried = [of_highest(float(top)) for top in highest]
    safe = [k for k, one in enumerate(all_tried) if not one.bad]
    if not safe:
        return SafePeriods(False, 0.0, all_tried[0].bad, all_tried[0].fringes.periods)
    best = min((all_tried[k] for k in safe), key=lambda one: one.nm)
    last = safe[-1]
    if last + 1 == len(highest):
        why = "one place" if series == 1 else "screen pixels"
        return SafePeriods(True, all_tried[last].fringes.periods[-1], why, best.fringes.periods)
    low, high, why = float(highest[last]), float(highest[last + 1]), all_tried[last + 1].bad
    for _ in range(ROUNDS):
        middle = of_highest(float(np.sqrt(low * high)))
        if middle.bad:
            high, why = float(np.sqrt(low * high)), middle.bad
        else:
            low = float(np.sqrt(low * high))
            best = min(best, middle, key=lambda one: one.nm)
    return SafePeriods(True, periods_of(kind.family, series, low)[-1], why, best.fringes.periods)


def tried(
    seen: SeenPixels,
    camera: DesignCamera,
    fringes: Fringes,
    frames: int,
    heights: HeightNoise,
    limit: float,
    gamma: float,
) -> Tried:
    """One set, recorded in so many frames of both axes."""
    places, ambiguous, dark = [], np.zeros(len(seen.bright), bool), np.zeros(len(seen.bright), bool)
    for axis in range(2):
        errors = phase_errors(seen, camera, axis, fringes, frames, gamma)
        ambiguous |= wrong_orders(fringes.periods, errors, seen.fraction(axis)) > limit
        dark |= too_dark(seen, camera, axis, fringes.periods, gamma)
        places.append(place_errors_mm(seen, axis, fringes.periods, errors))
    why = "modulation" if dark.mean() > EXCEPT else "ambiguity" if ambiguous.mean() > EXCEPT else ""
    return Tried(fringes, why, heights.nm(np.stack(places)))


def too_dark(
    seen: SeenPixels, camera: DesignCamera, axis: int, periods: tuple[float, ...], gamma: float = 1.0
) -> BoolArray:
    """Pixels [n] in which the amplitude is not above the noise of a single frame, at these numbers of periods or fewer.

    Beyond a zero of the modulation fringes come back inverted, but a pixel that sees a little more of the screen than
    the design says does not see them.
    """
    highest = max(periods)
    signal = signal_of(seen, camera, axis, highest, gamma)
    least = camera.electrons * seen.bright * emitted(gamma)[1] * seen.least_modulation_at(axis, highest)
    dark: BoolArray = ~(least > np.sqrt(camera.noise.variance(signal.offset_e)))
    return dark
