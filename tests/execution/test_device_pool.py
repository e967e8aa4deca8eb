"""Rays on many devices: shared exactly once, the bits of one device, and what happens when a device fails."""

from __future__ import annotations

import logging
import threading
import time
from argparse import Namespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import coarse

from irtscots_cl.cli import run
from irtscots_cl.cli.common import DEFAULTS, site_arguments
from irtscots_cl.execution import device_pool as module
from irtscots_cl.execution.checkpoint import Checkpoints, Interrupted
from irtscots_cl.execution.device_pool import DevicePool, PooledDevice, open_pool
from irtscots_cl.execution.device_tracer import DeviceTracer
from irtscots_cl.execution.executor import RunControl
from irtscots_cl.execution.launch_plan import RateMeter, RayBlock
from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.opencl.device import Device, DeviceError, all_devices
from irtscots_cl.tracing.trace import trace

RAYS = {"rays_per_pixel": 600, "replicates": 2, "seed": 5}


@pytest.fixture
def two(device):
    """The device under test and itself again, with a context and a queue of its own."""
    return [Device(device.cl_device, device.index), Device(device.cl_device, device.index)]


class Counted:
    """A task.Tracer that counts how often each ray of each stream is traced. Fails at a launch, or when asked for sums.

    seconds_per_ray: that its launches claim to take.
    """

    def __init__(self, sources=7, most=50, fails_at=None, fails_in_sums=False, seconds_per_ray=1e-6, per_item=4):
        self.sources, self.max_rays_per_item, self.first_launch_rays = sources, per_item, 40
        self.rate_meter, self.fingerprint, self.launches = RateMeter(), {"code": "a"}, 0
        self.fails_at, self.fails_in_sums, self.seconds_per_ray = fails_at, fails_in_sums, seconds_per_ray
        self.sums_shapes = ((sources, most),)
        self.counts = np.zeros((sources, most), np.uint64)

    def clear(self):
        self.counts[:] = 0

    def launch(self, replicate, part):
        self.launches += 1
        time.sleep(2e-4)  # so that another thread gets its turn
        source, sources, ray, rays = part
        self.counts[source : source + sources, ray : ray + rays] += np.uint64(replicate + 1)
        self.rate_meter.launched(sources * rays, sources * rays * self.seconds_per_ray)
        if self.launches == self.fails_at:
            raise DeviceError(f"device {self.launches}: broken")

    def sums(self):
        if self.fails_in_sums and self.launches:
            raise DeviceError("device: lost")
        return (self.counts.copy(),)


def crew_of(device, jobs):
    return DevicePool([PooledDevice(device, job) for job in jobs])


def expected(sources, rays, most=50):
    counts = np.zeros((len(rays), sources, most), np.uint64)
    for replicate, per_source in enumerate(rays):
        counts[replicate, :, :per_source] = replicate + 1
    return counts


@settings(deadline=None, max_examples=40)
@given(
    sources=st.integers(1, 9),
    rays=st.lists(st.integers(1, 50), min_size=1, max_size=3),
    fails=st.lists(st.none() | st.integers(1, 6), min_size=0, max_size=3),
    launch_rays=st.integers(1, 200),
)
def test_every_ray_is_traced_once_whatever_fails(device, sources, rays, fails, launch_rays):
    jobs = [Counted(sources), *(Counted(sources, fails_at=at) for at in fails)]
    crew = crew_of(device, jobs)
    (counts,) = run_rays(crew, np.array(rays), RunControl(launch_rays=launch_rays))
    crew.close()
    np.testing.assert_array_equal(counts, expected(sources, rays))


def test_a_device_whose_sums_are_lost_is_left_out_and_its_rays_traced_again(device, caplog):
    sound, broken = Counted(), Counted(fails_in_sums=True)
    launch, began = sound.launch, threading.Event()
    broken.launch = lambda *given, launch=broken.launch: (launch(*given), began.set())
    sound.launch = lambda *given: (began.wait(10), launch(*given))  # so that the other gets its share on a busy machine
    crew = crew_of(device, [sound, broken])
    (counts,) = run_rays(crew, np.array([30, 20]), RunControl(launch_rays=100))
    np.testing.assert_array_equal(counts, expected(7, [30, 20]))
    assert len(caplog.records) == 1 and "device: lost" in caplog.text
    assert "devices" not in crew.describe()  # one is left


def test_what_was_taken_from_a_device_that_then_fails_is_not_traced_again(device):
    """As between two saves of a checkpoint, within a replicate."""
    jobs = [Counted(), Counted()]
    crew = crew_of(device, jobs)
    crew.clear()
    crew.launch(0, RayBlock(0, 7, 0, 20))
    crew.sums()
    jobs[1].fails_in_sums = True
    crew.launch(0, RayBlock(0, 7, 20, 12))
    np.testing.assert_array_equal(crew.sums()[0], expected(7, [32])[0])


