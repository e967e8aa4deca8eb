"""Compares a measured surface with the true one: errors with error bars. Only this package knows both."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.maths.statistics import Estimate, jackknife_error
from irtscots_cl.maths.zernike.indices import index_to_nm, nm_to_noll
from irtscots_cl.measurement.coefficients import FITTED_NOLL, Coefficients, coefficients, terms_disk
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.optics.departure import ZernikeDeparture, deviations
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.shown import html_table, one_line

HEIGHT_TERMS = ("piston", "piston_tilt", "piston_tilt_power")  # terms removed before a height error is computed
SAME_RATIO = 1e-9  # of holes: that of a table and of the mirror, a quotient of diameters


@dataclass(frozen=True)
class ZernikeRow:
    """A Noll-normalised coefficient of the deviation [um]: the scene's value and the measured one.

    output_um: NaN for a term of the scene that the pixels cannot separate. expected_um: what the same fit over the same
    pixels gives for the true deviation, its mean removed as in a measured one. It differs from input_um in piston, and
    where terms were left out of the fit. Where the deviation is not the sum of terms of the kind that is fitted,
    input_um is expected_um. inflation: of the standard error over that on a whole disk (maths.zernike.fit).
    """

    noll: int
    input_um: float
    output_um: float
    standard_error_um: float
    expected_um: float
    inflation: float


@dataclass(frozen=True)
class Comparison:
    """Errors of a reconstruction: slopes rms over its mask, heights over its largest group of joined islands.

    slope_error_urad: "x", "y". height_error_nm: by the terms removed, HEIGHT_TERMS. error_mm: [rows, columns] deviation
    minus true deviation, without piston and tilt; each group of islands has a piston of its own.
    height_standard_error_nm: statistical error, rms. zernike_fit: how the coefficients were fitted.
    """

    pixels_used: int
    slope_error_urad: dict[str, Estimate]
    height_error_nm: dict[str, Estimate]
    height_standard_error_nm: float
    zernike: tuple[ZernikeRow, ...]
    zernike_fit: Coefficients
    error_mm: np.ndarray

    __repr__ = one_line
    _repr_html_ = html_table

    def summary(self) -> dict[str, str]:
        """Errors of slopes and heights; str() has the Zernike terms, too."""
        return {
            "pixels used": str(self.pixels_used),
            **{f"slope error {axis}": f"{value} urad rms" for axis, value in self.slope_error_urad.items()},
            **{
                f"height error without {terms.replace('_', ', ')}": f"{value} nm rms"
                for terms, value in self.height_error_nm.items()
            },
        }

    def __str__(self) -> str:
        lines = [f"pixels used               {self.pixels_used}"]
        lines += [f"slope error {axis} [urad rms]  {value}" for axis, value in self.slope_error_urad.items()]
        lines += [
            f"height error [nm rms]     {value}   without {terms.replace('_', ', ')}"
            for terms, value in self.height_error_nm.items()
        ]
        if self.zernike_fit.fit.dropped:
            lines.append(f"Zernike terms not separable by the pixels: Noll {self.zernike_fit.fit.dropped[0]} and on")
        lines += ["Noll   input [um]  output [um]"]
        lines += [
            f"{row.noll:4d}   {row.input_um:10.4f}  {Estimate(row.output_um, row.standard_error_um)}"
            for row in self.zernike
            if row.input_um != 0
        ]
        return "\n".join(lines)


def compare(result: Reconstruction, scene: Scene, zernike: str = "circular") -> Comparison:
    """Errors of a reconstruction against the scene's true mirror, with standard errors by the jackknife.

    zernike: kind of the terms that are fitted, of measurement.coefficients.KINDS; ValueError for another.
    """
    surface, mask, joined = Surface.of(scene.mirror), result.mask, result.height_mask
    x, y = result.x_mm, result.y_mm
    truth = dict(zip(("x", "y"), surface.gradient(x, y), strict=True))
    slopes = {
        axis: _estimate([rms(s - truth[axis], mask) * 1e6 for s in result.estimates(f"slope_{axis}")])
        for axis in ("x", "y")
    }
    true_mm = surface.deviation_at(x, y)[0]
    errors = result.estimates("deviation_mm") - true_mm
    heights = {
        terms: _estimate([rms(remove_terms(x, y, e, joined, terms), joined) * 1e6 for e in errors])
        for terms in HEIGHT_TERMS
    }
    rows, fit = _zernike_rows(result, scene, zernike, true_mm)
    return Comparison(
        result.pixels_used,
        slopes,
        heights,
        rms(result.height_standard_error_mm() * 1e6, joined) if len(errors) > 2 else float("nan"),
        rows,
        fit,
        result.levelled(errors[0]),
    )


def _estimate(values: list[float]) -> Estimate:
    return Estimate(values[0], float(jackknife_error(np.array(values))))


def _is_sum_of_terms(mirror: Mirror, kind: str) -> bool:
    """Whether a mirror's deviation is nothing but terms of that kind, on one disk or ring: that of the terms fitted."""
    radius_mm, ratio = terms_disk(mirror, kind)
    alone = all(isinstance(departure, ZernikeDeparture) for departure in deviations(mirror))
    return alone and all(
        terms.radius_mm == radius_mm and math.isclose(terms.obscuration, ratio, abs_tol=SAME_RATIO)
        for terms in mirror.zernike
    )


def _zernike_rows(
    result: Reconstruction, scene: Scene, kind: str, truth_mm: FloatArray
) -> tuple[tuple[ZernikeRow, ...], Coefficients]:
    """Noll terms 1 to FITTED_NOLL and all of the scene's, fitted together by least squares over the mask."""
    given: dict[int, float] = {}
    for terms in scene.mirror.zernike:
        for index, value in terms.coefficients_um.items():
            noll = nm_to_noll(*index_to_nm(index, terms.ordering))
            given[noll] = given.get(noll, 0.0) + value
    known = _is_sum_of_terms(scene.mirror, kind)
    indices = sorted(set(range(1, FITTED_NOLL + 1)) | set(given))
    found = coefficients(result, scene.mirror, kind, indices, noise_errors=False)
    # the measured deviation has a mean of 0 over the heights' mask by convention
    true_um = (truth_mm - truth_mm[result.height_mask].mean())[result.mask] * 1e3
    expected = found.fit.coefficients(true_um).tolist()
    columns = zip(found.fit.nolls, found.um.tolist(), found.standard_error_um.tolist(), expected,
                  found.fit.inflation.tolist(), strict=True)  # fmt: skip
    rows = [
        ZernikeRow(noll, given.get(noll, 0.0) if known else own, um, error, own, inflation)
        for noll, um, error, own, inflation in columns
    ]
    if known:
        lost = [noll for noll in found.fit.dropped if given.get(noll)]
        rows += [ZernikeRow(noll, given[noll], math.nan, math.nan, math.nan, math.inf) for noll in lost]
    return tuple(rows), found
