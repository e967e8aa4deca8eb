"""Whether the camera's pixels are saturated, or nearly dark, at the scene's exposure."""

from __future__ import annotations

from irtscots_cl.measurement.pattern_design.camera import peak_electrons
from irtscots_cl.measurement.pattern_design.pixels import seen_pixels
from irtscots_cl.optics.pixel.light import whole_flux_w
from irtscots_cl.optics.setup import Setup
from irtscots_cl.planning.finding import Finding

DARK_E = 200.0  # electrons in the brightest pixel under a white screen: shot noise of 7 %
FULL = 0.98  # of the full well or of the largest count


def check_exposure(setup: Setup) -> list[Finding]:
    """Findings about the brightest pixel under a white screen; none if the scene does not tell its electrons.

    Raises ValueError where no pixel sees the screen.
    """
    table = setup.scene.camera.detector.noise
    if table is None:
        return []
    white_w = float(seen_pixels(setup).white_share * whole_flux_w(setup.chief_rays))
    peak = peak_electrons(table, white_w, table.exposure_s)
    if peak is None:
        return []
    text = f"the brightest pixel collects {peak:.3g} electrons under a white screen"
    room = _room_e(table)
    if peak > FULL * room:
        text += f", its limit is {room:.3g}: needs {FULL * room / peak:.2g} of the exposure or of the screen's radiance"
        return [Finding("saturated", "error" if peak > 2 * room else "warning", text)]
    if peak < DARK_E:
        return [
            Finding("too-dark", "warning", f"{text}: needs {DARK_E / peak:.2g} times the exposure, or a wider aperture")
        ]
    return []


def _room_e(table) -> float:
    """Electrons at which a pixel is full, or its count the largest."""
    counts = float("inf") if table.bits is None else (2**table.bits - 1 - table.offset_dn) * table.gain_e_per_dn
    return min(counts, table.full_well_e or float("inf"))
