"""Scatter from the mirror (paper, section 3.3 and figure 10): what the closed forms say; no rays are scattered yet."""

from __future__ import annotations

import math

import numpy as np

from irtscots_cl.comparison import Estimate
from irtscots_cl.presets import load_scene
from irtscots_cl.studies.lab import Lab
from irtscots_cl.studies.outcome import NOT_YET, Outcome, Row, exact, row

TITLE = "Scattered light (figure 10)"
SIGMA_NM, WAVELENGTH_NM = 2.0, 500.0
LOBE = {"l": 0.01, "s": -1.5}  # of Harvey's model; the paper does not state its own
PRINTED_TIS, PRINTED_RATIO, PRINTED_HEIGHT_NM = 0.0025, 1e-8, 3.8e-10


def tis_of_roughness(sigma_nm: float, wavelength_nm: float) -> float:
    """Total integrated scatter of a smooth mirror at normal incidence (Davies 1954); sigma is an rms, not Ra."""
    return (4 * math.pi * sigma_nm / wavelength_nm) ** 2


def harvey_b0(tis: float, l: float, s: float) -> float:
    """b0 [1/sr] of a Harvey lobe b0 (1 + (beta / l)^2)^(s / 2) of that total integrated scatter, s not -2."""
    return tis * (s + 2) / (2 * math.pi * l**2 * ((1 + 1 / l**2) ** ((s + 2) / 2) - 1))


def study(lab: Lab) -> Outcome:
    scene = load_scene("sphere")
    tis = tis_of_roughness(SIGMA_NM, WAVELENGTH_NM)
    b0 = harvey_b0(tis, **LOBE)
    distance = np.linalg.norm(scene.screen.position_mm)
    line_solid_angle = scene.screen.pitch_mm * scene.screen.pixels[1] * scene.screen.pitch_mm / distance**2
    nothing = Estimate(math.nan, math.nan)
    why = "needs rays that scatter, which this version does not trace"
    return Outcome((
        row("TIS of 2 nm rms at 500 nm", exact(tis), paper=PRINTED_TIS, closeness=0.02),
        row("b0 of the lobe with that TIS [1/sr]", exact(b0)),
        row("scattered over specular irradiance, b0 x the line's solid angle", exact(b0 * line_solid_angle),
            paper=PRINTED_RATIO, closeness=0.5),
        Row("the same by tracing", PRINTED_RATIO, b0 * line_solid_angle, nothing, NOT_YET, why),
        Row("effect on the height [nm]", PRINTED_HEIGHT_NM, math.nan, nothing, NOT_YET, why),
    ), (
        f"Harvey lobe with L = {LOBE['l']}, S = {LOBE['s']}: the paper states only the TIS",
        "roughness is taken as an rms (Rq); the paper's 2 nm is an Ra, whose Rq is 1.1 to 1.25 times that",
        "closed forms only: no rays, no seed",
    ))  # fmt: skip
