"""Signal-to-noise ratio of the detector's centre over ten images of one line (paper, section 3.1)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.traces import CENTRE, PAPER_OVERFILL, PAPER_RAYS, RUNS, SEED, SharedTraces
from irtscots_cl.studies.verdicts import StudyResult, row
from irtscots_cl.tracing.trace import trace

TITLE = "Signal-to-noise ratio of one line image over ten runs, ideal sphere"
PRINTED = dict(zip(PAPER_RAYS, (3.38, 15.10, 49.71), strict=True))
HALF_BLOCK = 4  # pixels around the centre, over which the light varies by 2 %


def study(traces: SharedTraces) -> StudyResult:
    scene = _middle_line(load_scene("sphere"))
    rows, notes = [], []
    for overfill in (1.0, PAPER_OVERFILL):
        for rays in traces.ray_numbers:
            pooled, single, counts = _measured(traces, scene, rays, overfill)
            rows.append(row(
                f"SNR, overfill {overfill:g}, {rays:,} rays", pooled, paper=PRINTED[rays],
                expected=_expected(scene, rays, overfill), closeness=0.5, better="higher",
            ))  # fmt: skip
            notes.append(
                f"overfill {overfill:g}, {rays:,} rays: the centre pixel alone has SNR {single:.3g} +- "
                f"{single / np.sqrt(2 * (RUNS - 1)):.1g} and {counts:.1f} hits on average, root {counts**0.5:.3g}"
            )
    return StudyResult(tuple(rows), (
        f"all rays of the line's {scene.screen.pixels[1]} screen pixels traced in full; Philox, seed {SEED}, {RUNS} "
        "runs",
        f"ours: mean over standard deviation of {RUNS} runs, of the {(2 * HALF_BLOCK + 1) ** 2} pixels around the "
        "centre together; a single pixel's ratio from ten runs is uncertain by 24 %, the paper's as well",
        "expected: square root of the counts that the closed form of the light gives",
        "the paper's rays filled a cone of about 3.4 times the mirror's solid angle: so its ratios tell; aimed at the "
        "mirror alone the same rays give more",
        *notes,
    ))  # fmt: skip


def _middle_line(scene: Scene) -> Scene:
    """The scene with only the screen's middle column of pixels, which lights one image of the x scan."""
    return replace(scene, screen=replace(scene.screen, pixels=(1, scene.screen.pixels[1])))


def _block() -> np.ndarray:
    """Flat numbers of the pixels around the detector's centre; the centre is the middle one."""
    step = np.arange(-HALF_BLOCK, HALF_BLOCK + 1)
    return (CENTRE + step[:, None] * 125 + step).ravel()


def _measured(traces: SharedTraces, scene: Scene, rays: int, overfill: float) -> tuple[Estimate, float, float]:
    """The block's ratio, the centre pixel's ratio, and the centre pixel's mean count."""
    done = trace(scene, device=traces.device, estimator="forward", rays_per_pixel=RUNS * rays, replicates=RUNS,
                 seed=SEED, overfill=overfill, progress=traces.progress, keeper=traces.keeper)  # fmt: skip
    hits = done.counts[:, np.searchsorted(done.windows.pixels, _block())].sum((2, 3)).astype(float)
    mean, variance = hits.mean(0), hits.var(0, ddof=1)
    pooled = mean.mean() / np.sqrt(variance.mean())
    freedom = (RUNS - 1) * len(mean)
    error = pooled * np.sqrt(1 / (2 * freedom) + 1 / (4 * hits.sum()))
    middle = len(mean) // 2
    return Estimate(pooled, error), mean[middle] / np.sqrt(variance[middle]), mean[middle]


def _expected(scene: Scene, rays: int, overfill: float) -> float:
    """Root of the block's mean count, from the closed form of the light."""
    full = load_scene(scene.name)
    scan = trace(full, estimator="analytic").images(LineScan(full)).x
    light = scan.image(scan.positions_mm.size // 2).ravel()[_block()]
    one_ray = trace(scene, estimator="forward", rays_per_pixel=1, replicates=1, overfill=overfill).unit_w
    return float(np.sqrt(np.mean(light) / one_ray.mean() * rays))
