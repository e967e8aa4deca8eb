"""Dask clusters of this machine's processes, and what tests do to their workers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

MARKS = [
    pytest.mark.cluster,
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # distributed leaves sockets to the garbage collector
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


def start(workers: int):
    """A cluster of so many workers of one thread each."""
    import distributed

    return distributed.LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0")


def addresses(client) -> list[str]:
    return sorted(client.nthreads())


def run_other_code() -> None:
    """For a worker to run."""
    from irtscots_cl.execution.dask import same_code

    same_code.code_hash = lambda: "other"


def be_impatient(monkeypatch) -> None:
    """Short waits for workers and schedulers."""
    from irtscots_cl.execution.dask import run, workers

    for name, seconds in (("WAIT_SECONDS", 0.5), ("POLL_SECONDS", 0.1), ("CONNECT_SECONDS", 0.5)):
        for module in (workers, run):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, seconds)


def at(share: float, then):
    """A progress function that calls then() once, when that share of the work is done."""
    called = []

    def progress(done, total):
        if done >= share * total and not called:
            called.append(True)
            then()

    return progress


def program(*arguments: str, **environment: str) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-m", *arguments], env=os.environ | environment, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)  # fmt: skip


@contextmanager
def shell_cluster(folder: Path):
    """A scheduler by Dask's command: its address, and a function of environment variables that starts a worker."""
    file = folder / "scheduler.json"
    started = [program("dask", "scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1",
                       "--scheduler-file", str(file))]  # fmt: skip
    while not file.exists():
        assert started[0].poll() is None, started[0].communicate()
        time.sleep(0.05)
    address = json.loads(file.read_text())["address"]

    def worker(**environment):
        started.append(program("dask", "worker", address, "--nthreads", "1", "--no-dashboard", "--local-directory",
                               str(folder), **environment))  # fmt: skip

    try:
        yield address, worker
    finally:
        for process in reversed(started):  # workers before the scheduler, or they wait for it
            process.terminate()
            process.communicate(timeout=30)
