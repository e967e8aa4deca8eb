"""Error sources: noise that differs from pixel to pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.maths.arrays import FloatArray


@dataclass(frozen=True)
class PlaceNoise:
    """Independent normal errors of all places, of one standard deviation."""

    name: str = "noise.place_mm"
    unit: str = "mm"
    text: str = "noise of each place on the screen"
    usual: float = 1e-3
    kind: Kind = Kind.PROCESS

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in one trial."""
        return value * draw.normal(self.name, 2, design.count)


@dataclass(frozen=True)
class PhotonNoise:
    """Shot noise of a light curve: its centroid is off by its width over the root of its electrons.

    value: 1 over the root of the electrons N of a pixel's whole light curve.
    """

    name: str = "noise.photons"
    unit: str = "1/sqrt(electrons)"
    text: str = "shot noise of the light curves' centroids"
    usual: float = 1e-2
    kind: Kind = Kind.PROCESS

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in one trial."""
        width = np.sqrt(np.einsum("iin->in", design.light.covariance_mm2))
        found: FloatArray = value * width * draw.normal(self.name, 2, design.count)
        return found
