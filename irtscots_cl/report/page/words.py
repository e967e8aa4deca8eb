"""Sentences of a page: what came out, the names of Zernike terms, the command that repeats a run."""

from __future__ import annotations

import math
import shlex

import numpy as np

from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.types import MeasuredFacts, Report
from irtscots_cl.tracing.options import ANALYTIC

NAMES = {
    4: "power", 5: "astigmatism 45°", 6: "astigmatism 0°", 7: "coma y", 8: "coma x", 9: "trefoil y", 10: "trefoil x",
    11: "spherical", 12: "secondary astigmatism 0°", 13: "secondary astigmatism 45°", 14: "tetrafoil x",
    15: "tetrafoil y", 16: "secondary coma x", 17: "secondary coma y", 22: "secondary spherical",
}  # fmt: skip
WAVE_NM = 632.8  # of the helium-neon laser, in which shops count


def term_name(noll: int) -> str:
    """Number and, where it has one, name of a Zernike term in Noll's order."""
    return f"{noll} {NAMES[noll]}" if noll in NAMES else str(noll)


def summary_of_run(report: Report) -> str:
    """One sentence: how far the measured surface is from the true one."""
    error = report["height_error_nm_rms"]["piston_tilt"]
    bar = report["height_error_nm_rms_standard_error"]["piston_tilt"]
    noise = report["predicted"]["height_ray_noise_nm_rms"]
    text = f"The simulated test measures {report['scene']} to {_nm(error, bar)} rms over {report['pixels_used']:,} "
    text += f"pixels, piston and tilt removed, which is {error / WAVE_NM:.2g} waves of 632.8 nm."
    if math.isfinite(noise) and noise > 0.5 * error:
        text += f" Most of it, {noise:.3g} nm, is ray noise: of this simulation, not of the test; more rays lower it."
    return text


def summary_of_measurement(facts: MeasuredFacts) -> str:
    """One sentence: the deviation from the design and how well it is known."""
    rms = facts["deviation_nm_rms"]["piston_tilt"]
    pv = facts["deviation_nm_pv"]
    text = f"The mirror of {facts['scene']} deviates from its design by {rms:.4g} nm rms and {pv:.4g} nm from peak to "
    text += f"valley over {facts['pixels_used']:,} pixels, piston and tilt removed: {rms / WAVE_NM:.2g} and "
    text += f"{pv / WAVE_NM:.2g} waves of 632.8 nm"
    error = facts["height_standard_error_nm"]
    return text + (f"; noise alone makes it uncertain by {error:.3g} nm." if math.isfinite(error) else ".")


def summary_of_result(result: Reconstruction) -> str:
    """One sentence of a result in Python: the deviation from the design."""
    off = result.levelled(result.deviation_mm) * 1e6
    rms, pv = math.sqrt(np.nanmean(off**2)), np.nanmax(off) - np.nanmin(off)
    text = (
        f"The mirror of {result.nominal.name} deviates from its design by {rms:.4g} nm rms and {pv:.4g} nm from peak "
    )
    return text + f"to valley over {int(result.height_mask.sum()):,} pixels, piston and tilt removed."


def _nm(value: float, error: float) -> str:
    return f"{value:.3g} nm" + (f" ± {error:.1g} nm" if math.isfinite(error) else "")


def repeat_command(report: Report) -> str:
    """The command that repeats a run."""
    words = ["irtscots", "run", report["scene"], "--estimator", report["estimator"], "--measure", report["measure"]]
    if report["estimator"] != ANALYTIC:
        words += ["--sampler", report["sampler"], "--precision", report["precision"]]
        words += ["--rays-per-pixel", str(report["rays_per_pixel"]), "--replicates", str(report["replicates"])]
        words += ["--seed", str(report["seed"])]
    words += ["--smoothing"] * bool(report["smoothing"])
    words += ["--aim", report["aim"]] if report["estimator"] == "forward" else []
    return shlex.join(words)
