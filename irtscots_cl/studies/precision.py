"""Precision of a centroid: Eq. (5), the exact formula for counts, and the scatter of ten runs."""

from __future__ import annotations

import numpy as np

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.measurement.centroids import centroids, poisson_error
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.traces import RUNS, SharedTrace, SharedTraces, describe
from irtscots_cl.studies.verdicts import StudyResult, VerdictRow, row

TITLE = "Precision of the centroids, ideal sphere (Eq. 5)"
LIT_LINES = 6  # N of Eq. (5): lines that contribute
BASE_WIDTH_MM = 1.2  # w of Eq. (5): full width of the light curve, aperture plus line
WHOLE = 0.999  # coverage of the pixels used: pixels at the rim have light curves of a different shape


def study(traces: SharedTraces) -> StudyResult:
    rows: list[VerdictRow] = []
    for rays in traces.ray_numbers:
        rows += _rows(traces.runs("sphere", rays), rays)
    return StudyResult(tuple(rows), (
        f"ours: scatter of the x centroids over {RUNS} runs, rms over all pixels that see nothing but mirror",
        "expected: standard deviation of the light curve over the root of its hits, 0.2566 mm / sqrt(hits)",
        f"paper: Eq. (5) with w = {BASE_WIDTH_MM} mm, N = {LIT_LINES} and the SNR that counting gives the brightest "
        "line; it is about twice too pessimistic",
        *(describe(traces.runs("sphere", rays)) for rays in traces.ray_numbers),
    ))  # fmt: skip


def _rows(runs: SharedTrace, rays: int) -> list[VerdictRow]:
    scan = runs.stack.x
    inner = Setup(load_scene("sphere")).chief_rays.footprint.coverage.ravel()[scan.pixels] >= WHOLE
    scatter = centroids(scan, scan.flux_w)[:, inner].var(0, ddof=1)
    measured = float(np.sqrt(np.nanmean(scatter)))
    freedom = (RUNS - 1) * int(np.isfinite(scatter).sum())
    ours = Estimate(1e3 * measured, 1e3 * measured / np.sqrt(2 * freedom))
    one_run = poisson_error(scan, scan.mean_w())[inner] * np.sqrt(RUNS)
    expected = 1e3 * float(np.sqrt(np.nanmean(one_run**2)))
    return [
        row(f"sigma of a centroid, {rays:,} rays [um]", ours, paper=1e3 * _eq5(scan, inner), expected=expected,
            allowed=0.02 * expected, inconsistent="Eq. (5) is pessimistic: a light curve's flanks tell most"),
        row(f"the same as slope, {rays:,} rays [urad]",
            Estimate(*(1e3 * v / 8333.5 for v in (ours.value, ours.standard_error)))),
    ]  # fmt: skip


def _eq5(scan: Scan, inner: np.ndarray) -> float:
    """sigma [mm] by paper Eq. (5), rms over the pixels."""
    share = scan.mean_w()[inner].max(1) / scan.mean_w()[inner].sum(1)
    snr = np.sqrt(share * scan.hits[inner] / RUNS)
    return float(np.sqrt(np.mean((BASE_WIDTH_MM / (2 * np.sqrt(LIT_LINES) * snr)) ** 2)))
