"""A Dask cluster of this machine's processes: the bits of one device; workers that come, go and fail."""

from __future__ import annotations

import json
import logging
import os
import pickle
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

distributed = pytest.importorskip("distributed", reason="pip install 'irtscots-cl[dask]'")

from dask_clusters import MARKS, addresses, at, program, run_other_code, shell_cluster, start  # noqa: E402
from scenes import coarse  # noqa: E402

from irtscots_cl.cli import main  # noqa: E402
from irtscots_cl.execution.checkpoint import Checkpoints, Interrupted  # noqa: E402
from irtscots_cl.execution.dask.cluster import DaskExecutor  # noqa: E402
from irtscots_cl.execution.dask.run import MIN_TASK_SECONDS, TASK_SECONDS, ClusterRun  # noqa: E402
from irtscots_cl.execution.dask.same_code import CodeError  # noqa: E402
from irtscots_cl.execution.dask.tasks import WorkerError, add_up, trace_block  # noqa: E402
from irtscots_cl.execution.dask.workers import connect  # noqa: E402
from irtscots_cl.execution.executor import RunControl  # noqa: E402
from irtscots_cl.opencl.device import DeviceError  # noqa: E402
from irtscots_cl.optics.setup import Setup  # noqa: E402
from irtscots_cl.pipeline.simulate import simulate  # noqa: E402
from irtscots_cl.system.atomic_files import plain  # noqa: E402
from irtscots_cl.tracing.estimators.sequential import SequentialTask  # noqa: E402
from irtscots_cl.tracing.options import TraceOptions  # noqa: E402
from irtscots_cl.tracing.trace import trace  # noqa: E402

pytestmark = MARKS
SMALL = {"rays_per_pixel": 600, "replicates": 2, "seed": 5}
ROOT = Path(__file__).parents[2]
MANY = 3000  # rays of a task, where there are to be many


@pytest.fixture(scope="module")
def two():
    """A client of two workers, for tests that leave them as they are."""
    with start(2) as local, distributed.Client(local) as client:
        yield client


def assert_same(far, near):
    for axis in ("x", "y"):
        np.testing.assert_array_equal(far.line_flux_w(axis), near.line_flux_w(axis))
    assert far.ledger == near.ledger


# --- functions that tests run on workers -------------------------------------------------------------------


def break_device(after):
    """Every launch but the first `after` fails."""
    from irtscots_cl.execution.device_tracer import DeviceTracer

    whole, count = DeviceTracer.launch, [0]

    def launch(self, *arguments):
        count[0] += 1
        if count[0] > after:
            raise DeviceError("device 0:0 broken: out of order")
        return whole(self, *arguments)

    DeviceTracer.launch = launch


def have_no_device():
    os.environ["IRTSCOTS_DEVICE"] = "no such device"


# --- the bits ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{}, {"estimator": "forward", "aim": "camera"}, {"smoothing": True}])
def test_a_cluster_gives_the_bits_of_one_device(device, two, options):
    far = trace(coarse(), client=two, **SMALL, **options)
    assert_same(far, trace(coarse(), device=device, **SMALL, **options))
    assert far.device["name"].endswith(device.name) and far.device["driver"] == device.driver


def test_many_tasks_give_the_bits_of_one_device_and_all_workers_take_part(device, two):
    seen = []
    far = trace(coarse(), client=two, launch_rays=MANY, progress=lambda *done: seen.append(done), **SMALL)
    assert_same(far, trace(coarse(), device=device, **SMALL))
    workers = far.device["workers"]
    assert [worker["worker"] for worker in workers] == addresses(two)
    assert sum(worker["tasks"] for worker in workers) > 64  # sums of sums of sums
    assert sum(worker["rays"] for worker in workers) == far.rays_total
    assert all(worker["seconds"] > 0 and worker["device"]["name"] == device.name for worker in workers)
    assert seen == sorted(seen) and seen[-1] == (far.rays_total, far.rays_total)
    assert 0 < far.seconds["kernels"] <= far.seconds["trace"]


