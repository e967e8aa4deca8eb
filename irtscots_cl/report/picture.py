"""Outline and fiducials of a picture of the mirror as facts, and as tables for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.mirror_outline import OutlineFit
from irtscots_cl.measurement.outline_checks import MirrorOutline
from irtscots_cl.report.along_axes import AlongAxes
from irtscots_cl.report.picture_types import FiducialFacts, MarkFacts, OutlineFacts, RimFacts
from irtscots_cl.report.table import Table
from irtscots_cl.report.types import MeasuredFacts

if TYPE_CHECKING:  # few mirrors have marks
    from irtscots_cl.measurement.fiducial_checks import SceneChange
    from irtscots_cl.measurement.fiducial_mapping import FiducialMap


def outline_facts(found: MirrorOutline) -> OutlineFacts:
    shift = {"shift_mm": _place(found.shift_mm), "shift_standard_error_mm": _place(found.shift_error_mm)}
    hole = {} if found.hole is None else {"hole": _rim(found.hole)}
    return cast("OutlineFacts", {**_rim(found.rim), **shift, **hole})


def _rim(fit: OutlineFit) -> RimFacts:
    return {
        "shift_rows_px": float(fit.shift_px[0]),
        "shift_columns_px": float(fit.shift_px[1]),
        "shift_standard_error_px": float(fit.shift_error_px.max()),
        "scale": fit.scale,
        "scale_standard_error": fit.scale_error,
        "residual_px": fit.residual_px,
        "noise_px": fit.noise_px,
        "blur_px": fit.blur_px,
        "seen": fit.seen,
    }


def _place(values: FloatArray) -> AlongAxes:
    return {"x": float(values[0]), "y": float(values[1])}


def fiducial_facts(found: FiducialMap, change: SceneChange | None) -> FiducialFacts:
    left = found.left_mm if found.is_enough else np.full(found.error_mm.shape, np.nan)
    marks: list[MarkFacts] = []
    for k, (mark, one) in enumerate(zip(found.marks.marks, found.found, strict=True)):
        row, column = (float("nan"), float("nan")) if one is None else one.place_px.tolist()
        marks.append(
            {
                "name": mark.name,
                "found": one is not None,
                "row": row,
                "column": column,
                "error_mm": _place(found.error_mm[k]),
                "standard_error_mm": _place(found.standard_error_mm[k]),
                "left_mm": _place(left[k]),
            }
        )
    facts: FiducialFacts = {"marks": marks, "rms_mm": found.rms_mm()}
    if found.is_enough:
        errors = np.sqrt(np.diag(found.move_covariance))
        facts |= {
            "left_mm_rms": found.rms_mm(left=True),
            "offset_mm": _place(found.offset_mm),
            "offset_standard_error_mm": _place(errors[:2]),
            "turn_mrad": found.turn_rad * 1e3,
            "turn_standard_error_mrad": float(errors[3]) * 1e3,
            "scale": found.scale,
            "scale_standard_error": float(errors[2]),
        }
    if change is not None:
        facts["suggestion"] = {**change.keys, "rms_mm": change.rms_mm}
    return facts


def picture_tables(facts: MeasuredFacts) -> list[Table]:
    """Outline and marks of a measurement; none where they were not looked for."""
    tables = []
    if "outline" in facts:
        rim = facts["outline"]
        shift, error = rim["shift_mm"], rim["shift_standard_error_mm"]
        rows = [
            ("shift from the design, rows, columns [pixels]",
             f"{rim['shift_rows_px']:+.4f}, {rim['shift_columns_px']:+.4f} +- {rim['shift_standard_error_px']:.4f}"),
            ("the same on the mirror, x, y [mm]",
             f"{shift['x']:+.4g}, {shift['y']:+.4g} +- {max(error['x'], error['y']):.2g}"),
            ("size over the design's", f"{rim['scale']:.6f} +- {rim['scale_standard_error']:.6f}"),
            ("edge from the design's rim, rms [pixels]", f"{rim['residual_px']:.3g} (noise {rim['noise_px']:.2g})"),
            ("blur of the edge [pixels]", f"{rim['blur_px']:.2g}"),
        ]  # fmt: skip
        tables.append(Table("The mirror's outline in the picture", ("", ""), rows))
    if "fiducials" in facts:
        rows = []
        for mark in facts["fiducials"]["marks"]:
            off, error = mark["error_mm"], mark["standard_error_mm"]
            told = f"{off['x']:+.3f}, {off['y']:+.3f} +- {error['x']:.3f}, {error['y']:.3f}"
            rows.append((mark["name"], told if mark["found"] else "not found"))
        rows.append(("rms", f"{facts['fiducials']['rms_mm']:.3g}"))
        tables.append(Table("Fiducials: mapping error along the mirror's x, y [mm]", ("", ""), rows))
    return tables
