"""Buffers and launches: a launch cut in parts gives the same, and what becomes of errors of the driver."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
from device_kernels import SmallKernel, kernel_text
from faults import CODES, SHORT_OF_MEMORY, FaultyKernel, driver_error
from synthetic import small_scene

import irtscots_cl.opencl.kernel as module
from irtscots_cl.opencl.device import Device, DeviceError
from irtscots_cl.opencl.kernel import MIN_LAUNCH_ITEMS, Workspace
from irtscots_cl.opencl.program import compose, kernel_files
from irtscots_cl.opencl.selftest import check_device
from irtscots_cl.tracing.trace import trace

GRID = (37, 29)


@pytest.fixture
def faulty(device, monkeypatch):
    """faulty(...): every kernel made from now on has the faults of that FaultyKernel, which is returned."""

    check_device(device, "fp32")  # or that would fail first

    def install(*arguments, **options) -> FaultyKernel:
        kernel = FaultyKernel(*arguments, **options)
        monkeypatch.setattr(module.cl, "Kernel", kernel)
        return kernel

    return install


def counting(device, folder) -> SmallKernel:
    """A kernel that adds to each work-item's own place of a grid of GRID, and to one sum of all."""
    body = f"""    const uint item = get_global_id(0) + {GRID[0]} * get_global_id(1);
    out[item] += item + 1;
    sum64_add(sum, 0, item);"""
    signature = "__global uint *out, __global uint *sum"
    return SmallKernel(device, kernel_text(folder / "counting.cl", ["sum64.cl"], signature, body), "fp32", width=1)


def counted(kernel: SmallKernel):
    out, total = kernel.run(GRID, [], [np.zeros(GRID[0] * GRID[1], np.uint32), np.zeros(1, np.uint64)])
    return out.tolist(), int(total[0])