def test_paths_have_the_bits_of_one_device(device, two):
    options = {"estimator": "nonsequential", "rays_per_pixel": 64, "replicates": 2}
    far, near = (trace(coarse("ghosts"), **options, **where) for where in ({"client": two}, {"device": device}))
    np.testing.assert_array_equal(far.images_w, near.images_w)
    assert far.paths == near.paths and far.ends == near.ends


def test_a_whole_trace_as_a_task_stays_where_it_was_made(device, two):
    """What docs/cluster.md tells studies of many scenes to do."""
    run = two.submit(trace, coarse(), **SMALL)
    curves = two.submit(lambda run: run.line_flux_w("x"), run).result()
    np.testing.assert_array_equal(curves, trace(coarse(), device=device, **SMALL).line_flux_w("x"))


def test_an_interrupted_trace_goes_on_on_a_device_and_back(device, two, tmp_path):
    more = {"rays_per_pixel": 600, "replicates": 4}
    whole = trace(coarse(), device=device, **more)

    def run(where, stop_at, resume):
        keeper = Checkpoints(tmp_path / "kept", resume)

        def stop(done, total):
            time.sleep(0.03)  # so that totals come in meanwhile
            keeper.stop = done >= total * stop_at

        return trace(coarse(), progress=stop, keeper=keeper, launch_rays=20_000, **more, **where)

    with pytest.raises(Interrupted, match=r"after (25|50|75)% of the rays"):  # whole replicates
        run({"client": two}, 0.9, False)
    with pytest.raises(Interrupted, match=r"after 9\d% of the rays"):
        run({"device": device}, 0.9, True)
    assert_same(run({"client": two}, 2.0, True), whole)


def test_sums_are_not_added_into_an_input():
    one = {"sums": [np.array([1, 2], np.uint64)], "ran": {}}
    assert add_up(one, one)["sums"][0].tolist() == [2, 4] and one["sums"][0].tolist() == [1, 2]


# --- workers that come, go and fail ------------------------------------------------------------------------


def test_a_killed_worker_s_work_is_done_by_the_others(device, fresh):
    local, client = fresh
    victim = local.workers[0].pid

    def kill():
        os.kill(victim, signal.SIGKILL)

    far = trace(coarse(), client=client, launch_rays=MANY, progress=at(0.3, kill), **SMALL)
    assert_same(far, trace(coarse(), device=device, **SMALL))
    with pytest.raises(ProcessLookupError):
        os.kill(victim, 0)


def test_a_worker_whose_device_fails_is_left_out_and_one_that_joins_takes_part(device, fresh, caplog):
    local, client = fresh
    broken, good = addresses(client)
    client.run(break_device, 5, workers=[broken])

    def join():
        local.scale(3)
        client.wait_for_workers(3)

    with caplog.at_level(logging.WARNING, "irtscots_cl"):
        far = trace(coarse(), client=client, launch_rays=MANY, progress=at(0.1, join), **SMALL)
    assert_same(far, trace(coarse(), device=device, **SMALL))
    said = [record.message for record in caplog.records if record.name.startswith("irtscots_cl")]
    assert said == [f"left out: worker {broken}: device 0:0 broken: out of order"]
    new = set(addresses(client)) - {broken, good}
    assert {good, *new} <= {worker["worker"] for worker in far.device["workers"]} and new
    client.run(have_no_device, workers=[good, *new])
    with pytest.raises(DeviceError, match=r"^--dask: all workers failed: worker tcp://\S+: [^\n]*$"):
        trace(coarse(), client=client, **SMALL)


