"""What becomes of the sums of a non-sequential trace: light by path, losses, rays by where they end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.opencl.structs import PATH_WORDS, path_dtype
from irtscots_cl.optics.elements.components import Component
from irtscots_cl.optics.elements.path_focus import NO_FOCUS, path_focus
from irtscots_cl.tracing.results.paths import KINDS, LostFlux, PathFlux, events_of, kind_of, name_of

# As in kernels/tally/tally.cl: then one per element, absorbed. "parted" are no end, but rays beside those launched.
ENDS = ("detected", "escaped", "bounce limit", "failed", "parted")
TRACKED_PATHS = 64  # the most powerful ones and, last, all others
MAX_SCALE_BITS = 127  # of single precision
SCALE_BITS = 22  # of a path's largest weight in the pilot; leaves 2^9 for larger ones
LOSS_ONE = 2.0**20  # as in kernels/tally/tally.cl


@dataclass(frozen=True)
class TrackedPaths:
    """Paths whose light is counted separately, by code, with their largest weight in the pilot run.

    The most powerful path comes first.
    """

    codes: tuple[int, ...] = ()
    weights: tuple[float, ...] = ()

    @property
    def of_kind(self) -> np.ndarray:
        """What weights are multiplied by to be whole numbers, in the images of each of KINDS."""
        kinds = [kind_of(code) for code in self.codes]
        largest = [max((w for w, k in zip(self.weights, kinds, strict=True) if k == kind), default=1.0)
                   for kind in range(len(KINDS))]  # fmt: skip
        return np.array([_scale(weight) for weight in largest])

    def table(self, code_length: str = "short") -> np.ndarray:
        """The kernels' Path structures: these paths', then one for all others, which count as ghosts.

        code_length: a name of structs.PATH_WORDS.
        """
        table, of_kind = np.zeros(len(self.codes) + 1, path_dtype(code_length)), self.of_kind
        for entry, code, weight in zip(table, self.codes, self.weights, strict=False):
            kind = kind_of(code)
            entry["word"] = [code >> 32 * word & 0xFFFFFFFF for word in range(PATH_WORDS[code_length])]
            entry["scale"], entry["class_scale"], entry["kind"] = _scale(weight), of_kind[kind], kind
        table["scale"][-1], table["kind"][-1], table["class_scale"][-1] = 2.0**SCALE_BITS, 1, of_kind[1]
        return table


@dataclass(frozen=True)
class PathSums:
    """What the sums of a non-sequential trace say.

    sources: screen pixels. unit_w: flux [W] of weight 1 in a run of one ray per screen pixel.
    """

    components: tuple[Component, ...]
    tracked: TrackedPaths
    sources: int
    unit_w: float

    def ends(self, sums: np.ndarray, launched: int) -> dict[str, int]:
        """Rays of all replicates by where they ended; they add up to those launched and those that parted from others.

        AssertionError if not: a bug.
        """
        names = (*ENDS, *(f"absorbed by {component.name}" for component in self.components))
        found = dict(zip(names, (int(n) for n in sums.sum(0)[: len(names)]), strict=True))
        parted = found.pop("parted")
        ended = sum(found.values())
        assert ended == launched + parted, f"{launched + parted} rays launched and parted, {ended} accounted for"
        return {"launched": launched, "parted": parted} | found

    def fluxes(self, sums: np.ndarray, rays: np.ndarray) -> tuple[PathFlux, ...]:
        """Flux of every path, by power, and last of all others."""
        paths = sums[:, -2 * TRACKED_PATHS :].reshape(len(rays), TRACKED_PATHS, 2)
        names = tuple(component.name for component in self.components)
        labels = [(name_of(code, names), KINDS[kind_of(code)]) for code in self.tracked.codes] + [("other", "other")]
        sharp = [*(path_focus(self.components, events_of(code)) for code in self.tracked.codes), NO_FOCUS]
        found = []
        for p, (label, entry) in enumerate(zip(labels, self.tracked.table(), strict=True)):
            flux = self._watts(paths[:, p, 1] / float(entry["scale"]), rays)
            found.append(PathFlux(*label, *flux, int(paths[:, p, 0].sum()), *sharp[p]))
        return (*sorted(found[:-1], key=lambda path: -path.flux_w), found[-1])

    def losses(self, sums: np.ndarray, rays: np.ndarray) -> tuple[LostFlux, ...]:
        """Light that does not reach the detector, by where it stays: absorbed by elements, escaped, given up."""
        names = (*(f"absorbed by {component.name}" for component in self.components), "escaped", "bounce limit")
        first = len(ENDS) + len(self.components)
        weights = sums[:, first : first + len(names)] / LOSS_ONE
        return tuple(LostFlux(name, *self._watts(each, rays)) for name, each in zip(names, weights.T, strict=True))

    def _watts(self, weights: np.ndarray, rays: np.ndarray) -> tuple[float, float]:
        """Flux of weights [replicates] in W and its standard error."""
        each = weights * self.unit_w / rays
        error = float(np.std(each, ddof=1) / np.sqrt(len(rays))) if len(rays) > 1 else float("nan")
        return float(np.average(each, weights=rays)), error


def ledger_of(ends: dict[str, int]) -> dict[str, int]:
    """The ends in the words of all estimators' ledgers."""
    absorbed = sum(count for name, count in ends.items() if name.startswith("absorbed by "))
    return {
        "launched": ends["launched"] + ends["parted"], "detected": ends["detected"], "missed_mirror": ends["escaped"],
        "clipped": 0, "off_detector": 0, "off_screen": 0, "absorbed": absorbed,
        "failed": ends["failed"] + ends["bounce limit"],
    }  # fmt: skip


def _scale(weight: float) -> float:
    """A power of two that takes the weight to at most 2^SCALE_BITS, and that the kernels' floats can hold."""
    return float(2.0 ** min(SCALE_BITS - np.ceil(np.log2(weight)), MAX_SCALE_BITS))
