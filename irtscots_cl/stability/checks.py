"""What a case of the stability table is, and what it found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from irtscots_cl.opencl.device import Device


@dataclass(frozen=True)
class Limit:
    """The largest error allowed, its unit, and the physical reason for the number."""

    value: float
    unit: str
    reason: str


@dataclass(frozen=True)
class Finding:
    """One line of the table: the errors of a quantity over its samples, against a limit.

    quantity: what was compared with what. rms: NaN where a single number was compared.
    """

    quantity: str
    largest: float
    rms: float
    samples: int
    limit: Limit

    @property
    def passed(self) -> bool:
        """False for an error that is not a number, too."""
        return bool(self.largest <= self.limit.value)


def finding(quantity: str, errors: np.ndarray, limit: Limit) -> Finding:
    """Largest magnitude and rms of errors [n]; no sample at all, or one that is not a number, fails."""
    errors = np.abs(np.ravel(np.asarray(errors, float)))
    if errors.size == 0:
        return Finding(quantity, float("nan"), float("nan"), 0, limit)
    return Finding(quantity, float(errors.max()), float(np.sqrt(np.mean(errors**2))), errors.size, limit)


def count(quantity: str, wrong: int, samples: int, reason: str) -> Finding:
    """So many of the samples are wrong; none may be."""
    return Finding(quantity, float(wrong), float("nan"), samples, Limit(0, "wrong", reason))


@dataclass(frozen=True)
class Bench:
    """What a case runs on. device: None for what the host computes, in float64."""

    device: Device | None
    precision: str


@dataclass(frozen=True)
class Case:
    """A hard case: run gives its findings on a bench.

    long: takes more than a few seconds, so `irtscots stability` leaves it out without --long. on_host: needs no device.
    """

    group: str
    name: str
    run: Callable[[Bench], list[Finding]]
    long: bool = False
    on_host: bool = False
