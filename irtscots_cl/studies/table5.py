"""Slope and height errors of both surfaces at the three ray numbers (paper, table 5)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.prediction import PredictedError, predict_error
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.traces import (
    PAPER_RAYS,
    PAPER_RAYS_PER_SECOND,
    RUNS,
    SEED,
    SharedTrace,
    SharedTraces,
    describe,
    over_runs,
)
from irtscots_cl.studies.verdicts import StudyResult, VerdictRow, exact, row
from irtscots_cl.tracing.trace import trace

TITLE = "Slope and height errors, rms (table 5)"
PRINTED = {  # slope x, slope y [urad], height [nm]
    "sphere": ((2.6812, 2.8056, 7.08), (0.8642, 0.9149, 2.28), (0.3861, 0.4418, 1.10)),
    "sphere-deviated": ((2.6735, 2.7937, 6.69), (0.8678, 0.9058, 2.32), (0.3586, 0.4263, 1.05)),
}
STATISTICS = 0.24  # relative: SNRs from ten runs give the paper's overfill, and so its noise, no more accurately
SMALL = 0.05  # relative: effects that the prediction neglects, and the spread of its own 32 noise draws
OF_TEN = "its own slopes give about three times this height: a mean of ten"
CHEAP = {"sampler": "sobol", "smoothing": True, "rays_per_pixel": 64, "replicates": 1}


def study(traces: SharedTraces) -> StudyResult:
    rows: list[VerdictRow] = []
    notes: list[str] = []
    for name, printed in PRINTED.items():
        for rays, paper in zip(PAPER_RAYS, printed, strict=True):
            if rays in traces.ray_numbers:
                full, runs = traces.full(name, rays), traces.runs(name, rays)
                rows += [*_in_full(full, rays, paper), *_single(runs, rays, paper), *_mean_of_ten(runs, rays, paper)]
                notes += [describe(full), describe(runs)]
    rows += _adjoint(traces)
    return StudyResult(tuple(rows), (
        "slopes: measured less true over the mask; heights: measured less true deviation, piston and tilt removed "
        "unless said otherwise",
        "one run in full: every ray of the paper's cones traced; single run: mean of ten more runs with the same "
        "statistics, with its standard error; mean of ten: heights of the ten runs together",
        f"the paper's numbers agree within {STATISTICS:.0%}: so well is its overfill known from its signal-to-noise "
        "ratios",
        f"expected: ray noise by counting and line sampling, from the light curves alone; {SMALL:.0%} is allowed for "
        "what it leaves out",
        "noise of 1 urad per slope gives 7.9 nm and more of height with Southwell's integration on this mask "
        "(irt.noise_gain), the paper's table 2.6 nm: as if its heights were means of ten runs, its slopes of one",
        *notes,
    ))  # fmt: skip


def _errors(stack: ImageStack, scene: Scene, measure: str = "paper") -> list[Estimate]:
    """Slope errors x, y [urad]; height errors [nm] without piston and tilt, and also without power."""
    found = compare(measure_by(measure, stack, scene.nominal()), scene)
    return [*found.slope_error_urad.values(), found.height_error_nm["piston_tilt"],
            found.height_error_nm["piston_tilt_power"]]  # fmt: skip


def _predicted(stack: ImageStack, scene: Scene) -> PredictedError:
    return predict_error(measure_by("paper", stack, scene.nominal()), stack)


def _expected(predicted: PredictedError) -> tuple[float, float, float]:
    x, y = predicted.slope
    return 1e6 * x, 1e6 * y, 1e6 * predicted.height_mm


def _in_full(full: SharedTrace, rays: int, paper) -> Iterator[VerdictRow]:
    found = _errors(full.stack, full.scene)
    expected = _expected(_predicted(full.stack, full.scene))[2]
    yield row(f"{full.scene.name}, {rays:,} rays, one run in full: height [nm]", found[2], paper=paper[2],
              expected=expected, allowed=SMALL * expected, closeness=STATISTICS, inconsistent=OF_TEN)  # fmt: skip


def _single(runs: SharedTrace, rays: int, paper) -> Iterator[VerdictRow]:
    found = [_errors(runs.single(k), runs.scene) for k in range(RUNS)]
    values = np.array([[e.value for e in errors] for errors in found])
    expectations = _expected(_predicted(runs.single(0), runs.scene))
    names = ("slope x [urad]", "slope y [urad]", "height [nm]")
    for k, (what, expected) in enumerate(zip(names, expectations, strict=True)):
        ours = over_runs(values[:, k])
        yield row(f"{runs.scene.name}, {rays:,} rays, single run: {what}", ours, paper=paper[k], expected=expected,
                  allowed=SMALL * expected, closeness=STATISTICS, inconsistent=OF_TEN if k == 2 else "")  # fmt: skip


def _mean_of_ten(runs: SharedTrace, rays: int, paper) -> Iterator[VerdictRow]:
    found, predicted = _errors(runs.stack, runs.scene), _predicted(runs.stack, runs.scene)
    expected, floor = _expected(predicted)[2], 1e6 * predicted.line_sampling_height_mm
    how = {"paper": paper[2], "closeness": STATISTICS, "inconsistent": _below(paper[2], floor)}
    start = f"{runs.scene.name}, {rays:,} rays, mean of ten: height"
    yield row(f"{start} [nm]", found[2], expected=expected, allowed=SMALL * expected, **how)
    yield row(f"{start} without power [nm]", found[3], **how)


def _below(paper: float, floor: float) -> str:
    return f"sampling by lines alone leaves {floor:.2f} nm at any number of rays" if paper < floor else ""


def _adjoint(traces: SharedTraces) -> Iterator[VerdictRow]:
    """The adjoint estimator with as many rays in total as the paper's largest run, and with fewer and fewer."""
    scene = load_scene("sphere-deviated")
    light = trace(scene, estimator="analytic")
    pixels = len(light.windows.pixels)
    floor = 1e6 * _predicted(light.images(LineScan(scene)), scene).line_sampling_height_mm
    for rays in traces.ray_numbers:
        per_pixel = rays * int(np.prod(scene.screen.pixels)) // pixels
        yield from _by(traces, scene, f"adjoint, {per_pixel:,} rays per pixel", rays,
                       {"rays_per_pixel": per_pixel, "replicates": RUNS}, "paper", floor)  # fmt: skip
    for measure in ("paper", "fine", "refined"):
        yield from _by(traces, scene, f"adjoint, smoothed, 64 rays per pixel, --measure {measure}", PAPER_RAYS[-1],
                       CHEAP, measure, floor)  # fmt: skip


def _by(
    traces: SharedTraces, scene: Scene, how: str, rays: int, options: dict, measure: str, floor: float
) -> Iterator[VerdictRow]:
    """Height error and seconds of an adjoint run, compared with the paper's run with `rays` per screen pixel."""
    done = trace(scene, device=traces.device, estimator="adjoint", seed=SEED, progress=traces.progress,
                 keeper=traces.keeper, **options)  # fmt: skip
    stack, paper = done.images(LineScan(scene)), PRINTED["sphere-deviated"][PAPER_RAYS.index(rays)][2]
    reason = _below(paper, floor) if measure == "paper" else ""
    yield row(f"{scene.name}, {how}, {done.rays_total:.2g} rays: height [nm]", _errors(stack, scene, measure)[2],
              paper=paper, better="lower", inconsistent=reason)  # fmt: skip
    yield row(f"{scene.name}, {how}: seconds of tracing", exact(done.seconds["trace"]), better="lower",
              paper=rays * int(np.prod(scene.screen.pixels)) / PAPER_RAYS_PER_SECOND)  # fmt: skip
