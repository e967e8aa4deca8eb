"""Time and peak memory of the trials of an error budget on Dask workers of this machine, at several numbers of trials.

python tools/budget_cluster.py sphere --workers 2 --trials 400,6400 --sources camera.x_mm,screen.z_mm
"""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

from distributed import Client, LocalCluster

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.monte_carlo import monte_carlo
from irtscots_cl.budget.sources import known_sources
from irtscots_cl.budget.trials import Trials
from irtscots_cl.execution.dask.workers import Workers
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.system.memory import peak_bytes

SHARE = 0.1  # of each usual value


def facts() -> tuple[float, float]:
    """Peak memory in MB and processor seconds of this process so far."""
    return (peak_bytes() or math.nan) / 1e6, time.process_time()


def measure(trials: Trials, client: Any) -> None:
    before, began = [facts()[1], *(one[1] for one in client.run(facts).values())], time.perf_counter()
    monte_carlo(trials, workers=Workers(client))
    wall, own, others = time.perf_counter() - began, facts(), list(client.run(facts).values())
    seconds = [one[1] - then for one, then in zip((own, *others), before, strict=True)]
    print(f"{trials.budget.trials} trials in {wall:.1f} s")
    print(f"    client and scheduler: peak so far {own[0]:.0f} MB, processor {seconds[0]:.1f} s")
    for (peak, _), taken in zip(others, seconds[1:], strict=True):
        print(f"    a worker: peak so far {peak:.0f} MB, processor {taken:.1f} s", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scene")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--trials", default="400,6400", metavar="N,N", help="default 400,6400")
    parser.add_argument("--sources", metavar="NAME,NAME", help="default all, each at a tenth of its usual value")
    options = parser.parse_args()
    scene = load_scene(options.scene)
    known = known_sources(scene)
    names = options.sources.split(",") if options.sources else list(known)
    sizes = {name: SHARE * known[name].usual for name in names}
    design = MeasuredDesign.of(Setup(scene))
    print(f"{scene.name}: {len(sizes)} sources, {design.count} pixels, {options.workers} workers")
    with (
        LocalCluster(n_workers=options.workers, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        for count in map(int, options.trials.split(",")):
            measure(Trials.of(design, Budget(sources=dict(sizes), trials=count)), client)


if __name__ == "__main__":
    main()
