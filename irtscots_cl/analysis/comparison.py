"""Compares a measured surface with the true one: errors with error bars. Only this package knows both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.maths.statistics import Estimate, jackknife_error
from irtscots_cl.maths.zernike.indices import index_to_nm, nm_to_noll
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.model import Scene

HEIGHT_TERMS = ("piston", "piston_tilt", "piston_tilt_power")  # terms removed before a height error is computed
FITTED_NOLL = 45  # radial orders up to 8


@dataclass(frozen=True)
class ZernikeRow:
    """A Noll-normalised coefficient of the deviation [um]: the scene's value and the measured one."""

    noll: int
    input_um: float
    output_um: float
    standard_error_um: float


@dataclass(frozen=True)
class Comparison:
    """Errors of a reconstruction, rms over its mask.

    slope_error_urad: "x", "y". height_error_nm: by the terms removed, HEIGHT_TERMS. error_mm: [rows, columns] deviation
    minus true deviation, without piston and tilt. height_standard_error_nm: statistical error, rms over the mask.
    """

    pixels_used: int
    slope_error_urad: dict[str, Estimate]
    height_error_nm: dict[str, Estimate]
    height_standard_error_nm: float
    zernike: tuple[ZernikeRow, ...]
    error_mm: np.ndarray

    def __str__(self) -> str:
        lines = [f"pixels used               {self.pixels_used}"]
        lines += [f"slope error {axis} [urad rms]  {value}" for axis, value in self.slope_error_urad.items()]
        lines += [
            f"height error [nm rms]     {value}   without {terms.replace('_', ', ')}"
            for terms, value in self.height_error_nm.items()
        ]
        lines += ["Noll   input [um]  output [um]"]
        lines += [
            f"{row.noll:4d}   {row.input_um:10.4f}  {Estimate(row.output_um, row.standard_error_um)}"
            for row in self.zernike
            if row.input_um != 0
        ]
        return "\n".join(lines)


def compare(result: Reconstruction, scene: Scene) -> Comparison:
    """Errors of a reconstruction against the scene's true mirror, with standard errors by the jackknife."""
    surface, mask = Surface.of(scene.mirror), result.mask
    x, y = result.x_mm, result.y_mm
    truth = dict(zip(("x", "y"), surface.gradient(x, y), strict=True))
    slopes = {
        axis: _estimate([rms(s - truth[axis], mask) * 1e6 for s in result.estimates(f"slope_{axis}")])
        for axis in ("x", "y")
    }
    errors = result.estimates("deviation_mm") - surface.deviation_at(x, y)[0]
    heights = {
        terms: _estimate([rms(remove_terms(x, y, e, mask, terms), mask) * 1e6 for e in errors])
        for terms in HEIGHT_TERMS
    }
    return Comparison(
        result.pixels_used,
        slopes,
        heights,
        rms(result.height_standard_error_mm() * 1e6, mask) if len(errors) > 2 else float("nan"),
        _zernike_rows(result, scene),
        remove_terms(x, y, errors[0], mask, "piston_tilt"),
    )


def _estimate(values: list[float]) -> Estimate:
    return Estimate(values[0], float(jackknife_error(np.array(values))))


def _zernike_rows(result: Reconstruction, scene: Scene) -> tuple[ZernikeRow, ...]:
    """Noll terms 1 to FITTED_NOLL and all of the scene's, fitted together by least squares over the mask.

    Returns no rows if there are too few pixels to separate the terms.
    """
    given: dict[int, float] = {}
    for terms in scene.mirror.zernike:
        for index, value in terms.coefficients_um.items():
            noll = nm_to_noll(*index_to_nm(index, terms.ordering))
            given[noll] = given.get(noll, 0.0) + value
    indices = sorted(set(range(1, FITTED_NOLL + 1)) | set(given))
    radius = scene.mirror.zernike[0].radius_mm if scene.mirror.zernike else scene.mirror.diameter_mm / 2
    x, y = result.x_mm[result.mask] / radius, result.y_mm[result.mask] / radius
    basis = np.stack([zernike(noll, x, y) for noll in indices], axis=1)
    maps_um = result.estimates("deviation_mm")[:, result.mask] * 1e3
    fits, _, rank, _ = np.linalg.lstsq(basis, maps_um.T)
    if rank < len(indices):
        return ()
    fits = fits.T
    errors = jackknife_error(fits)
    return tuple(
        ZernikeRow(noll, given.get(noll, 0.0), float(fits[0, i]), float(errors[i])) for i, noll in enumerate(indices)
    )
