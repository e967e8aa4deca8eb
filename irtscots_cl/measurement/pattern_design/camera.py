"""The camera that a choice of patterns assumes: electrons in a pixel, their noise, and the time of a frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from irtscots_cl.measurement.phase import FrameNoise
from irtscots_cl.system.option_error import OptionError

FULL_WELL_E, READ_NOISE_E, BITS = 10_000.0, 2.5, 12  # of an industrial CMOS sensor of 3.45 um pixels
FILLED = 0.9  # of the full well, for the brightest pixel
FRAME_S, EXPOSURE_S = 0.1, 0.05  # a monitor takes that long to settle
MAX_BITS = 16
LIMITS = {
    "electrons": (1.0, 1e12), "full_well_e": (1.0, 1e12), "read_noise_e": (0.0, 1e12), "bits": (1, MAX_BITS),
    "frame_s": (0.0, 1e6), "exposure_s": (1e-9, 1e6),
}  # fmt: skip


@dataclass(frozen=True)
class DesignCamera:
    """electrons: in a frame of a white screen in the brightest pixel. read_noise_e: rms. step_e: electrons per count, 0
    for values that are not rounded. dark_e: mean of a frame without light. shot: whether light has noise. exposure_s:
    that brings those electrons; frame_s: what else a frame takes."""

    electrons: float
    read_noise_e: float
    step_e: float = 0.0
    dark_e: float = 0.0
    shot: bool = True
    exposure_s: float = EXPOSURE_S
    frame_s: float = FRAME_S

    @property
    def noise(self) -> FrameNoise:
        """Of a frame, in electrons."""
        dark = self.dark_e if self.shot else 0.0
        return FrameNoise(self.read_noise_e**2 + self.step_e**2 / 12 + dark, 1.0 if self.shot else 0.0)

    @property
    def without_rounding(self) -> DesignCamera:
        return replace(self, step_e=0.0)


def check_camera(**given: float | None) -> None:
    """Raise ValueError for a number outside its LIMITS; None is none."""
    for name, value in given.items():
        low, high = LIMITS[name]
        if value is not None and not low <= value <= high:
            option = {"electrons": "electrons", "full_well_e": "full-well", "read_noise_e": "read-noise",
                      "bits": "bits", "frame_s": "frame-time", "exposure_s": "exposure"}[name]  # fmt: skip
            raise OptionError(f"--{option} = {value:g}: must be from {low:g} to {high:g}")


def camera_of(
    table: Any,
    white_w: float,
    *,
    electrons: float | None = None,
    full_well_e: float | None = None,
    read_noise_e: float | None = None,
    bits: int | None = None,
    exposure_s: float | None = None,
    frame_s: float | None = None,
) -> DesignCamera:
    """The camera of a scene's table [camera.detector.noise] (a DetectorNoise or None), with what is given instead.

    white_w: flux in W of the brightest pixel under a white screen. What neither says is that of a usual sensor.
    Raises ValueError for numbers outside LIMITS, more electrons than the full well, or a camera without any noise.
    """
    check_camera(electrons=electrons, full_well_e=full_well_e, read_noise_e=read_noise_e, bits=bits,
                 exposure_s=exposure_s, frame_s=frame_s)  # fmt: skip
    seconds = exposure_s or getattr(table, "exposure_s", None)
    well = full_well_e or getattr(table, "full_well_e", None)
    peak = electrons or peak_electrons(table, white_w, seconds) or (FILLED * (well or FULL_WELL_E))
    if well is not None and peak > well:
        raise OptionError(
            f"{peak:.4g} electrons in the brightest pixel under a white screen and a full well of {well:.4g}: must be "
            "at most as many; a shorter exposure, or --electrons"
        )
    found = DesignCamera(
        electrons=peak,
        read_noise_e=read_noise_e if read_noise_e is not None else getattr(table, "read_noise_e", READ_NOISE_E),
        step_e=_step_e(table, bits, well or peak / FILLED),
        dark_e=getattr(table, "dark_current_e_per_s", 0.0) * (seconds or 0.0),
        shot=getattr(table, "shot_noise", True),
        exposure_s=seconds or EXPOSURE_S,
        frame_s=FRAME_S if frame_s is None else frame_s,
    )
    if not (found.noise.read > 0 or found.noise.gain > 0):
        raise OptionError(
            "the camera has neither read noise nor shot noise nor bits: all patterns are exact; must have some, as by "
            "camera.detector.noise.shot_noise = true or --read-noise"
        )
    return found


def peak_electrons(table: Any, white_w: float, seconds: float | None) -> float | None:
    """Electrons of the brightest pixel under a white screen by the table; None where it does not say."""
    if table is None:
        return None
    if table.electrons_at_peak is not None:
        return float(table.electrons_at_peak)
    if table.quantum_efficiency is None or table.wavelength_nm is None or seconds is None:
        return None
    from irtscots_cl.imaging.detector import electrons_per_w  # imported late: few scenes have the table

    per_w = electrons_per_w(replace(table, exposure_s=seconds), white_w)
    return per_w * white_w if math.isfinite(per_w) and per_w * white_w > 0 else None


def _step_e(table: Any, bits: int | None, well_e: float) -> float:
    """Electrons per count: those of the bits given over the full well, or of the table; of BITS without a table."""
    if bits is None and table is not None:
        return float(table.gain_e_per_dn) if table.bits is not None else 0.0
    return float(well_e / (2 ** (bits or BITS) - 1))
