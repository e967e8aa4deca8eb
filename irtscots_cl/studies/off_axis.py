"""The off-axis segment: bent lines, reconstructed height and its error (paper, section 3.4, figures 11 and 12)."""

from __future__ import annotations

import numpy as np

from irtscots_cl.analysis.comparison import Comparison, compare
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.prediction import predict_error
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.drawing import maps
from irtscots_cl.studies.traces import RUNS, SEED, SharedTrace, SharedTraces, describe
from irtscots_cl.studies.verdicts import StudyResult, VerdictRow, row
from irtscots_cl.tracing.trace import trace

TITLE = "Off-axis segment (section 3.4, figures 11 and 12)"
PAPER_RAYS = 1_562_500  # per screen pixel
PRINTED_NM, PRINTED_TENFOLD_NM = 10.74, 5.0  # the second is the paper's estimate, not a run
SHOWN_LINES = 15
SMALL = 0.06  # relative: effects that the prediction neglects


def study(traces: SharedTraces) -> StudyResult:
    scene = load_scene("off-axis")
    full = traces.full("off-axis", PAPER_RAYS // 100 if traces.quick else PAPER_RAYS)
    result, comparison, rows = _measured(full.stack, scene, f"{full.rays // np.prod(scene.screen.pixels):,} rays",
                                         np.nan if traces.quick else PRINTED_NM)  # fmt: skip
    tenfold, adjoint_rays = _tenfold(traces, scene, full)
    _, _, more = _measured(tenfold, scene, "ten times the light", np.nan if traces.quick else PRINTED_TENFOLD_NM)
    figures = {
        "fig11.png": maps([(f"{SHOWN_LINES} lines, {scan.axis} scan", _many_lines(scan))
                           for scan in (full.stack.x, full.stack.y)], "normalised irradiance", columns=2),
        "fig12.png": maps([("reconstructed height", result.height_mm), ("error, piston and tilt removed",
                           1e6 * comparison.error_mm)], ["mm", "nm"], columns=2),
    }  # fmt: skip
    return StudyResult(tuple(rows + more), (
        f"{describe(full)}, all of them traced: {full.seconds['trace']:.0f} s",
        f"ten times the light: {adjoint_rays:,} adjoint rays, Philox, seed {SEED}, as many per detector pixel as ten "
        "times the forward run's hits: a light curve's centroid is as noisy by the one as by the other",
        "slopes, and heights with piston and tilt removed; expected: ray noise by counting and line sampling",
        "the paper gives no off-axis distance: 1087.74 mm, of the telescope's published M2 segment, gives its best-fit "
        "sphere of 4378 mm",
    ), figures)  # fmt: skip


def _measured(
    stack: ImageStack, scene: Scene, how: str, paper: float
) -> tuple[Reconstruction, Comparison, list[VerdictRow]]:
    result = measure_by("paper", stack, scene.nominal())
    found, predicted = compare(result, scene), predict_error(result, stack)
    rows = [row(f"{how}: slope {axis} [urad]", error, expected=1e6 * slope, allowed=SMALL * 1e6 * slope)
            for (axis, error), slope in zip(found.slope_error_urad.items(), predicted.slope, strict=True)]  # fmt: skip
    expected = 1e6 * predicted.height_mm
    rows.append(row(f"{how}: height [nm]", found.height_error_nm["piston_tilt"], paper=paper, expected=expected,
                    allowed=SMALL * expected, closeness=0.2, better="lower"))  # fmt: skip
    rows.append(row(f"{how}: height without power [nm]", found.height_error_nm["piston_tilt_power"]))
    return result, found, rows


def _tenfold(traces: SharedTraces, scene: Scene, full: SharedTrace) -> tuple[ImageStack, int]:
    """Images of an adjoint run with ten times the hits, and its rays."""
    hits = full.stack.x.hits
    rays = max(round(10 * float(np.median(hits[hits > 0]))), RUNS)
    done = trace(scene, device=traces.device, estimator="adjoint", rays_per_pixel=rays, replicates=RUNS, seed=SEED,
                 progress=traces.progress, keeper=traces.keeper)  # fmt: skip
    return done.images(LineScan(scene)), done.rays_total


def _many_lines(scan: Scan) -> np.ndarray:
    """The sum of the images of SHOWN_LINES lines spread evenly over the scan, brightest pixel 1."""
    lines = np.linspace(0, len(scan.positions_mm) - 1, SHOWN_LINES + 2)[1:-1].round().astype(int)
    mean = scan.mean_w()
    image = sum(scan.image(line, mean) for line in lines)
    return image / image.max()