def test_other_code_on_a_worker_is_refused_in_one_line(fresh):
    _, client = fresh
    other = addresses(client)[0]
    executor = DaskExecutor(client)
    client.run(run_other_code, workers=[other])
    must = f"--dask: worker {other} runs other code than this irtscots-cl: must be the same version on both sides"
    with pytest.raises(CodeError, match=f"^{must}$"):
        DaskExecutor(client)
    work = SequentialTask(Setup(coarse()), TraceOptions())
    with pytest.raises(CodeError, match=f"^{must}$"):  # of a worker that came after the greeting
        executor.run(work, np.array([10, 10]), RunControl(launch_rays=100))


def test_a_task_says_which_worker_failed():
    error = WorkerError("tcp://a:1", "device: broken")
    again = pickle.loads(pickle.dumps(error))
    assert (again.worker, again.line) == ("tcp://a:1", "device: broken")
    assert trace_block.__module__ == "irtscots_cl.execution.dask.tasks"  # found by name on workers


def test_without_workers_one_line(impatient):
    with start(0) as local, distributed.Client(local) as client:
        with pytest.raises(DeviceError, match=r"^--dask: no worker came within 0\.5 s$"):
            DaskExecutor(client)
        local.scale(1)
        client.wait_for_workers(1)
        progress = at(0.2, lambda: local.scale(0))
        with pytest.raises(DeviceError, match=r"^--dask: no worker for 0\.5 s$"):
            trace(coarse(), client=client, launch_rays=MANY, progress=progress, **SMALL)


def test_a_scheduler_that_is_gone_is_one_line(impatient):
    local = start(1)
    with distributed.Client(local, timeout=1) as client:
        progress = at(0.2, local.close)
        with pytest.raises(DeviceError, match="^--dask: the scheduler is gone"):
            trace(coarse(), client=client, launch_rays=MANY, progress=progress, **SMALL)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "no such scheme://x", "host", ""])
def test_an_address_without_scheduler_is_refused_in_one_line(impatient, address):
    with pytest.raises(ValueError, match=r"^--dask = '[^\n]*must be the address of a Dask scheduler[^\n]*$"):
        connect(address)


def test_without_dask_the_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ValueError, match=r"^--dask = 'tcp://a:1': needs Dask: pip install 'irtscots-cl\[dask\]'$"):
        connect("tcp://a:1")


def test_a_device_beside_a_client_is_refused(device, two):
    with pytest.raises(ValueError, match="^device: must be left out with a client"):
        trace(coarse(), client=two, device=device)


def test_tasks_are_longer_where_sums_are_large_or_workers_many(two, monkeypatch):
    """No trace: the size of parts by measured speed, near the beginning and near the end."""
    work = SequentialTask(Setup(coarse()), TraceOptions())
    run = ClusterRun(DaskExecutor(two), work, np.array([2**30]), RunControl())
    run._threads = {"a": 1, "b": 1}
    assert run._next_rays() == work.first_launch_rays
    run._speeds = [1e6, 2e6, 3e6]
    assert run._next_rays() == pytest.approx(2e6 * TASK_SECONDS, abs=2)
    monkeypatch.setattr(SequentialTask, "sums_shapes", ((10**8,),))
    assert run._next_rays() == pytest.approx(2e6 * 80, abs=2)
    run._to_cut = 4_000_000
    assert run._next_rays() == pytest.approx(1e6, abs=2)
    run._to_cut = 1
    assert run._next_rays() == pytest.approx(2e6 * MIN_TASK_SECONDS, abs=2)
    run._threads = {str(k): 2 for k in range(500)}
    monkeypatch.setattr(SequentialTask, "sums_shapes", ((10,),))
    assert run._next_rays() == pytest.approx(2e6 * 10, abs=2)  # the scheduler gets 100 tasks a second


# --- from the shell ----------------------------------------------------------------------------------------


@pytest.fixture
def shell(tmp_path):
    """A scheduler by Dask's command and what starts its workers."""
    with shell_cluster(tmp_path) as found:
        yield found


