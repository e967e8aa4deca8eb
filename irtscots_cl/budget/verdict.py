"""Whether a measured mirror meets a requirement, as on a drawing (ISO 10110-5), with a guard band.

The indication is 3/A(B/C) and limits of RMSt, RMSi and RMSa. A: sagitta error, B: irregularity, C: rotationally
symmetric irregularity, peak to valley in fringes of half the wavelength (546.07 nm where nothing else is said). RMSt:
rms of the whole deviation, RMSi: without its best sphere, RMSa: without all that is rotationally symmetric. Here A to C
are of the Zernike terms to radial order 4, so that single noisy pixels do not count; rms values are of all pixels.
A requirement is met where the whole interval of the true value is within the limit, and not met where none of it is;
between, the test does not say (JCGM 106:2012, guarded acceptance).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.budget.intervals import ErrorSamples, Interval
from irtscots_cl.budget.measured_design import NOLLS
from irtscots_cl.budget.source import Kind
from irtscots_cl.budget.trials import Trials
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.zernike.indices import noll_to_nm

WAVELENGTH_NM = 546.07
MET, NOT_MET, OPEN = "met", "not met", "not decided"
_NUMBER = r"(?:\d+\.?\d*|\.\d+)"
_RIM = re.compile(rf"^3/(?P<A>{_NUMBER}|-)(?:\((?P<B>{_NUMBER}|-)(?:/(?P<C>{_NUMBER}))?\))?$", re.ASCII)
_RMS = re.compile(rf"^(RMS[tia])<({_NUMBER})$", re.ASCII)
ROTATIONAL = tuple(noll for noll in NOLLS if noll_to_nm(noll)[1] == 0)
LEFT_OUT = {"RMSt": (1, 2, 3), "RMSi": (1, 2, 3, 4), "RMSa": (1, 2, 3, *ROTATIONAL[1:])}  # Zernike terms
PEAKS = {"A": (4,), "B": NOLLS[4:], "C": ROTATIONAL[2:]}  # without piston, tilt; B and C without power, too


@dataclass(frozen=True)
class Judged:
    """One number of an indication. limit_nm; interval: of the true value in nm; verdict: MET, NOT_MET or OPEN."""

    name: str
    limit_nm: float
    interval: Interval
    verdict: str

    @property
    def guard_nm(self) -> float:
        """Guard band: how far below the limit the figure must be, to meet it."""
        return self.interval.high - self.interval.estimate

    @property
    def missing_nm(self) -> float:
        """By how much the nearer end of the interval is beyond the limit, where that is not decided; else 0."""
        if self.verdict != OPEN:
            return 0.0
        return min(self.interval.high - self.limit_nm, self.limit_nm - self.interval.low)


@dataclass(frozen=True)
class Verdict:
    """A map's figures. source: where it comes from. zernikes, rms: 95 % intervals by Noll index and by RMSt, RMSi,
    RMSa. judged: the limits asked for. used: [n] of the design's pixels at which the map has a height. warnings: of the
    map's reader."""

    trials: Trials = field(repr=False)
    source: str
    wavelength_nm: float
    used: BoolArray = field(repr=False)
    zernikes: dict[int, Interval]
    rms: dict[str, Interval]
    judged: tuple[Judged, ...]
    warnings: tuple[str, ...] = ()

    @property
    def corrected(self) -> tuple[str, ...]:
        """Names of the constants, which were taken out of the map."""
        return tuple(source.name for source in self.trials.sources if source.kind is Kind.CONSTANT)


def requirements(text: str, wavelength_nm: float = WAVELENGTH_NM) -> dict[str, float]:
    """Limits in nm by name, of an indication such as "3/2(0.5/0.2) RMSi<0.05" in fringes.

    Raises ValueError for a text that is none.
    """
    found: dict[str, float] = {}
    for word in text.split():
        if rim := _RIM.match(word):
            limits = {key: float(value) for key, value in rim.groupdict().items() if value not in (None, "-")}
        elif rms := _RMS.match(word):
            limits = {rms[1]: float(rms[2])}
        else:
            raise ValueError(f"{word!r}: must be 3/A(B/C), RMSt<X, RMSi<X or RMSa<X, in fringes of half a wavelength")
        if twice := limits.keys() & found.keys():
            raise ValueError(f"{text!r}: must have one limit of {min(twice)}")
        found |= limits
    if not found or not all(0 < value < np.inf for value in found.values()):
        raise ValueError(f"{text!r}: must have at least one limit, each above 0")
    return {name: value * wavelength_nm / 2 for name, value in found.items()}


def judge(samples: ErrorSamples, height_mm: FloatArray, limits_nm: dict[str, float]) -> list[Judged]:
    """Each limit against the interval of a measured deviation [used]."""
    found = []
    for name, limit in limits_nm.items():
        interval = _interval(samples, height_mm, name)
        verdict = MET if interval.high <= limit else NOT_MET if interval.low > limit else OPEN
        found.append(Judged(name, limit, interval, verdict))
    return found


def _interval(samples: ErrorSamples, height_mm: FloatArray, name: str) -> Interval:
    if name in LEFT_OUT:
        return samples.rms(height_mm, LEFT_OUT[name])
    return samples.peak_to_valley(height_mm, PEAKS[name])
