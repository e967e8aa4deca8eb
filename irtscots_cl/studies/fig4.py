"""The same line image at the three ray numbers (paper, figure 4): its noise falls with the root of the ray number."""

from __future__ import annotations

import numpy as np

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.drawing import maps
from irtscots_cl.studies.traces import RUNS, SharedTraces, describe, over_runs
from irtscots_cl.studies.verdicts import StudyResult, row
from irtscots_cl.tracing.trace import trace

TITLE = "One line image at the paper's ray numbers (figure 4)"
LINE = 10  # the middle one of 21
MIN_SIGNAL = 0.5  # of the brightest pixel: brighter pixels are used for the noise


def study(traces: SharedTraces) -> StudyResult:
    scene = load_scene("sphere")
    truth = trace(scene, estimator="analytic").images(LineScan(scene)).x.image(LINE)
    lit = truth > MIN_SIGNAL * truth.max()
    rows, panels, noise = [], [], []
    for rays in traces.ray_numbers:
        scan = traces.runs("sphere", rays).stack.x
        images = np.stack([scan.image(LINE, curves) for curves in scan.flux_w])
        noise.append(over_runs(100 * np.sqrt(np.mean((images / truth.clip(1e-300) - 1)[:, lit] ** 2, axis=1))))
        panels.append((f"{rays:,} rays", images[0] / truth.max()))
        # hits per watt are the same everywhere; the light curves' numbers of independent rays give them
        hits = truth[lit] * (scan.hits.sum() / RUNS / scan.mean_w().sum())
        expected = 100 * float(np.sqrt(np.mean(1 / hits)))
        rows.append(row(f"noise of a pixel, {rays:,} rays [%]", noise[-1], expected=expected, allowed=0.01 * expected))
    rays = traces.ray_numbers
    rows += [_fall(*both) for both in zip(rays, rays[1:], noise, noise[1:], strict=False)]
    figure = maps(panels, "normalised irradiance", limits=[(0, 1)] * len(panels))
    return StudyResult(tuple(rows), (
        "the middle line on the ideal sphere; noise: rms difference from the closed form over the pixels with at least "
        f"{MIN_SIGNAL:.0%} of the brightest signal, relative to it, mean of {RUNS} runs; expected: from counting",
        *(describe(traces.runs("sphere", number)) for number in rays),
    ), {"fig4.png": figure})  # fmt: skip


def _fall(few: int, many: int, first: Estimate, second: Estimate):
    ratio = first.value / second.value
    error = ratio * np.hypot(first.standard_error / first.value, second.standard_error / second.value)
    return row(f"noise at {few:,} rays over noise at {many:,}", Estimate(ratio, float(error)),
               expected=float(np.sqrt(many / few)), allowed=0.01 * np.sqrt(many / few))  # fmt: skip