@pytest.mark.slow
def test_run_and_paths_on_a_cluster_from_the_shell(device, shell, tmp_path, capsys, caplog):
    address, worker = shell
    scene, out = str(tmp_path / "scene.toml"), str(tmp_path / "out")
    (tmp_path / "scene.toml").write_text(coarse().to_toml())
    run = ["run", scene, "--dask", address, "--out", out, "--rays-per-pixel", "600", "--replicates", "2", "--seed", "5"]
    worker(IRTSCOTS_DEVICE="no such device")
    assert main(run) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("irtscots: --dask: all workers failed: worker tcp://")
    worker()
    with distributed.Client(address, set_as_default=False) as client:
        client.wait_for_workers(2)
    caplog.clear()
    assert main([*run, "--json"]) == 0
    assert len([record for record in caplog.records if record.name.startswith("irtscots_cl")]) == 1  # left out, once
    far, near = json.loads(capsys.readouterr().out), simulate(coarse(), device=device, **SMALL).report
    for key in ("ledger", "slope_error_urad_rms", "height_error_nm_rms", "zernike", "rays_total"):
        assert far[key] == plain(near[key])
    (ran,) = far["device"]["workers"]  # the other one was left out
    assert ran["rays"] == far["rays_total"] and ran["device"]["name"] == device.name
    assert main(["paths", scene, "--rays-per-pixel", "2048", "--json", "--dask", address]) == 0
    assert json.loads(capsys.readouterr().out)["device"]["workers"]


def wait_until(address: str, is_so) -> None:
    """Until a function of the scheduler is true, for at most a minute."""
    with distributed.Client(address, set_as_default=False) as client:
        for _ in range(240):
            if client.run_on_scheduler(is_so):
                return
            time.sleep(0.25)
    raise AssertionError("not within a minute")


@pytest.mark.parametrize("with_worker", [False, True], ids=["waiting for a worker", "tracing"])
def test_a_signal_ends_a_run_on_a_cluster(device, shell, tmp_path, with_worker):
    address, worker = shell
    (tmp_path / "scene.toml").write_text(coarse().to_toml())
    if with_worker:
        worker()
        with distributed.Client(address, set_as_default=False) as client:
            client.wait_for_workers(1)
    run = program("irtscots_cl", "run", str(tmp_path / "scene.toml"), "--dask", address, "--out", str(tmp_path / "out"),
                  "--rays-per-pixel", str(2**34), "--replicates", "2", "--quiet", PYTHONPATH=str(ROOT))  # fmt: skip
    wait_until(
        address,  # lambdas: they travel by value, as the scheduler has no tests
        (lambda dask_scheduler: any("trace_block" in str(key) for key in dask_scheduler.tasks)) if with_worker
        else (lambda dask_scheduler: len(set(dask_scheduler.clients) - {"fire-and-forget"}) > 1),
    )  # fmt: skip
    run.send_signal(signal.SIGTERM)
    started = time.monotonic()
    out, err = run.communicate(timeout=60)
    assert time.monotonic() - started < 15  # on a loaded machine; a second or two without load
    if with_worker:  # nothing is saved before a whole replicate, but the place is
        assert (run.returncode, out) == (4, "")
        assert err.startswith("irtscots: interrupted after 0% of the rays; continue with --resume, from ")
    else:
        assert (run.returncode, out, err) == (130, "", "irtscots: interrupted; nothing was written\n")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "arguments, line",
    [
        (["--dask", "tcp://127.0.0.1:1"], "--dask = 'tcp://127.0.0.1:1': no scheduler answers: "),
        (["--dask", "tcp://127.0.0.1:1", "--device", "cpu"], "--device: must be left out with --dask"),
        (["--dask", "tcp://127.0.0.1:1", "--target-nm", "1"], "--dask: must be left out with --target-nm"),
    ],
)
def test_the_command_line_refuses_in_one_line(impatient, tmp_path, capsys, arguments, line):
    assert main(["run", "sphere", "--out", str(tmp_path / "out"), *arguments]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith(f"irtscots: {line}")
    assert not (tmp_path / "out").exists()
