"""The kernels' Launch structure of one block of rays."""

from __future__ import annotations

import numpy as np

from irtscots_cl.execution.launch_plan import RayBlock
from irtscots_cl.opencl.structs import LAUNCH
from irtscots_cl.scene.model import Scene
from irtscots_cl.tracing.options import TraceOptions


def launch_structure(scene: Scene, options: TraceOptions, replicate: int, block: RayBlock, per_item: int) -> np.ndarray:
    """The kernels' Launch [()] of a block; its window's size is left to the caller."""
    columns, rows = scene.camera.detector.pixels
    launch = np.zeros((), LAUNCH)
    for name, value in {
        "first_ray": block.first_ray,
        "ray_count": block.rays,
        "rays_per_item": per_item,
        "first_source": block.first_source,
        "replicate": replicate,
        "seed_low": options.seed & 0xFFFFFFFF,
        "seed_high": options.seed >> 32,
        "screen_columns": scene.screen.pixels[0],
        "screen_rows": scene.screen.pixels[1],
        "detector_pixels": rows * columns,
    }.items():
        launch[name] = value
    return launch
