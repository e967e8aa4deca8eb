"""Traces for the studies at the paper's ray numbers. Each is made once and shared by all studies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from irtscots_cl.execution.checkpoint import Checkpoints
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

PAPER_RAYS = (156_250, 1_562_500, 15_625_000)  # per screen pixel
PAPER_RAYS_PER_SECOND = 156_250 / 5.0  # of one core of an Intel Core i5 at 2.67 GHz
PAPER_OVERFILL = 3.4  # of the paper's emission over the mirror's disk, derived from its signal-to-noise ratios
RUNS = 10  # number of runs for a ratio or a mean
CENTRE = 62 * 125 + 62  # flat number of the detector's centre pixel
SEED = 1
SEEDS = {"sphere": 1, "sphere-deviated": 2, "off-axis": 3}  # different, so that their noise is independent


@dataclass(frozen=True)
class SharedTrace:
    """The stored results of a trace. Its replicates are the runs of `runs`, or the parts of one run of `full`.

    seconds: build, trace, kernels. rays: total number traced. equivalent: number of rays that a full emission would
    have needed.
    """

    scene: Scene
    stack: ImageStack
    rays: int
    equivalent: int
    seconds: dict[str, float]

    def single(self, run: int) -> ImageStack:
        """The images of one run."""
        return self.stack.replicate(run)


class SharedTraces:
    """Traces for the studies. quick: omit the paper's largest ray number, and trace a hundredth of the off-axis
    case's rays.

    progress(done, total): called after each launch, with numbers of rays. keeper: checkpoints of all traces.
    """

    def __init__(
        self,
        device: Device,
        quick: bool = False,
        progress: Callable[[int, int], None] | None = None,
        keeper: Checkpoints | None = None,
    ):
        self.device, self.quick, self.progress, self.keeper = device, quick, progress, keeper
        self.ray_numbers = PAPER_RAYS[:2] if quick else PAPER_RAYS
        self._kept: dict[tuple, SharedTrace] = {}

    def full(self, name: str, rays: int) -> SharedTrace:
        """One run of the paper's forward estimator with all rays of its overfilled cones, in RUNS replicates."""
        return self._trace(name, rays, "mirror", 1.0)

    def runs(self, name: str, rays: int) -> SharedTrace:
        """RUNS runs of `rays` per screen pixel each, with the statistics of `full` but a fraction of its rays.

        Rays leave only towards the part of the mirror that the camera sees (optics/aim.py). Each has the weight of a
        ray of `full`.
        """
        return self._trace(name, RUNS * rays, "camera", Setup(load_scene(name)).camera_aim.share)

    def _trace(self, name: str, rays: int, aim: str, share: float) -> SharedTrace:
        key = (name, rays, aim)
        if key not in self._kept:
            scene = load_scene(name)
            overfill = PAPER_OVERFILL if aim == "mirror" else 1.0
            aimed = round(rays * share / PAPER_OVERFILL) if aim == "camera" else rays
            done = trace(scene, device=self.device, estimator="forward", rays_per_pixel=aimed, replicates=RUNS,
                         seed=SEEDS[name], aim=aim, overfill=overfill, progress=self.progress,
                         keeper=self.keeper)  # fmt: skip
            pixels = int(np.prod(scene.screen.pixels))
            self._kept[key] = SharedTrace(
                scene, done.images(LineScan(scene)), done.rays_total, rays * pixels, done.seconds
            )
        return self._kept[key]


def over_runs(values) -> Estimate:
    """Mean of a number [runs] and its standard error from the runs' scatter."""
    values = np.asarray(values, float)
    return Estimate(float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values))))


def light_curve(stack: ImageStack, axis: str, pixel: int) -> tuple[np.ndarray, np.ndarray]:
    """Line positions [window] in mm and flux [replicates, window] in W of a detector pixel (flat number)."""
    scan = getattr(stack, axis)
    (n,) = np.flatnonzero(scan.pixels == pixel)
    lines = scan.lines[n]
    inside = lines < len(scan.positions_mm)
    return scan.positions_mm[lines[inside]], scan.flux_w[:, n, inside]


def describe(traced: SharedTrace) -> str:
    """Ray number and seed of a trace, for a study's notes."""
    saved = "" if traced.rays == traced.equivalent else f", standing for {traced.equivalent:,} in the paper's cones"
    return f"{traced.scene.name}: {traced.rays:,} forward rays, Philox, seed {SEEDS[traced.scene.name]}{saved}"
