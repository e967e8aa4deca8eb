"""Rays are run launch by launch, and go on from any launch to the same bits."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from counting_job import RAYS, SOURCES, CountingJob, same
from synthetic import small_scene
from tracers import tracer_of

from irtscots_cl.execution import checkpoint
from irtscots_cl.execution.checkpoint import Checkpoints, Interrupted
from irtscots_cl.execution.checkpoint_file import FORMAT, digest_hash, hash_of
from irtscots_cl.execution.device_tracer import DeviceTracer
from irtscots_cl.execution.executor import RunControl
from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.optics.setup import Setup
from irtscots_cl.tracing.estimators.nonsequential import PathTask, find_paths
from irtscots_cl.tracing.estimators.sequential import SequentialTask
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.trace import trace, trace_paths

FACTS = {"scene": "cd" * 16, "seed": 1}


@pytest.fixture
def eager(monkeypatch):
    """A save after every launch."""
    monkeypatch.setattr(checkpoint, "MIN_SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "COST_SHARE", 0.0)


def test_every_ray_once_and_progress_to_the_end():
    job, seen, so_far = CountingJob(), [], []
    found = run_rays(job, RAYS, RunControl(lambda *numbers: seen.append(numbers), so_far.append, launch_rays=20))
    assert found[0].shape == (3, SOURCES, 1) and found[1].shape == (3, 3)
    assert found[1][:, 0].tolist() == (RAYS * SOURCES).tolist()
    total = int(RAYS.sum()) * SOURCES
    assert [t for _, t in seen] == [total] * len(seen) and seen[-1] == (total, total)
    assert [n for n, _ in seen] == np.cumsum([part[2] * part[4] for part in job.launches]).tolist()
    assert [len(part[0]) for part in so_far] == [1, 2]  # the last is the result
    assert same(so_far[1], [array[:2] for array in found])
    assert same(found, run_rays(CountingJob(), RAYS, RunControl(launch_rays=7)))


def resumed(path, stop_after, launch_rays):
    """Interrupted after every so many launches, with launches of another size each time: sums, number of interrupts."""
    interrupts = 0
    while True:
        keeper, seen = Checkpoints(path, resume=True), []

        def stop(done, total, seen=seen, keeper=keeper):
            seen.append(done)
            keeper.stop = len(seen) > stop_after

        job = CountingJob()
        try:
            return run_rays(job, RAYS, RunControl(stop, None, keeper.file_of(FACTS), next(launch_rays))), interrupts
        except Interrupted:
            interrupts += 1


@pytest.mark.parametrize("stop_after", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("sizes", [(20,), (1,), (33, 7), (4, 60, 11)])
def test_an_interrupted_run_goes_on_to_the_same_sums(tmp_path, stop_after, sizes):
    found, interrupts = resumed(tmp_path / "kept", stop_after, itertools.cycle(sizes))
    assert same(found, run_rays(CountingJob(), RAYS))
    assert interrupts > 0


def test_a_run_that_dies_goes_on_from_its_last_save(tmp_path, eager):
    expected = run_rays(CountingJob(), RAYS)
    for dies_at in (1, 2, 9, 10, 11, 28):
        path, seen = tmp_path / f"{dies_at}", []

        def die(*numbers, seen=seen, dies_at=dies_at):
            seen.append(numbers)
            if len(seen) == dies_at:
                raise RuntimeError("power failure")

        with pytest.raises(RuntimeError):
            run_rays(CountingJob(), RAYS, RunControl(die, None, Checkpoints(path).file_of(FACTS), 4))
        job = CountingJob()
        assert same(
            run_rays(job, RAYS, RunControl(None, None, Checkpoints(path, resume=True).file_of(FACTS), 4)), expected
        )
        traced = sum(part[2] * part[4] for part in job.launches)
        lost = traced + (seen[-2][0] if dies_at > 1 else 0) - RAYS.sum() * SOURCES
        assert lost == 0  # but the launch after which it died, all was in the file


SCENE = small_scene("sphere-deviated", 21)
GHOSTS = small_scene("sphere-window", 21)
SCATTERING = small_scene("baffled", 21)
WAYS = {
    "adjoint": (SCENE, {"estimator": "adjoint", "precision": "fp32"}),
    "adjoint, sobol": (SCENE, {"estimator": "adjoint", "sampler": "sobol"}),
    "forward": (SCENE, {"estimator": "forward", "aim": "camera"}),
    "smoothed": (SCENE, {"estimator": "adjoint", "smoothing": True, "sampler": "lattice"}),
    "nonsequential": (SCENE, {"estimator": "nonsequential"}),
    "ghosts": (GHOSTS, {"estimator": "nonsequential"}),
    "scattering": (SCATTERING, {"estimator": "nonsequential"}),
}


def bits(traced) -> dict:
    """All numbers of a trace."""
    found = {"ledger": traced.ledger, "rays": traced.rays.tolist()}
    for name in ("counts", "images_w"):
        if hasattr(traced, name):
            found[name] = getattr(traced, name).tobytes()
    if hasattr(traced, "paths"):
        found |= {"paths": traced.paths, "ends": traced.ends}
    if isinstance(traced.flux_w if hasattr(traced, "flux_w") else None, dict):
        found |= {axis: flux.tobytes() for axis, flux in traced.flux_w.items()}
    return found


@pytest.mark.parametrize("way", WAYS)
def test_every_estimator_goes_on_to_the_same_bits(device, tmp_path, way, monkeypatch):
    monkeypatch.setattr("irtscots_cl.execution.run_loop._launch_size", lambda *_: lambda: 2**14)
    monkeypatch.setattr("irtscots_cl.tracing.estimators.nonsequential.PILOT_RAYS", 2**19)
    scene, options = WAYS[way]
    options = options | {"device": device, "rays_per_pixel": 700, "replicates": 3, "seed": 5}
    expected, path, interrupts = bits(trace(scene, **options)), tmp_path / "kept", 0
    assert len(expected) > 2
    while True:
        keeper, seen = Checkpoints(path, resume=True), []

        def stop(*numbers, seen=seen, keeper=keeper, launches=1 + 2 * interrupts):
            seen.append(numbers)
            keeper.stop = len(seen) > launches

        try:
            found = trace(scene, **options, progress=stop, keeper=keeper)
            break
        except Interrupted:
            interrupts += 1
    assert interrupts >= 2 and bits(found) == expected


def test_seconds_of_earlier_processes_count(device, tmp_path):
    """Or rays per second would be told too high."""
    options, path = {"device": device, "rays_per_pixel": 400, "replicates": 2}, tmp_path / "kept"
    keeper = Checkpoints(path)
    with pytest.raises(Interrupted):
        trace(SCENE, **options, keeper=keeper, progress=lambda *_: setattr(keeper, "stop", True))
    line, sums = path.read_bytes().split(b"\n", 1)
    header = json.loads(line.removeprefix(FORMAT)[33:])
    assert 0 < header["seconds"]["kernels"] < header["seconds"]["trace"] < 60
    header["seconds"] = {"trace": 2000.0, "kernels": 1000.0}
    text = json.dumps(header).encode()
    data = FORMAT + hash_of(text).encode() + b" " + text + b"\n" + sums[: -checkpoint.DIGEST_BYTES]
    path.write_bytes(data + digest_hash(data).digest())
    after = trace(SCENE, **options, keeper=Checkpoints(path, resume=True)).seconds
    assert 2000 < after["trace"] < 2060 and 1000 < after["kernels"] < 1060


def test_the_wider_windows_of_a_trace_are_gone_on_with(device, tmp_path, monkeypatch):
    """Rays beside the windows start a trace anew, with wider ones, whether or not it is interrupted."""
    from irtscots_cl.optics.screen_windows import place_windows

    narrow = lambda chief, margin: place_windows(chief, margin - 2)  # noqa: E731
    monkeypatch.setattr("irtscots_cl.optics.setup.place_windows", narrow)
    margins, program = [], SequentialTask.program
    monkeypatch.setattr(SequentialTask, "program", lambda task, on: margins.append(task.margin) or program(task, on))
    options = {"device": device, "rays_per_pixel": 300, "replicates": 2, "launch_rays": 2**15}
    expected = bits(trace(SCENE, **options))
    assert margins == [1, 2]
    keeper, seen = Checkpoints(tmp_path / "kept"), []

    def stop(done, total):
        seen.append(done)
        keeper.stop = keeper.stop or (len(seen) > 1 and done < seen[-2])  # in the second trace

    with pytest.raises(Interrupted):
        trace(SCENE, **options, keeper=keeper, progress=stop)
    assert margins == [1, 2, 1, 2]
    assert bits(trace(SCENE, **options, keeper=Checkpoints(tmp_path / "kept", resume=True))) == expected
    assert margins == [1, 2, 1, 2, 2]
    monkeypatch.setattr(checkpoint, "MIN_SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "COST_SHARE", 0.0)  # what was saved of the first does not stop the second
    assert bits(trace(SCENE, **options, keeper=Checkpoints(tmp_path / "new", resume=True))) == expected


def test_the_readmes_way_to_keep_a_trace(device, tmp_path):
    options = {"device": device, "rays_per_pixel": 2**12, "launch_rays": 2**16}
    with pytest.raises(Interrupted):
        trace(SCENE, **options, keeper=Checkpoints(str(tmp_path / "kept"), resume=True, max_seconds=1e-6))
    again = trace(SCENE, **options, keeper=Checkpoints(str(tmp_path / "kept"), resume=True))
    assert bits(again) == bits(trace(SCENE, **options))


def test_found_paths_do_not_depend_on_the_order_of_their_rays(device, monkeypatch):
    """Or a trace could not be gone on with: its sums are of the paths that the pilot keeps apart."""
    tiny = 2.0**-53  # 1 + tiny is 1, and tiny + tiny + 1 is more: then the second path is the more powerful one
    task, kept = PathTask(Setup(SCENE), TraceOptions("nonsequential")), []
    for weights in ((1, tiny, tiny), (tiny, 1, tiny), (tiny, tiny, 1)):
        rows = np.zeros((4, 3), np.uint32)
        rows[:, 0] = (1, 2, 2, 2)
        rows[:, 2] = np.array((1, *weights), np.float32).view(np.uint32)

        def read(_, out, rows=rows):
            out[0], out[1:13] = len(rows), rows.ravel()
            return out

        monkeypatch.setattr(DeviceTracer, "read_scratch", read)
        kept.append(find_paths(device, task))
    assert [tuple(found[:2]) for found in kept] == [([2, 1], [1.0, 1.0])] * 3


def test_other_paths_are_no_part_of_a_kept_trace(device, tmp_path, monkeypatch):
    options = {"device": device, "rays_per_pixel": 64, "replicates": 2}
    keeper = Checkpoints(tmp_path / "kept")
    with pytest.raises(Interrupted):
        trace_paths(GHOSTS, **options, keeper=keeper, progress=lambda *_: setattr(keeper, "stop", True))
    monkeypatch.setattr("irtscots_cl.tracing.estimators.nonsequential.PILOT_RAYS", 2**14)
    with pytest.raises(ValueError, match="of another run: other paths"):
        trace_paths(GHOSTS, **options, keeper=Checkpoints(tmp_path / "kept", resume=True))


def test_what_a_run_found_is_not_cleared_with_the_tracer(device):
    """On a CPU the sums are the arrays that a run returns, and no copy of them."""
    tracer = tracer_of(small_scene(), device, TraceOptions())
    first = run_rays(tracer, np.array([64, 64]))
    kept = [array.copy() for array in first]
    tracer.clear()
    assert all(not array.any() for array in tracer.sums())
    again = run_rays(tracer, np.array([64, 64]))
    assert kept[0].any() and same(first, kept) and same(again, kept)


def test_a_device_with_memory_of_its_own_finds_the_same(device, eager, tmp_path):
    """Its sums are copied and cleared after every launch that is saved."""
    shared, own = (tracer_of(small_scene(), device, TraceOptions()) for _ in range(2))
    own._shares = False
    rays = np.array([300, 200])
    saved = RunControl(checkpoint=Checkpoints(tmp_path / "kept").file_of(FACTS), launch_rays=20_000)
    assert same(run_rays(own, rays, saved), run_rays(shared, rays))