def test_all_devices_failing_is_the_last_one_s_error(device):
    crew = crew_of(device, [Counted(fails_at=2), Counted(fails_at=1)])
    with pytest.raises(DeviceError, match=r"^device \d: broken$"):
        run_rays(crew, np.array([50]), RunControl(launch_rays=60))


def test_a_faster_device_takes_larger_pieces(device):
    slow, fast = Counted(100), Counted(100)
    crew = crew_of(device, [slow, fast])
    slow.rate_meter.launched(1000, 1.0)
    fast.rate_meter.launched(3_000_000, 1.0)
    slow.rate_meter.launched(1_000_000, 1.0)
    crew._todo.append((0, RayBlock(0, 100, 0, 2**18)))
    taken = [crew._take(member)[1].sources for member in crew._members]
    assert taken == [12, 33]  # half of a quarter of 100 streams, half of three quarters of the rest


def both_take_part(monkeypatch):
    """Which members of crews launched something."""
    seen, work = set(), DeviceTracer.launch

    def launch(self, *arguments):
        seen.add(id(self))
        work(self, *arguments)

    monkeypatch.setattr(DeviceTracer, "launch", launch)
    return seen


@pytest.mark.parametrize("options", [{}, {"estimator": "forward"}, {"smoothing": True}])
def test_two_devices_give_the_bits_of_one(device, two, monkeypatch, options):
    one = trace(coarse(), device=device, **RAYS, **options)
    seen = both_take_part(monkeypatch)
    shared = trace(coarse(), device=two, launch_rays=50_000, **RAYS, **options)
    assert len(seen) == 2
    for axis in ("x", "y"):
        np.testing.assert_array_equal(shared.line_flux_w(axis), one.line_flux_w(axis))
    assert shared.ledger == one.ledger
    assert shared.device["name"] == f"2 x {device.name}" and len(shared.device["devices"]) == 2
    assert shared.device["kind"] == device.kind


def test_two_devices_give_the_bits_of_one_by_path(device, two):
    scene = coarse("ghosts")
    runs = [trace(scene, device=d, estimator="nonsequential", rays_per_pixel=64, replicates=2) for d in (device, two)]
    np.testing.assert_array_equal(runs[0].images_w, runs[1].images_w)
    assert runs[0].ends == runs[1].ends and runs[0].paths == runs[1].paths


def test_a_device_that_cannot_be_built_for_is_left_out(device, two, caplog):
    def build(on):
        if on is two[0]:
            raise DeviceError("device 9:9: has no double precision")
        return Counted()

    with open_pool(two, build) as (job, facts):
        assert run_rays(job, np.array([5]))[0].sum() == 35 and facts() == device.describe()
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "has no double precision" in caplog.text

    def none(on):
        raise DeviceError("cannot")

    with pytest.raises(DeviceError, match="^cannot$"):
        open_pool(two, none)


def test_an_interrupted_trace_of_two_devices_goes_on_on_one(device, two, tmp_path):
    path, whole = tmp_path / "kept", trace(coarse(), device=device, **RAYS)
    keeper = Checkpoints(path)

    def stop(done, total):
        keeper.stop = done > total / 3

    with pytest.raises(Interrupted):
        trace(coarse(), device=two, launch_rays=30_000, progress=stop, keeper=keeper, **RAYS)
    gone_on = trace(coarse(), device=device, keeper=Checkpoints(path, resume=True), **RAYS)
    np.testing.assert_array_equal(gone_on.counts, whole.counts)


def test_the_command_line_takes_all_devices(monkeypatch):
    for choice in ("all", None):
        monkeypatch.setenv("IRTSCOTS_DEVICE", "all")
        with site_arguments(Namespace(device=choice, dask=None)) as where:
            assert where == {"device": all_devices()}
    with pytest.raises(ValueError, match="^--target-nm: must be left out with --device = 'all'"):
        run._check(Namespace(device="all", dask=None, target_nm=1.0, max_seconds=None, resume=None, seed=1,
                             zernike="circular"), {
            **DEFAULTS, **run.RAYS})  # fmt: skip


def test_no_thread_is_left(two):
    before = threading.active_count()
    trace(coarse(), device=two, rays_per_pixel=8)
    assert threading.active_count() == before


def test_what_differs_is_told():
    assert module.merge_descriptions([{"a": 1, "b": "x"}, {"a": 1, "b": "y"}]) == {"a": 1, "b": "x + y"}
