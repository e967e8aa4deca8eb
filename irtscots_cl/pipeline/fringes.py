"""What all fringe measurements share, however their images came: facts, and the files that are written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.imaging.orientation import stored
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.error_bars import ErrorBars
from irtscots_cl.measurement.harmonic_bias import HarmonicBias
from irtscots_cl.measurement.photon_transfer import PhotonTransfer
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates, ScreenCoordinates
from irtscots_cl.pipeline.output import draw_figures, open_output_folder, version_attributes
from irtscots_cl.pipeline.picture import MirrorPicture, add_facts
from irtscots_cl.report.fringe_file import FringeMaps, write_fringe_result
from irtscots_cl.report.fringe_types import FringeFacts, HarmonicFacts, PhotonTransferFacts
from irtscots_cl.report.types import MeasuredFacts
from irtscots_cl.system.atomic_files import write_json, write_text

FRINGES = "fringes"  # the name of the measure


@dataclass(frozen=True)
class FringeResult:
    """A mirror measured by fringes. coordinates: of the images as stored. reason: why pixels [rows, columns] as stored
    are not used (fringe_quality.Reason), None where it was not asked. picture: outline and fiducials, if looked for.
    transfer: noise against light, None where it is not known. second_harmonic: over the first [rows, columns] as
    stored, by axis; empty where it was not asked. harmonics: by axis, what was taken out of the phases."""

    result: Reconstruction
    coordinates: ScreenCoordinates
    reason: IntArray | None = field(default=None, repr=False, kw_only=True)
    picture: MirrorPicture | None = field(default=None, repr=False, kw_only=True)
    transfer: PhotonTransfer | None = field(default=None, kw_only=True)
    second_harmonic: Mapping[str, FloatArray] = field(default_factory=dict, repr=False, kw_only=True)
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
        "noise": {axis: _noise(one, mask) for axis, one in axes.items()},
    }
    if found.transfer is not None:
        facts["photon_transfer"] = _transfer_facts(found.transfer)
    if found.harmonics:
        facts["harmonics"] = {axis: _harmonic_facts(one) for axis, one in found.harmonics.items()}
    return facts


def _harmonic_facts(one: HarmonicBias) -> HarmonicFacts:
    return {
        "gamma": one.gamma,
        "gamma_standard_error": one.gamma_error,
        "closed_form_rad": list(one.closed_form_rad),
        "bias_rad": list(one.bias_rad),
        "height_nm": one.height_nm,
    }


def _noise(one: AxisCoordinates, mask: BoolArray) -> float:
    """Of a sample of median brightness, in counts; NaN where it is not known."""
    if one.survey.noise is None or not mask.any():
        return float("nan")
    return math.sqrt(float(one.survey.noise.variance(np.array([_median(one.offset[:, mask])]))[0]))


def _transfer_facts(found: PhotonTransfer) -> PhotonTransferFacts:
    electrons = found.electrons_per_count
    return {
        "electrons_per_count": electrons,
        "electrons_per_count_standard_error": found.gain_error * electrons**2,
        "read_noise_counts": found.read_noise,
        "read_noise_electrons": found.read_noise * electrons,
        "light_counts": found.light.tolist(),
        "variance_counts2": found.variance.tolist(),
        "variance_counts2_standard_error": found.standard_error.tolist(),
        "departs": found.departs(),
    }


def add_picture_facts(facts: MeasuredFacts, found: FringeResult) -> None:
    """Add what the picture of the mirror tells to the facts."""
    if found.picture is not None:
        add_facts(facts, found.picture)


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if values.size else float("nan")


def write_fringes(
    folder: Path,
    found: FringeResult,
    facts: MeasuredFacts,
    bars: ErrorBars,
    attributes: Mapping[str, str],
    draw: bool = True,
) -> None:
    """Write result.h5, figures, scene.toml, report.html and report.json. attributes: of result.h5, beside those of all
    results. draw: false for no figures."""
    from irtscots_cl.report.page.page import write_measured_page

    result = found.result
    outline = None if found.picture is None else found.picture.outline
    maps = FringeMaps(
        found.coordinates,
        screen_points(result),
        found.stored,
        found.reason,
        found.second_harmonic,
        None if outline is None else outline.coverage,
    )
    common = {
        "scene": result.nominal.to_toml(),
        "measure": FRINGES,
        "orientation": result.nominal.camera.detector.orientation,
        "rows and columns": "those of the images in their file",
    }
    with open_output_folder(folder):
        write_fringe_result(folder / "result.h5", maps, result, common | attributes | version_attributes(), bars)
        figures = draw_figures(folder, draw, partial(_draw, result, maps)) or []
        write_text(folder / "scene.toml", result.nominal.to_toml())
        write_measured_page(folder / "report.html", facts, result, bars, pictures=figures)
        write_json(folder / "report.json", dict(facts))


def _draw(result: Reconstruction, maps: FringeMaps, folder: Path) -> list[Path]:
    from irtscots_cl.report.fringe_figures import write_fringe_figures  # Matplotlib: only where figures are made

    return [folder / name for name in write_fringe_figures(folder, result, maps)]


def screen_points(result: Reconstruction) -> FloatArray:
    """Where the pixels' places are, [rows, columns, 3] upright in the screen's frame [mm]."""
    points = result.setup.chief_rays.screen_model
    found: FloatArray = (
        points.to_world(result.centroid_x_mm, result.centroid_y_mm) - points.frame.position_mm
    ) @ points.frame.axes.T
    return found
