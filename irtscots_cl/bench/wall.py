"""Wall time of one forward trace: in this process, or in one whose OpenCL driver is limited to fewer cores.

In OpenCL a sub-device should use fewer cores, but PoCL 3.0 runs a sub-device of one compute unit on all cores
(measured: the same rate). CPU drivers read a limit from the environment when they load, so each such timing needs its
own process. It counts only if the device there reports that number of compute units.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time

from irtscots_cl.execution.launch_plan import MAX_RAYS_PER_ITEM
from irtscots_cl.opencl.device import Device, DeviceError, select_device
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

TIMES = ("kernel_seconds", "trace_seconds", "total_seconds")
LIMITS = ("POCL_CPU_MAX_CU_COUNT", "POCL_MAX_PTHREAD_COUNT")  # since PoCL 4, and before


def time_trace(scene: Scene, device: Device, rays_per_pixel: int) -> dict[str, float]:
    """Seconds of one forward trace for each of TIMES, and the number of "rays" launched. Raises the errors of `trace`.

    rays_per_pixel: per screen pixel. The total is for a call with compiled kernels but without computed chief rays.
    """
    started = time.perf_counter()
    done = trace(scene, device=device, estimator="forward", rays_per_pixel=rays_per_pixel, replicates=1)
    total = time.perf_counter() - started
    return {
        "rays": done.rays_total,
        "kernel_seconds": done.seconds["kernels"],
        "trace_seconds": done.seconds["trace"],
        "total_seconds": total,
    }


def time_warm(scene: Scene, device: Device, rays_per_pixel: int) -> dict[str, float]:
    """time_trace after a warm-up with at most a work-item's rays per pixel, which is enough to use the same kernel."""
    time_trace(scene, device, min(rays_per_pixel, MAX_RAYS_PER_ITEM))
    return time_trace(scene, device, rays_per_pixel)


def time_on_cores(preset: str, device: Device, rays_per_pixel: int, cores: int) -> dict[str, float]:
    """time_warm of a preset scene, in a process whose driver uses `cores` cores.

    Raises DeviceError if the driver cannot be limited, or if the process fails.
    """
    if device.kind != "cpu":
        raise DeviceError(f"{device.name}: only drivers for CPUs can be told to use fewer cores")
    job = {"preset": preset, "device": device.index, "rays_per_pixel": rays_per_pixel, "cores": cores}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", __spec__.name, json.dumps(job)],
        env=os.environ | dict.fromkeys(LIMITS, str(cores)), capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode != 0:
        raise DeviceError((done.stderr.strip() or f"the process ended with {done.returncode}").splitlines()[-1])
    return json.loads(done.stdout.splitlines()[-1])  # a driver may have printed something before


def _serve(job: dict) -> dict:
    """The work of the other process: one timing as `job` describes it."""
    if hasattr(os, "sched_setaffinity"):  # Intel's driver has one compute unit for each core that the process may use
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: job["cores"]])
    device = select_device(job["device"])
    units = device.cl_device.max_compute_units
    if units != job["cores"]:
        asked = f"asked for {job['cores']} by affinity, {', '.join(LIMITS)}"
        raise DeviceError(f"{device.name}: has {units} compute units, {asked}")
    return time_warm(load_scene(job["preset"]), device, job["rays_per_pixel"])


if __name__ == "__main__":
    try:
        print(json.dumps(_serve(json.loads(sys.argv[1]))))
    except DeviceError as error:
        sys.exit(str(error))
