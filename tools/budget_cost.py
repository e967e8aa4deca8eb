"""Time and memory of an error budget of every known source of a scene, each at a tenth of its usual value, and how much
faster a trial of it is than the same trial traced and measured as a test.

OPENBLAS_NUM_THREADS=1 python tools/budget_cost.py sphere --trials 400
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from irtscots_cl.budget.assess import assess_budget
from irtscots_cl.budget.ledger import ledger
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.monte_carlo import monte_carlo
from irtscots_cl.budget.sensitivity import sensitivities
from irtscots_cl.budget.sources import known_sources
from irtscots_cl.budget.trials import Trials
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.opencl.device import select_device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.simulated_trial import MEASURE, RAYS_PER_PIXEL, trial_images, trial_scene
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.system.memory import peak_bytes

SHARE = 0.1  # of each usual value
SHARE_OF_TESTS = 1e-3  # so that all light stays on the screen: a test takes as long


def clocked(what: str, call: Callable[[], Any]) -> tuple[float, float]:
    """Prints and returns processor and wall-clock seconds."""
    processor, wall = time.process_time(), time.perf_counter()
    call()
    taken = time.process_time() - processor, time.perf_counter() - wall
    memory = (peak_bytes() or math.nan) / 1e6
    print(f"{what:44}{taken[0]:8.2f} s {taken[1]:8.2f} s   peak so far {memory:6.0f} MB", flush=True)
    return taken


def trace_and_measure(trials: Trials, trial: int, device: Any) -> None:
    """A trial as a test: traced as `irtscots run` does by default, and measured with the design's geometry."""
    scene, _ = trial_scene(trials, trial)
    nominal, options = trials.design.setup, {"rays_per_pixel": RAYS_PER_PIXEL, "seed": trial, "device": device}
    measure_by(MEASURE, trial_images(Setup(scene), nominal, options), nominal)


def compare(trials: Trials, tests: int, of_trials: tuple[float, float]) -> None:
    """Prints the time of some trials as tests, without start of a program, report and figures, beside a trial's."""
    device, count = select_device(), trials.budget.trials
    smaller = {source.name: SHARE_OF_TESTS * source.usual for source in trials.sources}
    trials = Trials.of(trials.design, replace(trials.budget, sources=smaller))
    trace_and_measure(trials, 0, device)  # builds the kernels
    taken = [clocked(f"trial {k} traced and measured as a test", lambda k=k: trace_and_measure(trials, k, device))
             for k in range(1, tests + 1)]  # fmt: skip
    print(f"\n{RAYS_PER_PIXEL} rays per pixel, {device.name}; median, least to most of {tests}")
    for what, seconds, all_trials in zip(("processor", "wall clock"), zip(*taken, strict=True), of_trials, strict=True):
        low, middle, high = min(seconds), statistics.median(seconds), max(seconds)
        own = all_trials / count
        print(
            f"{what:12}a test {middle:.2f} s ({low:.2f} to {high:.2f}), {count} of them {count * middle:.0f} s; "
            f"a trial {own:.3f} s: {middle / own:.1f} times faster ({low / own:.1f} to {high / own:.1f})"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("scene")
    parser.add_argument("--trials", type=int, default=400)
    parser.add_argument("--sources", type=int, help="only so many of the sources, evenly chosen; default all")
    parser.add_argument("--tests", type=int, default=5, help="trials that are also traced and measured; 0 for none")
    options = parser.parse_args()
    scene = load_scene(options.scene)
    known = known_sources(scene)
    if options.sources is not None:
        chosen = {k * len(known) // options.sources for k in range(options.sources)}
        known = {name: one for k, (name, one) in enumerate(known.items()) if k in chosen}
    budget = Budget(
        sources={name: SHARE * one.usual for name, one in known.items()}, trials=options.trials, allow_nm=20
    )
    design = MeasuredDesign.of_budget(Setup(scene), budget)
    print(f"{scene.name}: {len(known)} sources, {design.count} pixels; processor and wall-clock seconds")
    clocked("import, set-up", lambda: None)
    clocked(f"sensitivities of {len(known)} sources", lambda: sensitivities(design, list(known.values())))
    trials = Trials.of(design, budget)
    of_trials = clocked(f"{options.trials} trials", lambda: monte_carlo(trials))
    if options.tests:
        compare(trials, options.tests, of_trials)
    clocked("a ledger", lambda: ledger(trials, 0))
    clocked("all of `irtscots budget`, from the start", lambda: assess_budget(scene, budget))


if __name__ == "__main__":
    main()
