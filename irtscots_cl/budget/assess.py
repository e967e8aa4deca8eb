"""The error budget of a test: sensitivities, linear prediction, trials and one trial's ledger together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from irtscots_cl.budget.ledger import Ledger, ledger
from irtscots_cl.budget.linear import LinearBudget, linear_budget
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.monte_carlo import MonteCarlo, Workers, monte_carlo
from irtscots_cl.budget.sensitivity import DRAWS, MANY_DRAWS, Sensitivity, sensitivities
from irtscots_cl.budget.sources import known_sources
from irtscots_cl.budget.tolerances import QuadraticError, Tolerances, tolerances
from irtscots_cl.budget.trials import NotMeasuredError, Trials
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.option_error import OptionError
from irtscots_cl.system.shown import html_table, one_line

if TYPE_CHECKING:
    from irtscots_cl.budget.stray_paths import RayNoise

LARGEST = 3  # sources that a summary names
MOST_MAPS = 1024  # of draws of all processes: time and memory do not grow with their number


@dataclass(frozen=True)
class ErrorBudget:
    """sensitivities: of all sources that there are, and those of the budget. linear, monte_carlo, ledger: of the
    budget's sources; None without any. trial: whose ledger it is; None, too, for one that cannot be measured, with the
    reason in no_ledger. tolerances: None where nothing is said to be allowed. ray_noise: of the sources of a file of
    stray light, the budget's or, without any, all that there are.
    """

    trials: Trials
    sensitivities: dict[str, Sensitivity] = field(repr=False)
    linear: LinearBudget | None = field(repr=False)
    monte_carlo: MonteCarlo | None = field(repr=False)
    trial: int
    ledger: Ledger | None = field(repr=False)
    tolerances: Tolerances | None = field(repr=False)
    no_ledger: str = ""
    ray_noise: tuple[RayNoise, ...] = ()

    __repr__ = one_line
    _repr_html_ = html_table

    def summary(self) -> dict[str, str]:
        """Of the sources together, and of the largest ones, nm rms without piston and tilt."""
        scene, budget = self.trials.design.setup.scene, self.trials.budget
        if self.linear is None or self.monte_carlo is None:
            return {"scene": scene.name, "sources": "none; sensitivities of all that there are"}
        largest = sorted(self.linear.nm, key=lambda name: -self.linear.nm[name][0])[:LARGEST]
        return {
            "scene": scene.name,
            "sources": str(len(self.linear.nm)),
            "all together": f"{self.linear.total_nm[0]:.3g} nm rms, linear",
            "trials": f"{budget.trials}, {self.monte_carlo.root_mean_square_nm[0]:.3g} nm rms",
            "largest": ", ".join(f"{name} {self.linear.nm[name][0]:.3g} nm" for name in largest),
        }


def assess_budget(
    scene: Scene | Setup,
    budget: Budget | None = None,
    trial: int = 0,
    done: Callable[[int], None] = lambda count: None,
    workers: Workers | None = None,
) -> ErrorBudget:
    """The error budget of a scene's design. Needs no device.

    budget: by default the scene's own. trial: whose ledger is made. done: called with the number of finished trials.
    workers: who work on the trials, as for monte_carlo; all else is done here. Raises SceneError for an unknown source,
    a set-up without light or fewer than two trials that can be measured, ValueError for a trial that there is not, and
    the errors of the workers.
    """
    setup = Setup.of(scene)
    budget = budget or setup.scene.budget or Budget()
    if not 0 <= trial < budget.trials:
        raise OptionError(f"--trial = {trial}: must be from 0 to {budget.trials - 1}")
    design = MeasuredDesign.of_budget(setup, budget)
    trials = Trials.of(design, budget)
    known = known_sources(setup.scene, design.stray, design.maps)
    others = [source for name, source in known.items() if name not in trials.budget.sources]
    found = {one.source.name: one for one in sensitivities(design, others, procedure=trials.procedure)}
    found |= own_sensitivities(trials)
    budget = trials.budget
    noise = rays_of_stray_light(trials)
    if not budget.sources:
        return ErrorBudget(trials, found, None, None, trial, None, None, ray_noise=noise)
    own = {name: found[name] for name in budget.sources}
    allowed = None
    if budget.allow_nm is not None:
        allowed = tolerances(QuadraticError(design, own, budget.sources, joint=trials.joint), budget.allow_nm)
    linear = linear_budget(design, own, budget.sources, trials.joint)
    spread = monte_carlo(trials, done, workers)
    try:
        rows, why = ledger(trials, trial), ""
    except NotMeasuredError as error:
        rows, why = None, str(error)
    return ErrorBudget(trials, found, linear, spread, trial, rows, allowed, why, noise)


def rays_of_stray_light(trials: Trials) -> tuple[RayNoise, ...]:
    """Of the sources of a file of stray light, at their sizes; without any sources, of all that the file has."""
    if not trials.design.stray:
        return ()
    from irtscots_cl.budget.stray_paths import known_stray, ray_noise  # imported late: few budgets have such a file

    given = trials.budget.sources
    return tuple(
        ray_noise(trials.procedure, source, given[name].size if name in given else source.usual)
        for name, source in known_stray(trials.design.stray).items()
        if name in given or not given
    )


def own_sensitivities(trials: Trials) -> dict[str, Sensitivity]:
    """Of the budget's sources by name, with enough draws of processes for intervals."""
    processes = sum(source.kind.is_random for source in trials.sources)
    draws = max(DRAWS, min(MANY_DRAWS, MOST_MAPS // max(processes, 1)))
    sizes = {name: given.size for name, given in trials.budget.sources.items()}
    found = sensitivities(trials.design, trials.sources, draws, trials.procedure, sizes)
    return {one.source.name: one for one in found}
