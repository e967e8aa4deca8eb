"""Noise and limits of a camera's detector: the table [camera.detector.noise].

Only scenes with that table import this module.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from irtscots_cl.scene.validation import NumpyFile, Seed, bounded, checked, refuse

MAX_BITS = 16
_ELECTRONS = bounded(gt=0, le=1e12)
_SECONDS = bounded(gt=0, le=1e6)
_EFFICIENCY = bounded(gt=0, le=1)
_WAVELENGTH = bounded(gt=0, le=1e6)
_SHARE = bounded(ge=0, le=1)
_AT_LEAST_0 = bounded(ge=0, le=1e12)


@checked("noise")
class DetectorNoise:
    """How light becomes digital numbers (DN); each effect is off by default.

    The exposure is stated by electrons_at_peak, or by exposure_s, quantum_efficiency and wavelength_nm together.
    docs/detector.md has the order of the effects. Raises SceneError for a value that is not allowed.
    """

    electrons_at_peak: Annotated[
        Annotated[float, Strict(), _ELECTRONS] | None, Field(description=_ELECTRONS.description)
    ] = None
    exposure_s: Annotated[Annotated[float, Strict(), _SECONDS] | None, Field(description=_SECONDS.description)] = None
    quantum_efficiency: Annotated[
        Annotated[float, Strict(), _EFFICIENCY] | None, Field(description=_EFFICIENCY.description)
    ] = None
    wavelength_nm: Annotated[
        Annotated[float, Strict(), _WAVELENGTH] | None, Field(description=_WAVELENGTH.description)
    ] = None
    quantum_efficiency_map: NumpyFile = None
    prnu: Annotated[float, Strict(), _SHARE] = 0.0
    dead_pixel_share: Annotated[float, Strict(), _SHARE] = 0.0
    shot_noise: Annotated[bool, Strict(), Field(description="true or false")] = False
    dark_current_e_per_s: Annotated[float, Strict(), _AT_LEAST_0] = 0.0
    hot_pixel_share: Annotated[float, Strict(), _SHARE] = 0.0
    hot_pixel_e: Annotated[float, Strict(), _AT_LEAST_0] = 0.0
    read_noise_e: Annotated[float, Strict(), _AT_LEAST_0] = 0.0
    full_well_e: Annotated[Annotated[float, Strict(), _ELECTRONS] | None, Field(description=_ELECTRONS.description)] = (
        None
    )
    gain_e_per_dn: Annotated[float, Strict(), bounded(ge=1e-6, le=1e12)] = 1.0
    offset_dn: Annotated[float, Strict(), bounded(ge=0, le=1e12)] = 0.0
    bits: Annotated[
        Annotated[int, Strict(), Field(ge=1, le=MAX_BITS)] | None,
        Field(description=f"an integer from 1 to {MAX_BITS}"),
    ] = None
    justification: Annotated[Literal["right", "left"], Field(description="right or left")] = "right"
    frames_averaged: Annotated[int, Strict(), Field(ge=1, le=10000, description="an integer from 1 to 10000")] = 1
    dark_frames: Annotated[int, Strict(), Field(ge=0, le=10000, description="an integer from 0 to 10000")] = 0
    exposures: Annotated[int, Strict(), Field(ge=1, le=1000, description="an integer from 1 to 1000")] = 1
    seed: Seed = 1

    @property
    def is_off(self) -> bool:
        """Whether nothing changes the light: images stay as they were computed, in W."""
        return not (
            self.shot_noise or self.prnu or self.dead_pixel_share or self.dark_current_e_per_s or self.hot_pixel_share
            or self.read_noise_e or self.offset_dn or self.quantum_efficiency_map or self.full_well_e or self.bits
        )  # fmt: skip

    @property
    def is_nonlinear(self) -> bool:
        """Whether frames are limited or rounded one by one, so that their mean is not the record of their sum."""
        return self.full_well_e is not None or self.bits is not None

    @model_validator(mode="after")
    def _check(self) -> DetectorNoise:
        self._check_exposure()
        if self.dark_current_e_per_s and self.exposure_s is None:
            refuse(("exposure_s",), self.exposure_s, "be given with dark_current_e_per_s")
        if bool(self.hot_pixel_share) != bool(self.hot_pixel_e):
            key = "hot_pixel_e" if self.hot_pixel_share else "hot_pixel_share"
            refuse((key,), getattr(self, key), "be above 0: hot_pixel_share and hot_pixel_e go together")
        if self.justification == "left" and self.bits is None:
            refuse(("justification",), self.justification, "be left out without bits")
        if self.bits is not None and self.offset_dn > 2**self.bits - 1:
            refuse(("offset_dn",), self.offset_dn, f"be at most {2**self.bits - 1}, the largest number of the bits")
        return self

    def _check_exposure(self) -> None:
        for key in ("quantum_efficiency", "wavelength_nm"):
            if self.electrons_at_peak is not None and getattr(self, key) is not None:
                refuse((key,), getattr(self, key), "be left out with electrons_at_peak, which states the exposure")
        if self.electrons_at_peak is not None or self.is_off:
            return
        for key in ("exposure_s", "quantum_efficiency", "wavelength_nm"):
            if getattr(self, key) is None:
                refuse((key,), getattr(self, key), "be given, or electrons_at_peak, to turn flux into electrons")
