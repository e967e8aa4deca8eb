"""Centroids of the centre pixel with and without the deviation (paper, figure 6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from irtscots_cl.measurement.centroids import centroids
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.drawing import curves
from irtscots_cl.studies.traces import CENTRE, RUNS, SharedTraces, describe, light_curve, over_runs
from irtscots_cl.studies.verdicts import StudyResult, exact, row

TITLE = "Centroids of the centre pixel (figure 6)"
PRINTED_MM = {"sphere": 0.001, "sphere-deviated": 0.045}
SAMPLING_MM = 0.002  # largest shift of a centroid from sampling by lines of 0.2 mm
BOTH_COMAS_ALONG_X = {6: 0.3266, 8: -0.1414, 9: 0.1061, 11: 0.0894, 30: -0.0250, 38: -0.0141}  # 30, not 29


def study(traces: SharedTraces) -> StudyResult:
    rays, rows, series, notes = traces.ray_numbers[-1], [], [], []
    for name, style in (("sphere", "bo-"), ("sphere-deviated", "rs-")):
        runs = traces.runs(name, rays)
        truth = _true_centroid(load_scene(name))
        for axis, true in zip("xy", truth, strict=True):
            measured = over_runs(_centroids(runs.stack, axis))
            paper = PRINTED_MM[name] if axis == "x" else np.nan
            rows.append(row(
                f"centroid {axis}, {name} [mm]", measured, paper=paper, expected=true,
                allowed=SAMPLING_MM, closeness=1.0 if name == "sphere" else 0.1,
                inconsistent="" if name == "sphere" else "table 3's coefficients move it by a quarter of that",
            ))  # fmt: skip
        at, flux = light_curve(runs.stack, "x", CENTRE)
        series.append((f"{name}: centroid {rows[-2].ours.value:.4f} mm", at, flux.mean(0) / flux.mean(0).max(), style))
        notes.append(describe(runs))
    rows.append(row("centroid x, were the tertiary coma along x too [mm]",
                    exact(_true_centroid(_with_coma(load_scene("sphere-deviated")))[0])))  # fmt: skip
    return StudyResult(tuple(rows), (
        f"expected: centroid of the closed form of the light; sampling by lines moves a plain centroid by up to "
        f"{SAMPLING_MM} mm; ours: mean of {RUNS} runs",
        *notes,
    ), {"fig6.png": curves(series, "coordinate of line [mm]", "normalised irradiance")})  # fmt: skip


def _centroids(stack, axis: str) -> np.ndarray:
    """Centroids [runs] of the centre pixel in mm."""
    scan = getattr(stack, axis)
    return centroids(scan, scan.flux_w)[:, np.searchsorted(scan.pixels, CENTRE)]


def _true_centroid(scene: Scene) -> tuple[float, float]:
    light = Setup(scene).pixel_response
    u, v = light.means("uv")[:, np.searchsorted(light.pixels, CENTRE)]
    return float(u), float(v)


def _with_coma(scene: Scene) -> Scene:
    terms = ZernikeTerms(radius_mm=532.0, ordering="noll", coefficients_um=BOTH_COMAS_ALONG_X)
    return replace(scene, mirror=replace(scene.mirror, zernike=(terms,)))
