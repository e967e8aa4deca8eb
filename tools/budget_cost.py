"""Processor seconds and memory of an error budget of every known source of a scene, each at a tenth of its usual value.

OPENBLAS_NUM_THREADS=1 python tools/budget_cost.py sphere --trials 400
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from typing import Any

from irtscots_cl.budget.assess import assess
from irtscots_cl.budget.ledger import ledger
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.monte_carlo import monte_carlo
from irtscots_cl.budget.sensitivity import sensitivities
from irtscots_cl.budget.sources import known_sources
from irtscots_cl.budget.trials import Trials
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.system.memory import peak_bytes

SHARE = 0.1  # of each usual value


def clocked(what: str, call: Callable[[], Any]) -> None:
    began = time.process_time()
    call()
    memory = (peak_bytes() or math.nan) / 1e6
    print(f"{what:44}{time.process_time() - began:8.2f} s   peak so far {memory:6.0f} MB", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scene")
    parser.add_argument("--trials", type=int, default=400)
    options = parser.parse_args()
    scene = load_scene(options.scene)
    known = known_sources(scene)
    sizes = {name: SHARE * one.usual for name, one in known.items()}
    budget = Budget(sources=sizes, trials=options.trials, allow_nm=20)
    design = MeasuredDesign.of(Setup(scene))
    print(f"{scene.name}: {len(known)} sources, {design.count} pixels")
    clocked("import, set-up", lambda: None)
    clocked(f"sensitivities of {len(known)} sources", lambda: sensitivities(design, list(known.values())))
    trials = Trials.of(design, budget)
    clocked(f"{options.trials} trials", lambda: monte_carlo(trials))
    clocked("a ledger", lambda: ledger(trials, 0))
    clocked("all of `irtscots budget`, from the start", lambda: assess(scene, budget))


if __name__ == "__main__":
    main()
