"""The contents of report.json."""

from __future__ import annotations

import dataclasses
import math
from typing import cast

from irtscots_cl.analysis.comparison import Comparison
from irtscots_cl.analysis.error_terms import ErrorTerm
from irtscots_cl.analysis.stray_light import StrayLight
from irtscots_cl.measurement.prediction import PredictedError
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.along_axes import AlongAxes
from irtscots_cl.report.quality import fit_facts, island_facts, misfit_facts, quality_warnings
from irtscots_cl.report.tables import as_xy, error_term_facts
from irtscots_cl.report.types import (
    DeviceFacts,
    HeightErrors,
    Ledger,
    PathReport,
    Predicted,
    Refused,
    Report,
    Seconds,
    TraceSeconds,
    ZernikeFacts,
)
from irtscots_cl.system.versions import versions
from irtscots_cl.tracing.results.paths import PathLight
from irtscots_cl.tracing.results.transport import LineLight, Transport


def build_report(
    transport: Transport | LineLight,
    measure: str,
    result: Reconstruction,
    comparison: Comparison,
    predicted: PredictedError,
    parts: tuple[ErrorTerm, ...],
    seconds: dict[str, float],
) -> Report:
    """The contents of report.json. measure: name of the measurement method. parts: terms of the height
    error, may be empty. seconds: build, trace, reconstruct, total."""
    slopes, heights = comparison.slope_error_urad, comparison.height_error_nm
    islands, misfit = island_facts(result, comparison.error_mm), result.misfit(systematic=predicted.line_sampling)
    fit = fit_facts(comparison.zernike_fit)
    return {
        "scene": transport.scene.name,
        "device": cast("DeviceFacts", transport.device),
        "estimator": transport.options.estimator,
        "sampler": transport.options.sampler,
        "precision": transport.options.precision,
        "seed": transport.options.seed,
        "aim": transport.options.aim,
        "overfill": transport.options.overfill,
        "smoothing": transport.options.smoothing,
        "measure": measure,
        "refinement_updates_nm": list(result.updates_nm),
        "refinement_converged": result.converged,
        "replicates": transport.replicates,
        "versions": versions(),
        "rays_total": transport.rays_total,
        "rays_per_pixel": int(transport.rays.sum()),
        "rays_per_second": transport.rays_total / seconds["trace"],
        "seconds": cast("Seconds", seconds),
        "ledger": cast("Ledger", transport.ledger),
        "pixels_used": comparison.pixels_used,
        "light_curves_refused": cast("Refused", result.refused()),
        "pixels_with_traced_light": int(result.light_traced().sum()),
        "pixels_without_model": int(result.without_model().sum()),
        "slope_error_urad_rms": cast("AlongAxes", {axis: e.value for axis, e in slopes.items()}),
        "slope_error_urad_rms_standard_error": cast("AlongAxes", {a: e.standard_error for a, e in slopes.items()}),
        "height_error_nm_rms": cast("HeightErrors", {terms: e.value for terms, e in heights.items()}),
        "height_error_nm_rms_standard_error": cast("HeightErrors", {t: e.standard_error for t, e in heights.items()}),
        "height_standard_error_nm": comparison.height_standard_error_nm,
        "predicted": _predicted_facts(predicted),
        "error_parts": [error_term_facts(part) for part in parts],
        "zernike": [cast("ZernikeFacts", dataclasses.asdict(row)) for row in comparison.zernike],
        "zernike_fit": fit,
        "islands": islands,
        "integration_misfit": misfit_facts(misfit),
        "warnings": quality_warnings(islands, misfit_facts(misfit), fit, transport.scene.mirror.obscuration_mm > 0),
    }


def _predicted_facts(predicted: PredictedError) -> Predicted:
    return {
        "slope_error_urad_rms": as_xy(predicted.slope),
        "slope_ray_noise_urad_rms": as_xy(predicted.ray_noise_slope),
        "slope_line_sampling_urad_rms": as_xy(predicted.line_sampling_slope),
        "height_error_nm_rms_piston_tilt": predicted.height_mm * 1e6,
        "height_ray_noise_nm_rms": predicted.ray_noise_height_mm * 1e6,
        "height_line_sampling_nm_rms": predicted.line_sampling_height_mm * 1e6,
        "height_systematic_nm_rms": predicted.systematic_height_mm * 1e6,
        "height_rounding_nm_rms": predicted.rounding_height_mm * 1e6,
        "bound": predicted.why,
    }


def path_facts(light: PathLight, stray: tuple[StrayLight, ...], measure: str = "paper") -> PathReport:
    """The results of a non-sequential trace that `irtscots paths` prints. measure: of the heights, in `stray`."""
    direct = sum(path.flux_w for path in light.paths if path.kind == "direct")
    return {
        "scene": light.scene.name,
        "device": cast("DeviceFacts", light.device),
        "sampler": light.options.sampler,
        "precision": light.options.precision,
        "seed": light.options.seed,
        "replicates": light.replicates,
        "measure": measure,
        "rays_total": light.rays_total,
        "seconds": cast("TraceSeconds", light.seconds),
        "rays_per_second": light.rays_total / light.seconds["trace"],
        "bounce_limit": light.bounce_limit,
        "ends": light.ends,
        "launched_w": light.launched_w,
        "direct_w": direct,
        "staying": [
            {"end": stays.name, "flux_w": stays.flux_w, "flux_standard_error_w": stays.standard_error_w}
            for stays in light.losses
        ],
        "stray_light": [
            {
                "kind": s.kind,
                "of_direct": s.of_direct,
                "height_nm_rms": s.height_nm.value,
                "height_nm_rms_standard_error": s.height_nm.standard_error,
                "lost_pixels": s.lost_pixels,
            }
            for s in stray
        ],
        "paths": [
            {
                "path": path.name,
                "kind": path.kind,
                "flux_w": path.flux_w,
                "flux_standard_error_w": path.standard_error_w,
                "of_direct": path.flux_w / direct if direct else math.nan,
                "rays": path.rays,
                "focus_mm": path.focus_mm,
                "blur_mm": path.blur_mm,
            }
            for path in light.paths
        ],
    }
