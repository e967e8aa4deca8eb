"""Results of fringes as tables for the terminal, beside those of report/tables.py."""

from __future__ import annotations

import math

from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.report.fringe_types import PhotonTransferFacts
from irtscots_cl.report.tables import Table
from irtscots_cl.report.types import MeasuredFacts


def _electrons(found: PhotonTransferFacts) -> str:
    if not math.isfinite(found["electrons_per_count"]):
        return "not told: the noise does not grow clearly with the light"
    return str(Estimate(found["electrons_per_count"], found["electrons_per_count_standard_error"]))


def fringe_tables(facts: MeasuredFacts) -> list[Table]:
    """What the fringes and the mirror's outline say; none for line scans."""
    tables = []
    if "fringes" in facts:
        found = facts["fringes"]
        periods = "; ".join(
            f"{axis}: {', '.join(f'{p:g}' for p in values)}" for axis, values in found["periods"].items()
        )
        rows = [("periods over the screen", periods)]
        for what, key in (
            ("standard error of a place [mm], median", "standard_error_mm"),
            ("modulation", "modulation"),
        ):
            values = found[key]  # type: ignore[literal-required]
            rows.append((what, f"{values['x']:.3g}, {values['y']:.3g}"))
        rows.append(("pixels expected to have a wrong fringe order", f"{found['pixels_with_wrong_order']:.2g}"))
        if "noise" in found:
            told = ", ".join(f"{found['noise'][axis]:.3g}" for axis in ("x", "y"))
            rows.append(("noise of a sample of median brightness [counts]", told))
        if "photon_transfer" in found:
            rows.append(("electrons per count, by noise against light", _electrons(found["photon_transfer"])))
        if "excluded" in found:
            told = ", ".join(f"{n} {reason}" for reason, n in found["excluded"].items() if n)
            rows.append(("pixels of the mirror by reason", told))
        for axis, taken in found.get("harmonics", {}).items():
            closed, there = (", ".join(f"{v:.2g}" for v in taken[key]) for key in ("closed_form_rad", "bias_rad"))
            rows.append(
                (f"gamma of the screen, {axis}", f"{taken['gamma']:.4f} +- {taken['gamma_standard_error']:.1g}")
            )
            rows.append((f"its bias, taken out, closed form without blur, {axis} [rad]", closed))
            rows.append((f"the largest in the pixels used, {axis} [rad]", there))
        if "harmonics" in found:
            cost = next(iter(found["harmonics"].values()))["height_nm"]
            rows.append(("heights without this correction would differ by [nm]", f"{cost:.3g}"))
        tables.append(Table("Fringes", ("", ""), rows))
    if "geometry" in facts:
        place = facts["geometry"]
        focal = place["focal_lengths_m"]
        tables.append(
            Table(
                "Geometry from the mirror's outline, its distance and the slopes",
                ("", ""),
                [
                    ("screen from", place["display"]),
                    ("corners of the mirror fit the picture to [pixels]", f"{place['corner_misfit_px']:.3g}"),
                    ("distance of mirror and screen [mm]", f"{place['distance_mm']:.6g}"),
                    ("the same by the outline alone [mm]", f"{place['distance_by_corners_mm']:.6g}"),
                    ("normal by the slopes, from that by the outline [mrad]", f"{place['turn_mrad']:.3g}"),
                    ("focal lengths along x, y [m]", f"{focal['x']:.5g}, {focal['y']:.5g}"),
                ],
            )
        )
    return tables
