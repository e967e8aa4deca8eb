"""Figures of a height map on a grid: rms, PV, PVr, slopes and Zernike terms, with low-order terms removed.

All arrays are [rows, columns], x growing with the column, y with the row; NaN where a height is invalid.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.low_order import TERMS, remove_terms
from irtscots_cl.maths.zernike.grid_fit import grid_fit
from irtscots_cl.maths.zernike.indices import fringe_to_nm, nm_to_noll

PVR_TERMS = 36  # of the fringe set
PVR_SIGMAS = 3.0
RIM = 1e-9


@dataclass(frozen=True)
class Unit:
    """The disk that Zernike terms live on, mm: radius and centre."""

    radius_mm: float
    x_mm: float
    y_mm: float


@dataclass(frozen=True)
class MapFigures:
    """Figures of a map's valid pixels. removed: one of low_order.TERMS. Heights in mm, slopes in rad (nan where no two
    neighbours along the axis are valid)."""

    removed: str
    pixels: int
    rms_mm: float
    pv_mm: float
    slope_rms_rad: tuple[float, float]


@dataclass(frozen=True)
class ZernikeFigures:
    """Noll coefficients [terms] in mm of a map on a disk, what they leave, and PVr.

    dropped: terms that the pixels cannot tell apart from the others. rest_rms_mm: of the map with low-order terms
    removed. pvr_mm: the fit's PV and three times the rms that it leaves. fitted_pixels: the valid ones on the disk.
    """

    disk: Unit
    nolls: tuple[int, ...]
    coefficients_mm: FloatArray = field(repr=False)
    dropped: tuple[int, ...]
    rest_rms_mm: float
    pvr_mm: float
    fitted_pixels: int


def figures(heights: FloatArray, x: FloatArray, y: FloatArray, removed: str) -> MapFigures:
    """The figures with low-order terms removed. Raises ValueError as remove_terms does."""
    left = remove_terms(x, y, heights, np.isfinite(heights), removed)
    good = left[np.isfinite(left)]
    slopes = tuple(_rms(np.diff(left, axis=axis) / np.diff(place, axis=axis)) for axis, place in ((1, x), (0, y)))
    return MapFigures(
        removed, good.size, _rms(good), float(good.max() - good.min()), (slopes[0], slopes[1])
    )  # fmt: skip


def all_figures(heights: FloatArray, x: FloatArray, y: FloatArray) -> tuple[MapFigures, ...]:
    """Figures with piston, tilt, power and astigmatism removed in turn; those that the pixels can tell apart."""
    count = int(np.isfinite(heights).sum())
    return tuple(
        figures(heights, x, y, terms) for terms, need in zip(TERMS, (1, 1, 3, 4, 6), strict=True) if count >= need
    )


def _rms(values: FloatArray) -> float:
    good = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(good**2))) if good.size else float("nan")


def enclosing_disk(heights: FloatArray, x: FloatArray, y: FloatArray) -> Unit:
    """The smallest circle about the middle of the valid pixels' bounding box that holds their centres, and half a
    pixel more, as the pixels themselves reach out so far."""
    good = np.isfinite(heights)
    px, py = x[good], y[good]
    middle_x, middle_y = float(px.min() + px.max()) / 2, float(py.min() + py.max()) / 2
    pitch = float(max(np.abs(np.diff(x, axis=1)).max(initial=0), np.abs(np.diff(y, axis=0)).max(initial=0)))
    return Unit(float(np.hypot(px - middle_x, py - middle_y).max()) + pitch / 2, middle_x, middle_y)


def zernike_figures(
    heights: FloatArray,
    x: FloatArray,
    y: FloatArray,
    removed: str = "none",
    disk: Unit | None = None,
    count: int = PVR_TERMS,
) -> ZernikeFigures:
    """Zernike terms of a map as it is, and its PVr with low-order terms removed: the PV of the fit of `count` fringe
    terms plus three times the rest's rms.

    removed: one of low_order.TERMS, for PVr. disk: default: enclosing_disk; pixels outside it are left out. Source:
    C. J. Evans, "PVr: a robust amplitude parameter for optical surface specification", Opt. Eng. 48, 043605 (2009),
    with 36 terms over the whole aperture.

    Raises ValueError where no pixel is on the disk.
    """
    disk = disk or enclosing_disk(heights, x, y)
    u, v = (x - disk.x_mm) / disk.radius_mm, (y - disk.y_mm) / disk.radius_mm
    used = np.isfinite(heights) & (u * u + v * v <= 1 + RIM)
    if not used.any():
        raise ValueError("no valid pixel is on the disk of the Zernike terms")
    left = remove_terms(x, y, heights, np.isfinite(heights), removed)
    fit = grid_fit(u[0], v[:, 0], used, [nm_to_noll(*fringe_to_nm(j)) for j in range(1, count + 1)])
    smooth = fit.values(fit.coefficients(left))[used]
    rest_rms = _rms(left[used] - smooth)
    pvr = float(np.ptp(smooth)) + PVR_SIGMAS * rest_rms
    whole = fit.coefficients(heights)
    return ZernikeFigures(disk, fit.nolls, whole, fit.dropped, rest_rms, pvr, smooth.size)
