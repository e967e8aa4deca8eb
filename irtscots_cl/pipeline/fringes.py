"""What all fringe measurements share, however their images came: facts, and the files that are written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.imaging.orientation import stored
from irtscots_cl.maths.arrays import IntArray
from irtscots_cl.measurement.error_bars import ErrorBars
from irtscots_cl.measurement.harmonic_bias import HarmonicBias
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.screen_coordinates import ScreenCoordinates
from irtscots_cl.pipeline.output import open_output_folder, version_attributes
from irtscots_cl.report.fringe_file import FringeMaps, write_fringe_result
from irtscots_cl.report.types import FringeFacts, MeasuredFacts
from irtscots_cl.system.atomic_files import write_json, write_text

FRINGES = "fringes"  # the name of the measure


@dataclass(frozen=True)
class FringeResult:
    """A mirror measured by fringes. coordinates: of the images as stored. reason: why pixels [rows, columns] as stored
    are not used (fringe_quality.Reason), None where it was not asked. harmonics: by axis, what was taken out of the
    phases."""

    result: Reconstruction
    coordinates: ScreenCoordinates
    reason: IntArray | None = field(default=None, repr=False, kw_only=True)
    harmonics: Mapping[str, HarmonicBias] = field(default_factory=dict, repr=False, kw_only=True)

    def stored(self, maps: Any) -> Any:
        """Upright maps as the images are stored."""
        return stored(maps, self.result.nominal.camera.detector.orientation)


def fringe_facts(found: FringeResult) -> FringeFacts:
    """What the fringes say, for the report."""
    axes = found.coordinates.axes
    mask = found.stored(found.result.mask)
    errors = dict(zip("xy", found.result.place_errors_mm or (), strict=True))
    facts: FringeFacts = {
        "periods": {axis: list(one.fringes.periods) for axis, one in axes.items()},
        "standard_error_mm": {axis: _median(errors[axis][found.result.mask]) for axis in ("x", "y")},  # type: ignore[typeddict-item]
        "modulation": {axis: _median(axes[axis].modulation[:, mask].min(axis=0)) for axis in ("x", "y")},  # type: ignore[typeddict-item]
        "pixels_with_wrong_order": float(sum(np.nansum(one.wrong[mask]) for one in axes.values())),
    }
    if found.harmonics:
        facts["harmonics"] = {
            axis: {
                "gamma": one.gamma,
                "gamma_standard_error": one.gamma_error,
                "closed_form_rad": list(one.closed_form_rad),
                "bias_rad": list(one.bias_rad),
                "height_nm": one.height_nm,
            }
            for axis, one in found.harmonics.items()
        }
    return facts


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if values.size else float("nan")


def write_fringes(
    folder: Path, found: FringeResult, facts: MeasuredFacts, bars: ErrorBars, attributes: Mapping[str, str]
) -> None:
    """Write result.h5, figures, scene.toml and report.json. attributes: of result.h5, beside those of all results."""
    from irtscots_cl.report.fringe_figures import write_fringe_figures

    result = found.result
    points = result.setup.chief_rays.screen_model
    in_frame = (
        points.to_world(result.centroid_x_mm, result.centroid_y_mm) - points.frame.position_mm
    ) @ points.frame.axes.T
    maps = FringeMaps(found.coordinates, in_frame, found.stored, found.reason)
    common = {
        "scene": result.nominal.to_toml(),
        "measure": FRINGES,
        "orientation": result.nominal.camera.detector.orientation,
        "rows and columns": "those of the images in their file",
    }
    with open_output_folder(folder):
        write_fringe_result(folder / "result.h5", maps, result, common | attributes | version_attributes(), bars)
        write_fringe_figures(folder / "figures", result, found.coordinates, found.reason)
        write_text(folder / "scene.toml", result.nominal.to_toml())
        write_json(folder / "report.json", dict(facts))
