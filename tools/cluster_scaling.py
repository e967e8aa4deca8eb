#!/usr/bin/env python3
"""Measure traces on Dask workers of this machine, and project from that to many workers (docs/cluster.md).

tools/cluster_scaling.py [SCENE] [--workers N ...] [--rays-per-pixel N] [--rounds N] [--json]

Each worker gets one core (POCL_MAX_PTHREAD_COUNT=1). Scheduler, client and workers are processes of their own, so that
what the first two do for a task is their own processor time, whatever else runs.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil
from distributed import Client

from irtscots_cl.execution.dask.run import FAN_IN, task_seconds
from irtscots_cl.execution.dask.tasks import add_up
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.estimators.sequential import SequentialTask
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.trace import trace

MANY_TASKS = 2000  # whose cost for scheduler and client is taken
PROJECTED = (1, 10, 100, 1000, 4000)  # workers
REPLICATES = 8
HOUR = 3600.0


@contextmanager
def cluster(workers: int) -> Iterator[tuple[Client, psutil.Process]]:
    """A client of so many workers, and the scheduler's process."""
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scheduler.json"
        options = ["--no-dashboard", "--host", "127.0.0.1"]
        command = [*dask, "scheduler", "--port", "0", *options, "--scheduler-file", str(file)]
        scheduler = subprocess.Popen(command, **quiet)
        while not file.exists():
            if scheduler.poll() is not None:
                raise RuntimeError("`dask scheduler` did not start")
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"]
        command = [*dask, "worker", address, "--nthreads", "1", "--no-nanny", *options, "--local-directory", folder]
        environment = os.environ | {"POCL_MAX_PTHREAD_COUNT": "1"}
        started = [subprocess.Popen(command, env=environment, **quiet) for _ in range(workers)]
        try:
            with Client(address, set_as_default=False) as client:
                client.wait_for_workers(workers, timeout=60)
                yield client, psutil.Process(scheduler.pid)
        finally:
            for process in started:
                process.terminate()
            for process in started:  # before the scheduler, or they wait for it
                process.wait(timeout=60)
            scheduler.terminate()
            scheduler.wait(timeout=60)


def rates(client: Client, scene, rays_per_pixel: int, rounds: int) -> dict[str, float]:
    """Rays per second of a warm trace, all `rounds` of it, and tasks of the last."""
    options = {"client": client, "rays_per_pixel": rays_per_pixel, "replicates": REPLICATES}
    trace(scene, **(options | {"rays_per_pixel": REPLICATES * 16}))
    runs = [trace(scene, **options) for _ in range(rounds)]
    found = [run.rays_total / run.seconds["trace"] for run in runs]
    ran = runs[-1].device["workers"]
    return {"rays_per_second": float(np.median(found)), "lowest": min(found), "highest": max(found),
            "seconds": runs[-1].seconds["trace"], "tasks": sum(worker["tasks"] for worker in ran)}  # fmt: skip


