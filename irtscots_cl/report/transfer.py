"""The instrument transfer function: as data for programs, as tables and sentences, and as a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.maths.corrected_spectrum import CorrectedPsd
from irtscots_cl.measurement.transfer_summary import Direction, TransferSummary
from irtscots_cl.report.table import Table
from irtscots_cl.system.atomic_files import replacing

NAME = "transfer.png"
FACTORS = ("footprint", "aperture", "diffraction", "display", "sharpening", "integration", "model", "slope", "height")
ROWS = 20  # of the table of a spectrum; all are in the data
NM2_MM2 = 1e12  # of a density in mm^4
CURVE_STEPS = 300


def transfer_facts(
    found: TransferSummary, psd: CorrectedPsd | None = None, removed: str = "piston_tilt"
) -> dict[str, Any]:
    """All of it as plain data. removed: terms that were taken out of the map of psd."""
    transfer, geometry = found.transfer, found.geometry
    along_x, along_y, along = found.directions
    facts: dict[str, Any] = {
        "scene": transfer.setup.scene.name,
        "measure": transfer.name,
        "integration_method": transfer.how.method,
        "fringe_periods": transfer.fringes,
        "wavelength_nm": transfer.wavelength_nm,
        "place_mm": [float(geometry.x_mm[0]), float(geometry.y_mm[0])],
        "pixel_mm": {"column": geometry.pixel[0, 0].tolist(), "row": geometry.pixel[0, 1].tolist()},
        "aperture_mm": {"a": geometry.aperture[0, 0].tolist(), "b": geometry.aperture[0, 1].tolist()},
        "direction_deg": found.angle_deg,
        "nyquist_period_mm": {"x": along_x.nyquist_mm, "y": along_y.nyquist_mm, "direction": along.nyquist_mm},
        "half_response_period_mm": {"x": along_x.half_mm, "y": along_y.half_mm, "direction": along.half_mm},
        "ripple_nm": found.ripple_nm,
        "waves": [_wave(found, k) for k in range(found.periods_mm.size)],
        "warnings": list(found.warnings),
    }
    if psd is not None:
        facts["psd"] = {
            "frequency_per_mm": psd.frequency_per_mm.tolist(),
            "measured_nm2_mm2": (psd.measured_mm4 * NM2_MM2).tolist(),
            "response": psd.response.tolist(),
            "corrected_nm2_mm2": (psd.corrected_mm4 * NM2_MM2).tolist(),
            "standard_error_nm2_mm2": (psd.standard_error_mm4 * NM2_MM2).tolist(),
            "noise_nm2_mm2": (psd.noise_mm4 * NM2_MM2).tolist(),
            "aliased": psd.aliased.tolist(),
            "exponent": psd.exponent,
            "window": "hann",
            "removed": removed,
        }
    return facts


def _wave(found: TransferSummary, k: int) -> dict[str, Any]:
    response = found.response
    height = float(response.height[0, k])
    return {
        "period_mm": float(found.periods_mm[k]),
        "frequency_per_mm": float(1 / found.periods_mm[k]),
        **{name: float(getattr(response, name)[0, k]) for name in FACTORS},
        "phase_rad": float(np.pi) if height < 0 else 0.0,
        "height_over_mirror": {"min": float(found.lowest[k]), "max": float(found.highest[k])},
        "seen_nm": abs(height) * found.ripple_nm,
        "aliased": bool(response.aliased[0, k]),
        "seen_period_mm": float(found.seen_period_mm[k]),
        "seen_direction_deg": float(found.seen_angle_deg[k]),
    }


def transfer_tables(found: TransferSummary, psd: CorrectedPsd | None = None) -> list[Table]:
    """The tables of the terminal."""
    transfer, response = found.transfer, found.response
    names = [
        name for name in FACTORS
        if not ((name == "diffraction" and transfer.wavelength_nm is None)
                or (name == "sharpening" and transfer.how.pixel_average)
                or (name == "model" and not transfer.how.rounds))
    ]  # fmt: skip
    rows = []
    for k, period in enumerate(found.periods_mm):
        over = f"{found.lowest[k]:.3f} to {found.highest[k]:.3f}"
        seen = f"{found.seen_period_mm[k]:.4g} mm" if response.aliased[0, k] else ""
        values = [f"{getattr(response, name)[0, k]:.4f}" for name in names]
        rows.append((f"{period:.4g}", f"{1 / period:.4g}", *values, over,
                     f"{abs(response.height[0, k]) * found.ripple_nm:.3g}", seen))  # fmt: skip
    head = ("period [mm]", "1/mm", *names, "over the mirror", f"of {found.ripple_nm:g} nm [nm]", "seen as")
    if not response.aliased[0].any():  # a column of nothing
        head, rows = head[:-1], [row[:-1] for row in rows]
    x, y = (round(float(place[0]), 1) + 0.0 for place in (found.geometry.x_mm, found.geometry.y_mm))  # no -0.0
    title = (
        f"{transfer.setup.scene.name}, {_how(found)}: waves along {found.angle_deg:g} degrees at "
        f"{x:.1f}, {y:.1f} mm on the mirror"
    )
    limits = [_row(direction) for direction in dict.fromkeys(found.directions)]
    shown = Table("Limits of the height's response", ("along", "Nyquist period [mm]", "half response at [mm]"), limits)
    return [Table(title, head, rows), shown, *([] if psd is None else [_psd_table(psd)])]


def _how(found: TransferSummary) -> str:
    transfer = found.transfer
    if transfer.fringes is not None:
        return f"fringes of {transfer.fringes:g} periods over the screen, {transfer.how.method} integration"
    return f"measure {transfer.name}, {transfer.how.method} integration"


def _row(direction: Direction) -> tuple[str, ...]:
    name = {0.0: "x", 90.0: "y"}.get(direction.angle_deg, f"{direction.angle_deg:g} degrees")
    half = "above half up to Nyquist's" if direction.half_mm is None else f"{direction.half_mm:.4g}"
    return name, f"{direction.nyquist_mm:.4g}", half


def _psd_table(psd: CorrectedPsd) -> Table:
    good = np.flatnonzero(np.isfinite(psd.corrected_mm4))
    rows = [
        (f"{psd.frequency_per_mm[k]:.4g}", f"{psd.measured_mm4[k] * NM2_MM2:.4g}", f"{psd.response[k]:.3f}",
         f"{psd.corrected_mm4[k] * NM2_MM2:.4g}", f"{psd.standard_error_mm4[k] * NM2_MM2:.2g}",
         f"{100 * psd.aliased[k]:.2g} %") for k in good[:: max(1, good.size // ROWS)]
    ]  # fmt: skip
    noise = "noise subtracted" if np.isfinite(psd.noise_mm4).any() else "noise included: the file tells none"
    law = f"; aliased: for a density that goes on as 1/f^{psd.exponent:.2f}" if np.isfinite(psd.exponent) else ""
    head = ("1/mm", "measured [nm^2 mm^2]", "response", "corrected", "+-", "aliased")
    return Table(f"Power spectral density over all directions, {noise}{law}", head, rows)


def sentences(found: TransferSummary, periods: bool) -> list[str]:
    """What becomes of waves, a sentence a line. periods: of all waves; else of the one nearest to half response."""
    height = np.abs(found.response.height[0])
    chosen = range(height.size) if periods else [int(np.nanargmin(np.abs(height - 0.5)))]
    lines = []
    for k in chosen:
        if np.isnan(height[k]):
            lines.append(
                f"a {found.periods_mm[k]:.4g} mm ripple is the same at all pixels: its slope is seen as a tilt"
            )
            continue
        text = (
            f"a {found.periods_mm[k]:.4g} mm ripple of {found.ripple_nm:g} nm would be seen as "
            f"{height[k] * found.ripple_nm:.2g} nm"
        )
        if found.response.aliased[0, k]:
            text += f" of {found.seen_period_mm[k]:.4g} mm along {found.seen_angle_deg[k]:.0f} degrees, an alias"
        elif found.response.height[0, k] < 0:
            text += ", its hills as valleys"
        lines.append(text)
    return lines


def write_transfer_figure(found: TransferSummary, folder: Path, psd: CorrectedPsd | None = None) -> str:
    """The response against frequency, and the spectrum where there is one, as a PNG file in the folder; its name."""
    from matplotlib.figure import Figure

    count = 1 if psd is None else 2
    figure = Figure(figsize=(7 * count, 4.6), layout="tight")
    axes = np.atleast_1d(figure.subplots(1, count))
    nyquist = 1 / found.directions[2].nyquist_mm
    frequency = np.linspace(0, nyquist, CURVE_STEPS + 1)[1:]
    angle = np.radians(found.angle_deg)
    response = found.transfer.response(
        found.geometry, 2 * np.pi * np.multiply.outer(frequency, [np.cos(angle), np.sin(angle)])
    )
    for name in FACTORS:
        values = getattr(response, name)[0]
        if name in ("slope", "height") or np.ptp(values) > 1e-3:
            axes[0].plot(frequency, values, linewidth=2 if name in ("slope", "height") else 1, label=name)
    axes[0].axhline(0.5, color="0.7", linewidth=0.8)
    title = f"{found.transfer.setup.scene.name}, {found.transfer.name}, along {found.angle_deg:g} degrees"
    axes[0].set(xlabel="frequency on the mirror [1/mm]", ylabel="measured over true amplitude", xlim=(0, nyquist),
                title=title)  # fmt: skip
    axes[0].legend(fontsize=8)
    if psd is not None:
        good = np.isfinite(psd.corrected_mm4) & (psd.corrected_mm4 > 0)
        axes[1].loglog(psd.frequency_per_mm, psd.measured_mm4 * NM2_MM2, label="measured")
        axes[1].errorbar(psd.frequency_per_mm[good], psd.corrected_mm4[good] * NM2_MM2,
                         psd.standard_error_mm4[good] * NM2_MM2, fmt=".", label="corrected")  # fmt: skip
        if np.isfinite(psd.noise_mm4).any():
            axes[1].loglog(psd.frequency_per_mm, psd.noise_mm4 * NM2_MM2, ":", label="noise")
        axes[1].set(xlabel="frequency on the mirror [1/mm]", ylabel="power spectral density [nm^2 mm^2]")
        axes[1].legend(fontsize=8)
    with replacing(folder / NAME) as temporary:
        figure.savefig(temporary, dpi=120)
    return NAME
