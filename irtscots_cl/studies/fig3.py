"""Image of line 7 on the ideal and on the deviated sphere, and their difference (paper, figure 3)."""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.statistics import Estimate, jackknife_error
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.drawing import maps
from irtscots_cl.studies.traces import SharedTrace, SharedTraces, describe
from irtscots_cl.studies.verdicts import StudyResult, exact, row
from irtscots_cl.tracing.trace import trace

TITLE = "Line 7 on the ideal and the deviated sphere (figure 3)"
SURFACES = ("sphere", "sphere-deviated")
PRINTED_PERCENT = 6.16
SIDES = {"from the side of -x": 6, "from the side of +x": 14}  # the seventh of 21 lines
MIN_SIGNAL = 0.05  # of the brightest pixel: brighter pixels count as lit


def study(traces: SharedTraces) -> StudyResult:
    rays = traces.ray_numbers[-1]
    traced = [traces.full(name, rays) for name in SURFACES]
    closed = [trace(scene, estimator="analytic").images(LineScan(scene)) for scene in map(load_scene, SURFACES)]
    rows, figures = [], {}
    for side, line in SIDES.items():
        expected = _mean_difference(*(_images(stack, line)[0] for stack in closed))
        rows.append(row(f"mean difference, line 7 {side} [%]", exact(expected), paper=PRINTED_PERCENT))
        with_noise = _expected_with_noise(closed, traced, line)
        rows.append(row(f"the same from {rays:,} rays [%]", _estimate([t.stack for t in traced], line),
                        expected=with_noise, allowed=0.05 * with_noise))  # fmt: skip
        first, second = (_images(t.stack, line)[0] for t in traced)
        figures[f"fig3_line{line + 1}.png"] = maps(
            [("ideal", first / first.max()), ("deviated", second / first.max()),
             ("difference", (first - second) / first.max())],
            "normalised irradiance", limits=[(0, 1), (0, 1), (-0.2, 0.2)],
        )  # fmt: skip
    return StudyResult(tuple(rows), (
        f"mean difference: mean of the absolute difference over mean of the ideal image, over the pixels that have at "
        f"least {MIN_SIGNAL:.0%} of the brightest signal in both images",
        "the paper states neither its definition nor from which side lines are counted: both are shown, from the "
        "closed form, without noise",
        "traced images: ray noise makes absolute differences larger; expected is the mean of |d + e| with the noise e "
        "of every pixel, whose own scatter leaves that uncertain by 5 %",
        *(describe(t) for t in traced),
    ), figures)  # fmt: skip


def _images(stack: ImageStack, line: int) -> np.ndarray:
    """Images [1 + replicates, rows, columns] of a line of the x scan: the mean, then with one replicate left out."""
    return np.stack([stack.x.image(line, curves) for curves in stack.x.jackknife_w()])


def _mean_difference(ideal: np.ndarray, deviated: np.ndarray) -> float:
    """In percent; see the study's notes."""
    lit = np.minimum(ideal, deviated) > MIN_SIGNAL * ideal.max()
    return float(100 * np.abs(ideal - deviated)[lit].mean() / ideal[lit].mean())


def _estimate(stacks: list[ImageStack], line: int) -> Estimate:
    pairs = zip(*(_images(stack, line) for stack in stacks), strict=True)
    values = np.array([_mean_difference(*pair) for pair in pairs])
    return Estimate(values[0], float(jackknife_error(values)))


def _expected_with_noise(closed: list[ImageStack], traced: list[SharedTrace], line: int) -> float:
    """Mean difference in percent of closed-form images with the noise of the traced ones: a folded normal per pixel."""
    ideal, deviated = (_images(stack, line)[0] for stack in closed)
    lit = np.minimum(ideal, deviated) > MIN_SIGNAL * ideal.max()
    difference, variance = (ideal - deviated)[lit], np.zeros(lit.sum())
    for t in traced:
        variance += t.stack.x.image(line, t.stack.x.standard_error_w())[lit] ** 2
    sigma = np.sqrt(variance).clip(1e-9 * ideal.max())  # a pixel without any hit has no variance
    folded = sigma * np.sqrt(2 / np.pi) * np.exp(-((difference / sigma) ** 2) / 2)
    folded += difference * erf(difference / sigma / np.sqrt(2))
    return float(100 * folded.mean() / ideal[lit].mean())
