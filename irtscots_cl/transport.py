"""The light-transport map: for each detector pixel, the flux that each screen pixel in its window sends there."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irtscots_cl.interface import WEIGHT_ONE, Fate
from irtscots_cl.scene import Scene
from irtscots_cl.windows import Windows


@dataclass(frozen=True)
class Transport:
    """Result of a trace. n: detector pixels that can see the mirror; windows are [rows, columns] of screen pixels.

    options: tracer.TraceOptions that it was made with. device: Device.describe() of where.
    counts: [replicates, n, window rows, window columns] uint64, ray counts (forward) or summed weights (adjoint).
    unit_w: flux [W] of one count in a run of one ray per stream; broadcasts to [n, window rows, window columns].
    rays: [replicates] rays per stream (screen pixel or detector pixel) of each replicate.
    ledger: rays by fate; all but "launched" add up to it. seconds: build, trace, and the part of it in kernels.
    """

    scene: Scene
    options: Any
    device: dict[str, object]
    windows: Windows
    counts: np.ndarray = field(repr=False)
    unit_w: np.ndarray = field(repr=False)
    rays: np.ndarray
    ledger: dict[str, int]
    seconds: dict[str, float]

    @property
    def rays_total(self) -> int:
        return self.ledger["launched"]

    @property
    def replicates(self) -> int:
        return len(self.rays)

    def flux_w(self, replicate: int | None = None) -> np.ndarray:
        """Flux [n, window rows, window columns] in W of one replicate, or the mean over all rays."""
        if replicate is None:
            return self.counts.sum(0) * (self.unit_w / self.rays.sum())
        return self.counts[replicate] * (self.unit_w / self.rays[replicate])

    def hits(self) -> np.ndarray:
        """Rays [n] that brought light to each detector pixel, of all replicates."""
        one = WEIGHT_ONE if self.options.estimator == "adjoint" else 1
        return self.counts.sum((0, 2, 3)) / one

    def images(self, pattern):
        """The images under a pattern (patterns.LineScan), without new rays."""
        return pattern.images(self)

    def standard_error_w(self) -> np.ndarray:
        """Standard error of flux_w() per bin, from the scatter of the replicates; NaN with fewer than two."""
        if self.replicates < 2:
            return np.full(self.counts.shape[1:], np.nan)
        mean, variance = self.flux_w(), np.zeros(self.counts.shape[1:])
        for r in range(self.replicates):
            variance += (self.flux_w(r) - mean) ** 2
        return np.sqrt(variance / (self.replicates * (self.replicates - 1)))


def ledger_from(counts: np.ndarray, launched: int) -> dict[str, int]:
    """The energy ledger from counts [Fate] of all launches. Raises AssertionError if rays got lost: a bug."""
    ledger = {"launched": launched} | {fate.name.lower(): int(counts[fate]) for fate in Fate if fate != Fate.OFF_WINDOW}
    total = sum(ledger.values()) - launched + int(counts[Fate.OFF_WINDOW])
    assert total == launched, f"the ledger does not close: {launched} rays launched, {total} accounted for"
    return ledger
