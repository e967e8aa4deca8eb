"""The cases of the stability table and their findings."""

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
    """One line of the table: the errors of a quantity over its samples, and their limit.

    quantity: the comparison in words. rms: NaN for a single number.
    """

    quantity: str
    largest: float
    rms: float
    samples: int
    limit: Limit

    @property
    def passed(self) -> bool:
        """Whether the largest error is within the limit; false for NaN."""
        return bool(self.largest <= self.limit.value)


def finding(quantity: str, errors: np.ndarray, limit: Limit) -> Finding:
    """Largest magnitude and rms of errors [n]. It fails if there is no sample, or if one is NaN."""
    errors = np.abs(np.ravel(np.asarray(errors, float)))
    if errors.size == 0:
        return Finding(quantity, float("nan"), float("nan"), 0, limit)
    return Finding(quantity, float(errors.max()), float(np.sqrt(np.mean(errors**2))), errors.size, limit)


def count(quantity: str, wrong: int, samples: int, reason: str) -> Finding:
    """A finding that `wrong` of the samples are wrong; none may be."""
    return Finding(quantity, float(wrong), float("nan"), samples, Limit(0, "wrong", reason))


@dataclass(frozen=True)
class Bench:
    """The device and precision that a case runs on. device: None for the host, in float64."""

    device: Device | None
    precision: str


@dataclass(frozen=True)
class Case:
    """A hard case: run(bench) returns its findings.

    long: takes more than a few seconds, so `irtscots stability` leaves it out without --long. on_host: needs no device.
    """

    group: str
    name: str
    run: Callable[[Bench], list[Finding]]
    long: bool = False
    on_host: bool = False
