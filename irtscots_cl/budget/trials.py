"""Trials: everything wrong at once, each trial a pure function of the seed and its number.

The parameters of trial k are the k-th point of a scrambled Sobol sequence (Owen; scipy.stats.qmc), one dimension each,
turned into values by the inverse of their distributions. Dimensions belong to names, in alphabetical order.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from irtscots_cl.budget.distributions import drawn, even_shares
from irtscots_cl.budget.geometry import geometry_changes
from irtscots_cl.budget.joint import NONE, Joint, with_calibrated
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.procedure import Procedure, is_figure
from irtscots_cl.budget.source import Draw, Source
from irtscots_cl.budget.sources import geometry_sources, source_of
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.validation import SceneError, problem


class NotMeasuredError(Exception):
    """A trial of which no height map can be made; the message says why."""


@dataclass(frozen=True)
class Trials:
    """The trials of a budget on a design."""

    design: MeasuredDesign
    budget: Budget
    sources: tuple[Source, ...] = field(repr=False)
    procedure: Procedure = field(repr=False)
    joint: Joint = NONE

    @classmethod
    def of(cls, design: MeasuredDesign, budget: Budget) -> Trials:
        """With the sources of the budget's calibration.

        Raises SceneError for an unknown source, or for a process with a distribution of its size.
        """
        scene = design.setup.scene
        budget, joint = with_calibrated(budget, scene)
        sources = tuple(source_of(name, scene, design.stray) for name in sorted(budget.sources))
        for source in sources:
            given = budget.sources[source.name]
            if source.is_process and given.kind != "normal":
                key = ("budget", "sources", source.name, given.kind)
                raise problem(
                    scene.name, key, f"= {given.size:g}: must be a number; a process has one size, drawn anew"
                )
        return cls(design, budget, sources, Procedure.of(design, budget), joint)

    def coarse(self, most_per_axis: int) -> Trials:
        """The same on fewer pixels."""
        return self.on(self.design.coarse(most_per_axis))

    def on(self, design: MeasuredDesign) -> Trials:
        """The same on other pixels of the design."""
        return replace(self, design=design, procedure=self.procedure.on(design))

    @property
    def parameters(self) -> tuple[Source, ...]:
        return tuple(source for source in self.sources if not source.is_process)

    @cached_property
    def values(self) -> dict[str, FloatArray]:
        """Values [trials] of the parameters by name."""
        names = [source.name for source in self.parameters]
        if not names:
            return {}
        shares = even_shares(len(names), self.budget.trials, self.budget.seed)
        return drawn(self.budget.sources, self.joint, names, shares)

    def values_of(self, trial: int) -> dict[str, float]:
        """Values of all sources in a trial; of processes, their sizes."""
        found = {source.name: self.budget.sources[source.name].size for source in self.sources if source.is_process}
        return {name: float(values[trial]) for name, values in self.values.items()} | found

    def changes_mm(self, trial: int, values: Mapping[str, float] | None = None, turn: int = 0) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in a trial with some of its sources on; all by default.

        turn: of the mirror, whose processes are other draws. The mean over the exposures.
        """
        on = self.values_of(trial) if values is None else values
        chosen, exposures = [s for s in self.sources if s.name in on], self.procedure.exposures
        total = changes_mm(self.design, [s for s in chosen if s.stays], on, Draw(self.budget.seed, trial))
        for source in chosen:
            if not source.stays:
                for repeat in range(turn * exposures, (turn + 1) * exposures):
                    draw = Draw(self.budget.seed, trial, repeat)
                    total = total + source.changes_mm(self.design, on[source.name], draw) / exposures
        return total

    def heights_mm(self, trials: Iterable[tuple[int, Mapping[str, float] | None]]) -> FloatArray:
        """Height errors [trials, n] of trials with some of their sources on, as the procedure leaves them.

        Raises NotMeasuredError where one of them cannot be measured.
        """
        measured: list[FloatArray] = []
        slices: list[tuple[slice, bool]] = []
        for trial, values in trials:
            on = self.values_of(trial) if values is None else values
            again = any(not source.stays and source.name in on for source in self.sources)
            turns = self.procedure.turns if again else 1
            start = len(measured)
            measured += [self._seen_changes_mm(trial, on, turn) for turn in range(turns)]
            figure = {
                source.name: on[source.name] for source in self.sources if source.name in on and is_figure(source)
            }
            has_figure = bool(figure) and self.procedure.turns > 1
            slices.append((slice(start, len(measured)), has_figure))
            if has_figure:
                measured.append(self._seen_changes_mm(trial, figure))
        try:
            heights = self.design.heights_mm(np.stack(measured))
        except ValueError as error:  # heights that run away
            raise NotMeasuredError(str(error)) from None
        return np.stack([
            self.procedure.of_trial(heights[part], heights[part.stop] if has_figure else None)
            for part, has_figure in slices
        ])  # fmt: skip

    def _seen_changes_mm(self, trial: int, values: Mapping[str, float], turn: int = 0) -> FloatArray:
        """As changes_mm. Raises NotMeasuredError for a set-up that cannot be, or in which a pixel sees no light."""
        try:
            found = self.changes_mm(trial, values, turn)
        except SceneError as error:
            raise NotMeasuredError(str(error)) from None
        if dark := found.shape[1] - np.count_nonzero(np.isfinite(found).all(0)):
            raise NotMeasuredError(f"{dark} of {found.shape[1]} pixels see no light of the screen")
        return found


def changes_mm(
    design: MeasuredDesign, sources: Iterable[Source], values: Mapping[str, float], draw: Draw
) -> FloatArray:
    """Changes (du, dv) [2, n] of the places by several sources at once: the geometry's together, exact, then others."""
    chosen = list(sources)
    moving = geometry_sources(chosen)
    total = np.zeros((2, design.count))
    if moving:
        total = total + geometry_changes(design, {source.name: values[source.name] for source in moving})
    for source in chosen:
        if source not in moving:
            total = total + source.changes_mm(design, values[source.name], draw)
    return total
