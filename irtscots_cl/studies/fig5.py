"""Light curve of the centre pixel compared with Eq. (2) (paper, figure 5)."""

from __future__ import annotations

import numpy as np

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.optics.pixel.chord import chord_cdf
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.drawing import curves
from irtscots_cl.studies.traces import CENTRE, PAPER_RAYS, RUNS, SharedTraces, describe, light_curve, over_runs
from irtscots_cl.studies.verdicts import StudyResult, exact, row
from irtscots_cl.tracing.trace import trace

TITLE = "Light curve of the centre pixel against Eq. (2) (figure 5)"
PRINTED_PERCENT = dict(zip(PAPER_RAYS, (3.0, 1.5, 0.3), strict=True))


def eq2(position_mm: np.ndarray, pitch_mm: float, radius_mm: float) -> np.ndarray:
    """Share of the aperture's area under lines at these positions: A_w of paper Eq. (2) divided by pi a^2."""
    return chord_cdf((position_mm + pitch_mm / 2) / radius_mm) - chord_cdf((position_mm - pitch_mm / 2) / radius_mm)


def misfit_percent(curve: np.ndarray, theory: np.ndarray) -> np.ndarray:
    """rms difference of light curves [..., lines] from theory [lines], both of sum 1, in percent of theory's peak."""
    share = curve / curve.sum(-1, keepdims=True)
    lit = theory > 0
    return 100 * np.sqrt(np.mean((share - theory)[..., lit] ** 2, axis=-1)) / theory.max()


def study(traces: SharedTraces) -> StudyResult:
    scene = load_scene("sphere")
    radius, pitch = scene.camera.aperture_diameter_mm / 2, scene.screen.pitch_mm
    position, closed = light_curve(trace(scene, estimator="analytic").images(LineScan(scene)), "x", CENTRE)
    closed = closed[0] / closed[0].sum()
    theory = eq2(position, pitch, radius)
    rows = [row("misfit of the closed form [%]", exact(float(misfit_percent(closed, theory))))]
    series = [("Eq. (2)", *_fine(pitch, radius), "k:")]
    for rays, symbol in zip(traces.ray_numbers, "os^", strict=False):
        runs = traces.runs("sphere", rays)
        at, flux = light_curve(runs.stack, "x", CENTRE)
        own = eq2(at, pitch, radius)
        hits = _hits(runs.stack) / RUNS
        # the noise of shares of a fixed number of hits, and the closed form's own difference from Eq. (2)
        variance = own * (1 - own) / hits + np.interp(at, position, closed - theory) ** 2
        expected = 100 * np.sqrt(np.mean(variance[own > 0])) / own.max()
        values = misfit_percent(flux, own)
        rows.append(row(f"misfit, {rays:,} rays, single run [%]", over_runs(values), paper=PRINTED_PERCENT[rays],
                        expected=float(expected), allowed=0.1 * expected, closeness=0.5,
                        inconsistent="its hits alone give more; a mean of ten runs has less"))  # fmt: skip
        ten = float(misfit_percent(flux.mean(0), own))
        rows.append(row(f"misfit, {rays:,} rays, mean of ten [%]", Estimate(ten, ten / np.sqrt(2 * np.sum(own > 0))),
                        paper=PRINTED_PERCENT[rays], closeness=0.5))  # fmt: skip
        series.append((f"{rays:,} rays: {values[0]:.2g} %", at, flux[0] / flux[0].sum(), symbol))
    return StudyResult(tuple(rows), (
        "misfit: rms over the lines of the difference between light curve and Eq. (2), both of sum 1, in percent of "
        "the peak; the paper does not define its own: within half of its figures counts as agreeing",
        f"single run: mean of the misfits of {RUNS} runs; expected: from counting, root of the mean square, of which "
        "the mean falls short by up to a tenth; mean of ten: misfit of their mean, uncertain by a quarter",
        "Eq. (2) with a = 0.5 mm, d = 0.2 mm, centred where the chief ray lands; the closed form is the analytic "
        "estimator",
        *(describe(traces.runs("sphere", rays)) for rays in traces.ray_numbers),
    ), {"fig5.png": curves(series, "coordinate of line [mm]", "share of the light")})  # fmt: skip


def _fine(pitch: float, radius: float) -> tuple[np.ndarray, np.ndarray]:
    position = np.linspace(-0.8, 0.8, 401)
    return position, eq2(position, pitch, radius)


def _hits(stack) -> float:
    return float(stack.x.hits[np.searchsorted(stack.x.pixels, CENTRE)])
