"""The ledger of one trial: signed height maps, one for each source, that add up to the error of the whole test.

Sources are switched on one after the other, and a row is what its source adds to the height map. So the rows' sum is
the whole error, to rounding. A row depends on the order by no more than its second-order part: what its source and
each other one make together beyond what they make alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from irtscots_cl.budget.sensitivity import NM
from irtscots_cl.budget.trials import Trials
from irtscots_cl.maths.arrays import FloatArray

COARSE = 32  # pixels per axis, on which the second-order parts are found: they are smooth
MARGIN = 1.5  # on them, for what lies between these pixels and for third orders
AT_ONCE = 64  # height maps


@dataclass(frozen=True)
class LedgerRow:
    """height_mm: [n] what the source adds. second_order_mm: the most that another order changes in any pixel;
    second_order_nm: of its rms, piston and tilt removed."""

    name: str
    value: float
    height_mm: FloatArray = field(repr=False)
    second_order_mm: float
    second_order_nm: float


@dataclass(frozen=True)
class Ledger:
    """total_mm: [n] error of the test with everything on."""

    rows: tuple[LedgerRow, ...]
    total_mm: FloatArray = field(repr=False)


def ledger(trials: Trials, trial: int, order: Sequence[str] | None = None) -> Ledger:
    """The ledger of a trial. order: names in which they are switched on, by default alphabetical.

    Raises NotMeasuredError for a trial that cannot be measured, or only some of whose sources can.
    """
    values = trials.values_of(trial)
    names = tuple(order or values)
    steps = _heights(trials, trial, [{name: values[name] for name in names[:k]} for k in range(len(names) + 1)])
    second = _second_order(trials, trial, values)
    rows = tuple(LedgerRow(name, values[name], steps[k + 1] - steps[k], *second[name]) for k, name in enumerate(names))
    return Ledger(rows, steps[-1])


def _second_order(trials: Trials, trial: int, values: Mapping[str, float]) -> dict[str, FloatArray]:
    """The most that other sources change in each source's row: in mm in any pixel, and in nm rms."""
    coarse = trials.coarse(COARSE)
    alone = dict(zip(values, _heights(coarse, trial, [{name: value} for name, value in values.items()]), strict=True))
    pairs = list(combinations(values, 2))
    both = _heights(coarse, trial, [{a: values[a], b: values[b]} for a, b in pairs])
    found = {name: np.zeros(2) for name in values}
    for (a, b), height in zip(pairs, both, strict=True):
        excess = height - alone[a] - alone[b]
        most = MARGIN * np.array([np.abs(excess).max(), coarse.design.response.left(excess[None])[0, 0] * NM])
        found[a] += most
        found[b] += most
    return found


def _heights(trials: Trials, trial: int, sets: Sequence[Mapping[str, float]]) -> FloatArray:
    """Heights [sets, n] with some sources on."""
    found = np.zeros((len(sets), trials.design.count))
    for first in range(0, len(sets), AT_ONCE):
        part = sets[first : first + AT_ONCE]
        found[first : first + len(part)] = trials.heights_mm([(trial, on) for on in part])
    return found
