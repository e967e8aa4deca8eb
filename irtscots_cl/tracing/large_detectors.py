"""What a run does about a large map of light transport: light curves of smoothed rays in its place, or a refusal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from irtscots_cl.optics.setup import Setup
from irtscots_cl.system.memory import GIB, check_memory, memory_bytes
from irtscots_cl.tracing.options import can_smooth

MOST_MAP_BYTES = 2**31  # of a map of light transport that is made without being asked for
SMOOTHED_RAYS = 64  # per pixel: less noise than 16384 plain ones
SMOOTHED_REPLICATES = 4  # whose light curves, too, are held at once
MARGIN = 1  # screen pixels, of the windows that a trace begins with
BYTES_PER_PIXEL = 5000  # of the detector, of all of a run but the map of transport, to its figures; measured


def fit_memory(setup: Setup, wanted: Mapping[str, Any], given: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """The options that a run changes so that its detector's light fits the memory, and a line that says so; or {}, "".

    wanted: the options with their defaults; given: those that the user set, which are kept. Raises ValueError if a run
    would take more memory than there is.
    """
    scene = setup.scene
    if wanted["estimator"] not in ("adjoint", "forward"):
        return {}, ""
    replicates = wanted["replicates"]
    key = f"scene {scene.name}: camera.detector.pixels = {list(scene.camera.detector.pixels)}"
    if wanted["smoothing"]:
        check_memory(f"{key}: a run", run_bytes(setup, replicates, smoothing=True))
        return {}, ""
    windows, whole = setup.windows(MARGIN), run_bytes(setup, replicates)
    size = _map_bytes(setup, replicates)
    response = scene.screen.response
    free = "smoothing" not in given and wanted["estimator"] == "adjoint" and can_smooth(scene)
    free = free and not (response is not None and response.needs_map)
    if free and (size > MOST_MAP_BYTES or whole > memory_bytes()):
        rays, parts = given.get("rays_per_pixel", SMOOTHED_RAYS), given.get("replicates", SMOOTHED_REPLICATES)
        return {"smoothing": True, "rays_per_pixel": rays, "replicates": parts}, (
            f"{len(windows.pixels)} maps of {windows.columns} x {windows.rows} screen pixels, {replicates} times, take "
            f"{size / GIB:.1f} GiB: light curves of smoothed rays instead, {rays} for each detector pixel in {parts} "
            "parts; --no-smoothing keeps the maps"
        )
    check_memory(f"{key}: {replicates} replicates of {windows.columns} x {windows.rows} screen pixels for each of "
                 f"{len(windows.pixels)}", whole)  # fmt: skip
    return {}, ""


def run_bytes(setup: Setup, replicates: int, smoothing: bool = False) -> int:
    """The memory that a run takes, with its images, its measurement and its figures."""
    columns, rows = setup.scene.camera.detector.pixels
    return BYTES_PER_PIXEL * columns * rows + (0 if smoothing else _map_bytes(setup, replicates))


def _map_bytes(setup: Setup, replicates: int) -> int:
    """The memory of the map of light transport, of all replicates."""
    return 8 * replicates * setup.windows(MARGIN).count
