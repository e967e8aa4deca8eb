"""The trials of a budget on a Dask cluster of this machine's processes: the bits of this process."""

from __future__ import annotations

import json
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

distributed = pytest.importorskip("distributed", reason="pip install 'irtscots-cl[dask]'")

from dask_clusters import MARKS, addresses, at, program, run_other_code, shell_cluster, start  # noqa: E402
from small_budget import SOURCES, small_scene, small_trials  # noqa: E402

from irtscots_cl.budget.monte_carlo import monte_carlo  # noqa: E402
from irtscots_cl.budget.trial_blocks import BLOCK  # noqa: E402
from irtscots_cl.cli import main  # noqa: E402
from irtscots_cl.execution.dask.same_code import CodeError  # noqa: E402
from irtscots_cl.execution.dask.workers import AHEAD_PER_THREAD, Workers  # noqa: E402
from irtscots_cl.opencl.device import DeviceError  # noqa: E402
from irtscots_cl.scene.error_sources import Budget  # noqa: E402

pytestmark = MARKS
ROOT = Path(__file__).parents[2]
FAILING = SOURCES | {"screen.tilt_x_rad": 1.2}  # a quarter of the trials have a screen that looks away
MANY = 24 * BLOCK


@pytest.fixture(scope="module")
def two():
    """A client of two workers, which have no device."""
    with start(2) as local, distributed.Client(local) as client:
        client.run(have_no_device)
        yield client


def have_no_device():
    os.environ["IRTSCOTS_DEVICE"] = "no such device"


def assert_same(far, near):
    for name in ("rms_nm", "zernike_nm", "mean_mm", "deviation_mm"):
        np.testing.assert_array_equal(getattr(far, name), getattr(near, name), name)
    assert far.failed == near.failed and list(far.failed) == list(near.failed)


def begun_at(seconds, number):
    """A task: when it began, by this machine's clock. The first one takes long."""
    began = time.monotonic()
    time.sleep(seconds if number == 0 else 0)
    return number, began


def refuse(number):
    raise ValueError(f"{number}: must be another")


def test_a_cluster_gives_the_bits_of_this_process_also_of_trials_that_fail(two):
    seen, trials = [], small_trials(70, FAILING, pixels=31)
    far = monte_carlo(trials, seen.append, Workers(two))
    assert seen == [16, 32, 48, 64, 70]
    near = monte_carlo(trials)
    assert_same(far, near)
    assert 5 < len(near.failed) < 50


def test_results_come_in_order_and_few_are_made_ahead(two):
    found = list(Workers(two).in_order(begun_at, range(40), 0.5))
    assert [number for number, _ in found] == list(range(40))
    ahead = AHEAD_PER_THREAD * 2  # of two workers
    began = [when - found[0][1] for _, when in found]
    assert sum(when < 0.5 for when in began) > ahead / 2  # made while the first one takes long
    assert min(began[ahead:]) > 0.5  # too many at once


def test_an_error_of_a_task_says_which_worker_and_the_others_are_cancelled(two):
    with pytest.raises(ValueError, match=r"^--dask: worker tcp://\S+: 0: must be another$"):
        list(Workers(two).in_order(refuse, range(40)))
    wait_until(lambda: not any(two.processing().values()))


@pytest.mark.long  # of traces on a cluster: tests/execution/test_cluster.py
def test_a_killed_worker_s_blocks_are_done_by_the_other(fresh):
    local, client = fresh
    victim, trials = local.workers[0].pid, small_trials(MANY, pixels=21)
    progress = at(0.2, lambda: os.kill(victim, signal.SIGKILL))
    far = monte_carlo(trials, lambda count: progress(count, MANY), Workers(client))
    assert_same(far, monte_carlo(trials))
    with pytest.raises(ProcessLookupError):
        os.kill(victim, 0)


@pytest.mark.slow
def test_other_code_on_a_worker_is_refused_in_one_line(fresh):
    _, client = fresh
    other, trials = addresses(client)[0], small_trials(MANY, pixels=21)
    before = Workers(client)
    client.run(run_other_code, workers=[other])
    must = f"--dask: worker {other} runs other code than this irtscots-cl: must be the same version on both sides"
    with pytest.raises(CodeError, match=f"^{must}$"):
        Workers(client)
    with pytest.raises(CodeError, match=f"^{must}$"):  # of a worker that came after the greeting
        monte_carlo(trials, workers=before)


@pytest.mark.slow
def test_without_workers_or_scheduler_one_line(impatient):
    trials = small_trials(MANY, pixels=21)
    with start(0) as local, distributed.Client(local, timeout=1) as client:
        with pytest.raises(DeviceError, match=r"^--dask: no worker came within 0\.5 s$"):
            Workers(client)
        for then, line in ((lambda: local.scale(0), r"no worker for 0\.5 s"), (local.close, "the scheduler is gone")):
            local.scale(1)
            client.wait_for_workers(1)
            progress = at(0.1, then)
            with pytest.raises(DeviceError, match=f"^--dask: {line}"):
                monte_carlo(trials, lambda count: progress(count, MANY), Workers(client))  # noqa: B023


@pytest.mark.parametrize(
    "options, line",
    [
        (["sphere"], "--dask: must have a scene with error sources: give them in [budget.sources]"),
        (["sphere", "--result", "a.h5"], "--dask: must be left out with --result"),
        (["{scene}"], "--dask = 'tcp://127.0.0.1:1': no scheduler answers: "),
    ],
)
def test_the_command_line_refuses_in_one_line(impatient, tmp_path, capsys, options, line):
    scene = scene_file(tmp_path, 16)
    assert main(["budget", *(text.format(scene=scene) for text in options), "--dask", "tcp://127.0.0.1:1"]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith(f"irtscots: {line}")


def scene_file(folder, trials):
    path = folder / "scene.toml"
    path.write_text(replace(small_scene(31), budget=Budget(sources=dict(SOURCES), trials=trials)).to_toml())
    return str(path)


@pytest.mark.slow
def test_a_budget_from_the_shell(two, tmp_path, capsys):
    scene = scene_file(tmp_path, 40)
    told = []
    for where in ([], ["--dask", two.scheduler.address]):
        assert main(["budget", scene, "--json", "--quiet", *where]) == 0
        told.append(json.loads(capsys.readouterr().out))
    assert told[0] == told[1]


@pytest.mark.long  # of traces on a cluster: tests/execution/test_cluster.py
def test_a_signal_ends_a_budget_on_a_cluster(tmp_path):
    scene = scene_file(tmp_path, 2**17)
    with shell_cluster(tmp_path) as (address, worker):
        worker()
        with distributed.Client(address, set_as_default=False) as client:
            run = program("irtscots_cl", "budget", scene, "--dask", address, "--quiet", PYTHONPATH=str(ROOT))
            wait_until(lambda: any(client.processing().values()))
            run.send_signal(signal.SIGTERM)
            started = time.monotonic()
            out, err = run.communicate(timeout=60)
            assert time.monotonic() - started < 15  # on a loaded machine; a second or two without load
            assert (run.returncode, out, err) == (130, "", "irtscots: interrupted; nothing was written\n")


def wait_until(true):
    limit = time.monotonic() + 60
    while not true():
        assert time.monotonic() < limit
        time.sleep(0.05)