EXPECTED = (list(range(1, GRID[0] * GRID[1] + 1)), GRID[0] * GRID[1] * (GRID[0] * GRID[1] - 1) // 2)


# --- launches that a driver has too little memory for ------------------------------------------------------


@pytest.mark.parametrize("code", SHORT_OF_MEMORY)
@pytest.mark.parametrize("most_items", [1000, 500, MIN_LAUNCH_ITEMS])
def test_a_launch_that_is_too_large_is_cut_and_gives_the_same(device, tmp_path, faulty, code, most_items):
    kernel = faulty(code, most_items)
    small = counting(device, tmp_path)
    assert counted(small) == EXPECTED
    assert kernel.tried[0] == ((0, 0), GRID)
    through = [part for part in kernel.tried if np.prod(part[1]) <= most_items]
    assert sum(np.prod(size) for _, size in through) == np.prod(GRID)  # each work-item once: EXPECTED tells where

    # what was refused once is not tried again
    kernel.tried.clear()
    assert counted(small) == EXPECTED
    assert all(np.prod(size) <= most_items for _, size in kernel.tried)


def test_later_launches_are_no_smaller_than_they_must_be(device, tmp_path, faulty):
    kernel = faulty("OUT_OF_RESOURCES", 600)
    small = counting(device, tmp_path)
    for _ in range(5):
        kernel.tried.clear()
        counted(small)
    assert max(np.prod(size) for _, size in kernel.tried) > 300


def test_a_device_that_takes_no_launch_is_one_line_with_its_memory(device, tmp_path, faulty):
    kernel = faulty("OUT_OF_RESOURCES", 0)
    with pytest.raises(DeviceError) as caught:
        counted(counting(device, tmp_path))
    message = str(caught.value)
    held = 4 * np.prod(GRID) + 8
    assert re.fullmatch(
        rf"{re.escape(device.label)}: a launch of \d+ x \d+ work-items beside {held} bytes in buffers, of "
        rf"{device.cl_device.global_mem_size} that the device has \(at most {device.cl_device.max_mem_alloc_size} in "
        r"one\): clEnqueueNDRangeKernel failed: OUT_OF_RESOURCES - more",
        message,
    )
    sizes = [int(np.prod(size)) for _, size in kernel.tried]
    assert sizes == sorted(sizes, reverse=True) and MIN_LAUNCH_ITEMS / 2 <= sizes[-1] <= MIN_LAUNCH_ITEMS
    assert all(2 * after >= before - GRID[0] for before, after in pairwise(sizes))  # halves


@pytest.mark.parametrize("code", ["DEVICE_NOT_AVAILABLE", "INVALID_COMMAND_QUEUE"])
def test_other_refusals_are_told_at_once(device, tmp_path, faulty, code):
    kernel = faulty(code, good=0)
    with pytest.raises(DeviceError, match=f"clEnqueueNDRangeKernel failed: {code} - more$"):
        counted(counting(device, tmp_path))
    assert len(kernel.tried) == 1


@pytest.mark.parametrize("code", ["OUT_OF_RESOURCES", "EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST"])
def test_a_launch_that_had_begun_is_not_repeated(device, tmp_path, faulty, code):
    kernel = faulty(code, good=0, starting=False)
    with pytest.raises(DeviceError, match=f"a kernel failed while it ran: clWaitForEvents failed: {code} - more$"):
        counted(counting(device, tmp_path))
    assert len(kernel.tried) == 1


@pytest.mark.parametrize(
    "options",
    [
        {"estimator": "forward"},
        {"estimator": "adjoint"},
        {"estimator": "adjoint", "smoothing": True},
        {"estimator": "nonsequential"},
    ],
    ids=lambda options: "-".join(map(str, options.values())),
)
def test_a_trace_in_small_launches_has_the_same_bits(device, faulty, options):
    scene = small_scene("sphere-deviated", 25)
    how = options | {"device": device, "rays_per_pixel": 64, "replicates": 2}
    whole = trace(scene, **how)
    kernel = faulty("MEM_OBJECT_ALLOCATION_FAILURE", 100)
    cut = trace(scene, **how)
    assert max(np.prod(size) for _, size in kernel.tried) > 100  # the first was too large
    assert cut.ledger == whole.ledger
    for one, other in zip(images_of(whole), images_of(cut), strict=True):
        np.testing.assert_array_equal(one, other)


def images_of(light) -> list[np.ndarray]:
    """The arrays of what a trace gives: counts of a Transport, flux_w of a LineLight, images_w of a PathLight."""
    if hasattr(light, "counts"):
        return [light.counts]
    return [light.images_w] if hasattr(light, "images_w") else list(light.flux_w.values())


@pytest.mark.parametrize("path", kernel_files().values(), ids=lambda path: path.name)
def test_no_kernel_knows_the_size_of_its_launch_or_group(path):
    """Or a launch in parts would give another result."""
    asked = set(re.findall(r"\bget_\w+", path.read_text(encoding="ascii")))
    assert asked <= {"get_global_id"}


# --- memory ------------------------------------------------------------------------------------------------


@pytest.fixture
def work(device) -> Workspace:
    return Workspace(device, compose("probe_sums.cl", {}, {}, "fp32", 1), "probe_sums")


def test_a_buffer_that_no_device_could_hold_is_refused_before_the_driver_is_asked(work, device, monkeypatch):
    monkeypatch.setattr(module, "_Buffer", lambda *_, **__: pytest.fail("asked"))
    most = device.cl_device.max_mem_alloc_size
    with pytest.raises(DeviceError) as caught:
        work.empty(most + 1)
    message = str(caught.value)
    assert message.startswith(f"{device.label}: too little memory: {most + 1} bytes wanted beside 0 bytes in buffers")
    assert f"of {device.cl_device.global_mem_size} that the device has (at most {most} in one)" in message
    assert "\n" not in message


def test_buffers_are_counted_together_as_long_as_they_live(work, device):
    work._memory_bytes = 3000
    kept = [work.empty(1000), work.upload(np.zeros(1000, np.uint8))]
    with pytest.raises(DeviceError, match="1001 bytes wanted beside 2000 bytes in buffers, of 3000 that"):
        work.empty(1001)
    kept.pop()
    kept += [work.empty(2000)]
    with pytest.raises(DeviceError, match="1 bytes wanted beside 3000 bytes in buffers"):
        work.empty(1)


@pytest.mark.parametrize("code", [*SHORT_OF_MEMORY, "INVALID_BUFFER_SIZE"])
@pytest.mark.parametrize("take", ["empty", "upload"])
def test_a_buffer_that_the_driver_refuses_is_one_line(work, device, monkeypatch, code, take):
    def refuse(*_, **__):
        raise driver_error(code, "create_buffer")

    monkeypatch.setattr(module, "_Buffer", refuse)
    with pytest.raises(DeviceError) as caught:
        work.empty(4096) if take == "empty" else work.upload(np.zeros(1024, np.float32))
    message = str(caught.value)
    assert message.startswith(f"{device.label}: too little memory: 4096 bytes wanted beside 0 bytes in buffers, of ")
    assert message.endswith(f": create_buffer failed: {code} - more")


# --- other errors of the driver ----------------------------------------------------------------------------


@pytest.mark.parametrize("call", ["enqueue_fill_buffer", "enqueue_copy"])
@pytest.mark.parametrize("code", CODES)
def test_errors_of_other_calls_are_one_line(work, device, monkeypatch, call, code):
    def fail(*_, **__):
        raise driver_error(code, call)

    buffer = work.empty(8)
    monkeypatch.setattr(module.cl, call, fail)
    with pytest.raises(DeviceError) as caught:
        work.clear(buffer) if call == "enqueue_fill_buffer" else work.download(buffer, np.zeros(1, np.uint64))
    assert str(caught.value) == f"{device.label}: {call} failed: {code} - more"


@pytest.mark.parametrize("call", ["Context", "CommandQueue"])
def test_a_device_that_is_gone_before_its_first_use_is_one_line(device, monkeypatch, call):
    def fail(*_, **__):
        raise driver_error("DEVICE_NOT_AVAILABLE", call)

    monkeypatch.setattr(module.cl, call, fail)
    with pytest.raises(DeviceError) as caught:
        trace(small_scene("sphere", 25), device=Device(device.cl_device, device.index), rays_per_pixel=8)
    assert str(caught.value) == f"{device.label}: {call} failed: DEVICE_NOT_AVAILABLE - more"


class _Gone:
    def __getattr__(self, name):
        raise driver_error("DEVICE_NOT_AVAILABLE", "clGetDeviceInfo")


def test_a_lost_device_is_told_of_even_if_it_does_not_answer(work, faulty, tmp_path, device):
    lost = Device(device.cl_device, device.index)
    faulty("INVALID_COMMAND_QUEUE", good=0)
    small = counting(lost, tmp_path)
    object.__setattr__(lost, "cl_device", _Gone())
    with pytest.raises(DeviceError, match=f"^{re.escape(device.label)}: a launch of .*: INVALID_COMMAND_QUEUE"):
        counted(small)
    with pytest.raises(DeviceError, match="DEVICE_NOT_AVAILABLE"):
        lost.describe()


def test_nothing_is_done_on_a_device_that_fails_its_self_test(device, monkeypatch):
    def refuse(*_):
        raise DeviceError("computes wrongly")

    monkeypatch.setattr(module, "check_device", refuse)
    monkeypatch.setattr(module, "build", lambda *_: pytest.fail("built"))
    for options in ({"estimator": "adjoint"}, {"estimator": "forward"}, {"estimator": "nonsequential"}):
        with pytest.raises(DeviceError, match="computes wrongly"):
            trace(small_scene("sphere", 25), device=device, rays_per_pixel=8, **options)
