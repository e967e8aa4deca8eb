"""Measure a mirror from images alone."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from irtscots_cl.analysis.comparison import HEIGHT_TERMS
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.pipeline.output import open_output_folder, version_attributes
from irtscots_cl.report.result_file import write_result
from irtscots_cl.report.types import HeightErrors, MeasuredFacts, Refused
from irtscots_cl.scene.model import Scene


def measure(
    stack: ImageStack, nominal: Scene, folder: Path, threshold: float = 0.0, how: str = "paper"
) -> MeasuredFacts:
    """Measure a mirror from images alone, without a truth to compare with.

    how: a name of methods.MEASURES. Writes result.h5 and figures into the folder and returns the main facts, named as
    in report.json.
    """
    from irtscots_cl.report.figures import write_figures

    result = measure_by(how, stack, nominal, threshold)
    open_output_folder(folder)
    attributes = {"scene": nominal.to_toml(), "measure": how} | version_attributes()
    write_result(folder / "result.h5", stack, result, attributes)
    write_figures(folder / "figures", stack, result, None)
    left = {t: remove_terms(result.x_mm, result.y_mm, result.deviation_mm, result.mask, t) for t in HEIGHT_TERMS}
    deviation = {terms: rms(height, result.mask) * 1e6 for terms, height in left.items()}
    return {
        "scene": nominal.name,
        "measure": how,
        "refinement_updates_nm": list(result.updates_nm),
        "refinement_converged": result.converged,
        "pixels_used": result.pixels_used,
        "light_curves_refused": cast("Refused", result.refused()),
        "pixels_with_traced_light": int(result.light_traced().sum()),
        "pixels_without_model": int(result.without_model().sum()),
        "deviation_nm_rms": cast("HeightErrors", deviation),
    }
