"""Kills a running trace at random moments, again and again, and goes on with it: python kill_and_resume.py WHAT KILLS.

WHAT: "count", CountingJob, or "trace", a scene on a device. Prints as JSON how often a process was killed, how often
one went on in the middle, how many traces came to their end, and whether all ended with an undisturbed one's bits.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import select
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

from counting_job import RAYS, CountingJob
from synthetic import small_scene

from irtscots_cl.execution import checkpoint
from irtscots_cl.execution import run_loop as runner
from irtscots_cl.execution.checkpoint import Checkpoints
from irtscots_cl.execution.executor import RunControl
from irtscots_cl.tracing.trace import trace


def count(keeper: Checkpoints | None, progress) -> bytes:
    kept = None if keeper is None else keeper.file_of({"scene": "count"})
    return b"".join(
        a.tobytes() for a in runner.run_rays(CountingJob(size=2000), RAYS, RunControl(progress, None, kept, 4))
    )


def trace_scene(keeper: Checkpoints | None, progress) -> bytes:
    scene = small_scene("sphere-deviated", 21)
    done = trace(scene, rays_per_pixel=2**15, replicates=4, launch_rays=2**18, keeper=keeper, progress=progress)
    return done.counts.tobytes()


def child(work, path: Path | None, pipe: int) -> None:
    """In a process of its own: "started" with the first number of rays, then the digest of the result."""

    def progress(done, total, told=[]):  # noqa: B006  one child, one list
        if not told:
            told.append(os.write(pipe, b"%012d" % done))

    result = work(None if path is None else Checkpoints(path, resume=True), progress)
    os.write(pipe, hashlib.blake2b(result, digest_size=32).digest())
    os._exit(0)


def start(work, path: Path | None) -> tuple[int, int]:
    """A child's number and the pipe to read from."""
    pipe, write = os.pipe()
    number = os.fork()
    if number == 0:
        try:
            child(work, path, write)
        finally:
            os._exit(1)
    os.close(write)
    return number, pipe


def finish(number: int, pipe: int) -> bytes:
    """The digest of a child that ends by itself."""
    data = b""
    while piece := os.read(pipe, 100):
        data += piece
    os.close(pipe)
    assert os.waitpid(number, 0)[1] == 0
    return data[12:]


def main(what: str, kills: int) -> dict:
    work, dice = {"count": count, "trace": trace_scene}[what], random.Random(kills)
    checkpoint.MIN_SECONDS = checkpoint.COST_SHARE = 0  # a save after every launch
    expected = finish(*start(work, None))
    folder = Path(tempfile.mkdtemp())
    path, found = folder / "kept", {"kills": 0, "went_on": 0, "ended": 0, "equal": True, "left": []}
    begun = time.monotonic()
    first = finish(*start(work, path))
    seconds = time.monotonic() - begun  # of a trace with its saves
    found["equal"] &= first == expected
    path.unlink()
    while found["kills"] < kills:
        number, pipe = start(work, path)
        went_on = select.select([pipe], [], [], 60)[0] and int(os.read(pipe, 12)) > 2**18 * (what == "trace") + 20
        found["went_on"] += bool(went_on)
        time.sleep(dice.random() * seconds / 4)
        os.kill(number, signal.SIGKILL)
        found["kills"] += os.WIFSIGNALED(os.waitpid(number, 0)[1])
        result = os.read(pipe, 100)
        os.close(pipe)
        if len(result) == 32:
            found["ended"] += 1
            found["equal"] &= result == expected
            path.unlink()
    found["equal"] &= finish(*start(work, path)) == expected
    found["left"] = sorted(file.name for file in folder.iterdir())
    shutil.rmtree(folder)
    return found


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1], int(sys.argv[2]))))
