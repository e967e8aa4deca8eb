"""Measure a mirror from images alone."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from irtscots_cl.analysis.comparison import HEIGHT_TERMS
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.coefficients import check_kind, coefficients
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.pipeline.output import open_output_folder, version_attributes
from irtscots_cl.report.quality import fit_facts, island_facts, misfit_facts, quality_warnings
from irtscots_cl.report.result_file import write_result
from irtscots_cl.report.types import HeightErrors, MeasuredFacts, Refused
from irtscots_cl.scene.model import Scene


def measure(
    stack: ImageStack,
    nominal: Scene,
    folder: Path,
    threshold: float = 0.0,
    how: str = "paper",
    zernike: str = "circular",
) -> MeasuredFacts:
    """Measure a mirror from images alone, without a truth to compare with.

    how: a name of methods.MEASURES. zernike: kind of the terms that are fitted, of coefficients.KINDS. Writes result.h5
    and figures into the folder and returns the main facts, named as in report.json.
    """
    from irtscots_cl.report.figures import write_figures

    check_kind(zernike)
    result = measure_by(how, stack, nominal, threshold)
    open_output_folder(folder)
    attributes = {"scene": nominal.to_toml(), "measure": how} | version_attributes()
    write_result(folder / "result.h5", stack, result, attributes)
    write_figures(folder / "figures", stack, result, None)
    joined = result.height_mask
    left = {t: remove_terms(result.x_mm, result.y_mm, result.deviation_mm, joined, t) for t in HEIGHT_TERMS}
    deviation = {terms: rms(height, joined) * 1e6 for terms, height in left.items()}
    found = coefficients(result, kind=zernike)
    islands, misfit = island_facts(result, result.deviation_mm), misfit_facts(result.misfit())
    fit, hole = fit_facts(found), nominal.mirror.obscuration_mm > 0
    columns = zip(found.fit.nolls, found.um.tolist(), found.standard_error_um.tolist(), found.fit.inflation.tolist(),
                  strict=True)  # fmt: skip
    return {
        "scene": nominal.name,
        "measure": how,
        "refinement_updates_nm": list(result.updates_nm),
        "pixels_used": result.pixels_used,
        "light_curves_refused": cast("Refused", result.refused()),
        "deviation_nm_rms": cast("HeightErrors", deviation),
        "zernike": [
            {"noll": noll, "output_um": um, "standard_error_um": error, "inflation": inflation}
            for noll, um, error, inflation in columns
        ],
        "zernike_fit": fit,
        "islands": islands,
        "integration_misfit": misfit,
        "warnings": quality_warnings(islands, misfit, fit, hole),
    }
