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
from irtscots_cl.budget.geometry import geometry_view
from irtscots_cl.budget.joint import NONE, Joint, with_calibrated
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.procedure import Procedure, is_figure
from irtscots_cl.budget.source import Draw, Kind, Source, lit_changes
from irtscots_cl.budget.sources import geometry_sources, source_of
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.validation import SceneError, problem

LEAST_SHARE = 0.5  # of the pixels that a test must measure


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

        Raises SceneError for an unknown source, or for a constant or a process with a distribution of its size.
        """
        scene = design.setup.scene
        budget, joint = with_calibrated(budget, scene)
        sources = tuple(source_of(name, scene, design.stray, design.maps) for name in sorted(budget.sources))
        for source in sources:
            given = budget.sources[source.name]
            if source.kind is not Kind.PARAMETER and (given.kind != "normal" or given.set_ups is not None):
                key = ("budget", "sources", source.name, given.kind)
                text = f"must be a number; a {source.kind.value} has one size"
                raise problem(scene.name, key, text, given.size)
        return cls(design, budget, sources, Procedure.of(design, budget), joint)

    def coarse(self, most_per_axis: int) -> Trials:
        """The same on fewer pixels."""
        return self.on(self.design.coarse(most_per_axis))

    def on(self, design: MeasuredDesign) -> Trials:
        """The same on other pixels of the design."""
        return replace(self, design=design, procedure=self.procedure.on(design))

    @property
    def parameters(self) -> tuple[Source, ...]:
        return tuple(source for source in self.sources if source.kind is Kind.PARAMETER)

    @cached_property
    def values(self) -> dict[str, FloatArray]:
        """Values [trials] of the parameters by name."""
        names = [source.name for source in self.parameters]
        if not names:
            return {}
        shares = even_shares(len(names), self.budget.trials, self.budget.seed)
        return drawn(self.budget.sources, self.joint, names, shares)

    def values_of(self, trial: int) -> dict[str, float]:
        """Values of all sources in a trial; of constants and processes, their sizes."""
        others = [source.name for source in self.sources if source.kind is not Kind.PARAMETER]
        found = {name: self.budget.sources[name].size for name in others}
        return {name: float(values[trial]) for name, values in self.values.items()} | found

    def changes_mm(self, trial: int, values: Mapping[str, float] | None = None, turn: int = 0) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in a trial with some of its sources on; all by default.

        turn: of the mirror, whose processes are other draws. The mean over the exposures. NaN where a chief ray misses
        the mirror's surface.
        """
        return self._changes_and_view(trial, self.values_of(trial) if values is None else values, turn)[0]

    def _changes_and_view(self, trial: int, on: Mapping[str, float], turn: int) -> tuple[FloatArray, BoolArray]:
        """As changes_mm; and which pixels [n] see light."""
        chosen, exposures = [s for s in self.sources if s.name in on], self.procedure.exposures
        total, sees = changes_and_view(
            self.design, [s for s in chosen if s.kind.stays], on, Draw(self.budget.seed, trial)
        )
        for source in chosen:
            if not source.kind.stays:
                for repeat in range(turn * exposures, (turn + 1) * exposures):
                    draw = Draw(self.budget.seed, trial, repeat)
                    changes, lit = lit_changes(source, self.design, on[source.name], draw)
                    total, sees = total + changes / exposures, sees & lit
        return total, sees

    def heights_mm(self, trials: Iterable[tuple[int, Mapping[str, float] | None]]) -> FloatArray:
        """Height errors [trials, n] of trials with some of their sources on, as the procedure leaves them.

        Raises NotMeasuredError where one of them cannot be measured.
        """
        return self.heights_and_lost(trials)[0]

    def heights_and_lost(
        self, trials: Iterable[tuple[int, Mapping[str, float] | None]]
    ) -> tuple[FloatArray, FloatArray]:
        """As heights_mm; and the share [trials] of the pixels that have lost the mirror or the screen out of view."""
        measured: list[FloatArray] = []
        slices: list[tuple[slice, bool]] = []
        lost: list[float] = []
        for trial, values in trials:
            on = self.values_of(trial) if values is None else values
            again = any(not source.kind.stays and source.name in on for source in self.sources)
            turns = self.procedure.turns if again else 1
            start = len(measured)
            changes, shares = zip(*(self._measured(trial, on, turn) for turn in range(turns)), strict=True)
            measured += changes
            lost.append(max(shares))
            figure = {
                source.name: on[source.name] for source in self.sources if source.name in on and is_figure(source)
            }
            has_figure = bool(figure) and self.procedure.turns > 1
            slices.append((slice(start, len(measured)), has_figure))
            if has_figure:
                measured.append(self._measured(trial, figure)[0])
        try:
            # one by one: the last bits depend on how many maps are integrated together
            heights = np.concatenate([self.design.heights_mm(one[None]) for one in measured])
        except ValueError as error:  # heights that run away
            raise NotMeasuredError(str(error)) from None
        left = [
            self.procedure.of_trial(heights[part], heights[part.stop] if has_figure else None)
            for part, has_figure in slices
        ]
        return np.stack(left), np.array(lost)

    def _measured(self, trial: int, on: Mapping[str, float], turn: int = 0) -> tuple[FloatArray, float]:
        """Changes [2, n] and the share of the pixels that is lost.

        Raises NotMeasuredError for a set-up that cannot be, a chief ray that misses the mirror's surface, or where too
        few pixels are left.
        """
        try:
            found, sees = self._changes_and_view(trial, on, turn)
        except SceneError as error:
            raise NotMeasuredError(str(error)) from None
        count = len(sees)
        if missed := count - np.count_nonzero(np.isfinite(found).all(0)):
            raise NotMeasuredError(
                f"the chief rays of {missed} of {count} pixels miss the surfaces of mirror or screen"
            )
        left = np.count_nonzero(sees)
        if left < LEAST_SHARE * count:
            raise NotMeasuredError(f"{left} of {count} pixels still see the screen's light in the mirror; too few")
        return found, 1 - left / count


def changes_and_view(
    design: MeasuredDesign, sources: Iterable[Source], values: Mapping[str, float], draw: Draw
) -> tuple[FloatArray, BoolArray]:
    """Changes (du, dv) [2, n] of the places by several sources at once: the geometry's together, exact, then others.

    And which pixels [n] see light. One that a source leaves without light keeps its place by that source.
    """
    chosen = list(sources)
    moving = geometry_sources(chosen)
    total, sees = np.zeros((2, design.count)), np.ones(design.count, bool)
    if moving:
        total, sees = geometry_view(design, {source.name: values[source.name] for source in moving})
    for source in chosen:
        if source not in moving:
            changes, lit = lit_changes(source, design, values[source.name], draw)
            total, sees = total + changes, sees & lit
    return total, sees