def costs(client: Client, scheduler: psutil.Process, scene) -> dict[str, float]:
    """Processor seconds of scheduler and client for each task with its share of sums."""
    work = SequentialTask(Setup(scene), TraceOptions())
    options = {"client": client, "rays_per_pixel": MANY_TASKS // 2, "replicates": 2}
    trace(scene, **(options | {"rays_per_pixel": 16}))
    before, started = sum(scheduler.cpu_times()[:2]), time.process_time()
    run = trace(scene, launch_rays=work.sources, **options)
    tasks = sum(worker["tasks"] for worker in run.device["workers"])
    used = sum(scheduler.cpu_times()[:2]) - before, time.process_time() - started
    return {"tasks": tasks, "scheduler_seconds": used[0] / tasks, "client_seconds": used[1] / tasks}


def messages(client: Client, scene) -> dict[str, float]:
    """Size of a task's sums, and how fast they are fetched and added up."""
    shapes = SequentialTask(Setup(scene), TraceOptions()).sums_shapes
    size, fetched = 8 * sum(math.prod(shape) for shape in shapes), []
    for _ in range(5):
        future = client.submit(lambda: [np.ones(shape, np.uint64) for shape in shapes], pure=False)
        client.submit(lambda found: None, future, pure=False).result()
        started = time.perf_counter()
        client.gather(future, direct=True)
        fetched.append(size / (time.perf_counter() - started))
    found = {"sums": [np.ones(shape, np.uint64) for shape in shapes], "ran": {}}
    started = time.perf_counter()
    add_up(*[found] * FAN_IN)
    return {"sums_bytes": size, "fetched_bytes_per_second": float(np.median(fetched)),
            "add_up_seconds": time.perf_counter() - started}  # fmt: skip


def project(workers: int, work: SequentialTask, task: dict[str, float], sums: dict[str, float]) -> dict[str, float]:
    """What so many equal workers make of an hour's trace: shares of time, bytes, and seconds that it ends later."""
    _, seconds = task_seconds(work, workers)
    tasks = workers * HOUR / seconds
    depth = max(1, math.ceil(math.log(max(tasks / REPLICATES, FAN_IN), FAN_IN)))
    step = FAN_IN * sums["sums_bytes"] / sums["fetched_bytes_per_second"] + sums["add_up_seconds"]
    moved = sums["sums_bytes"] * FAN_IN / (FAN_IN - 1) / seconds  # each sum, and each sum of sums, once
    return {
        "workers": workers, "tasks": tasks, "task_seconds": seconds,
        "scheduler_share": workers * task["scheduler_seconds"] / seconds,
        "client_share": workers * task["client_seconds"] / seconds,
        "worker_bytes_per_second": moved, "tree_depth": depth,
        "idle_seconds": seconds,  # at the end, while the last tasks run
        "tree_seconds": depth * step,
        "gather_seconds": REPLICATES * sums["sums_bytes"] / sums["fetched_bytes_per_second"],
    }  # fmt: skip


def measure(options: argparse.Namespace) -> dict:
    scene, small = load_scene(options.scene), load_scene("sphere")
    found = {"scene": options.scene, "cores": os.cpu_count(), "load_before": os.getloadavg()[0], "workers": {}}
    for workers in options.workers:
        with cluster(workers) as (client, scheduler):
            found["workers"][workers] = rates(client, scene, options.rays_per_pixel, options.rounds)
            if workers == options.workers[-1]:
                found["task"], found["sums"] = costs(client, scheduler, small), messages(client, scene)
    found["load_after"] = os.getloadavg()[0]
    work = SequentialTask(Setup(scene), TraceOptions())
    found["projected"] = [project(n, work, found["task"], found["sums"]) for n in PROJECTED]
    dearest = max(("scheduler", "client"), key=lambda who: found["task"][f"{who}_seconds"])
    _, seconds = task_seconds(work, 1)
    found["saturates_first"] = {"what": dearest, "workers": seconds / found["task"][f"{dearest}_seconds"],
                                "task_seconds": seconds}  # fmt: skip
    return found


def print_text(found: dict) -> None:
    print(f"{found['scene']}, {found['cores']} cores, load {found['load_before']:.1f} to {found['load_after']:.1f}")
    for workers, row in found["workers"].items():
        print(f"{workers} worker(s): {row['rays_per_second'] / 1e6:.0f} M rays/s ({row['lowest'] / 1e6:.0f} to "
              f"{row['highest'] / 1e6:.0f}), {row['tasks']} tasks in {row['seconds']:.1f} s")  # fmt: skip
    task, sums = found["task"], found["sums"]
    print(f"a task costs the scheduler {task['scheduler_seconds'] * 1e3:.2f} ms, the client "
          f"{task['client_seconds'] * 1e3:.2f} ms (of {task['tasks']} tasks)")  # fmt: skip
    print(f"sums {sums['sums_bytes'] / 1e6:.1f} MB, fetched at {sums['fetched_bytes_per_second'] / 1e6:.0f} MB/s, "
          f"{FAN_IN} added up in {sums['add_up_seconds'] * 1e3:.0f} ms")  # fmt: skip
    head = ("workers", "tasks in an hour", "of [s]", "scheduler busy", "client busy", "MB/s at a worker",
            "levels of sums", "later by [s]: last tasks", "last sums", "fetch")  # fmt: skip
    print(f"| {' | '.join(head)} |\n{'|---' * len(head)}|")
    for row in found["projected"]:
        print(f"| {row['workers']} | {row['tasks']:.0f} | {row['task_seconds']:.0f} | {row['scheduler_share']:.1%} | "
              f"{row['client_share']:.1%} | {row['worker_bytes_per_second'] / 1e6:.1f} | {row['tree_depth']} | "
              f"{row['idle_seconds']:.0f} | {row['tree_seconds']:.1f} | {row['gather_seconds']:.1f} |")  # fmt: skip
    first = found["saturates_first"]
    print(f"were tasks of {first['task_seconds']:.0f} s with any number of workers, the {first['what']} would saturate "
          f"first, at {first['workers']:.0f} workers")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default="sphere-deviated", metavar="SCENE")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2], metavar="N")
    parser.add_argument("--rays-per-pixel", type=int, default=2**18, metavar="N")
    parser.add_argument("--rounds", type=int, default=3, metavar="N")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    found = measure(options)
    if options.json:
        print(json.dumps(found, indent=2))
    else:
        print_text(found)


if __name__ == "__main__":
    main()
