"""The Zernike sets of CODE V's interferograms: order of the terms, values on a grid, and the fit to a map.

Coefficients are those of polynomials that are 1 at the rim (not Noll-normalised), with x = r cos t, y = r sin t.
ZFR: the University of Arizona fringe set. ZRN: by ascending order n; within an order cosines from cos(n t) downwards,
then sines upwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.map_figures import Unit
from irtscots_cl.maths.zernike.grid_fit import grid_fit
from irtscots_cl.maths.zernike.indices import fringe_to_nm, nm_to_noll
from irtscots_cl.maths.zernike.polynomials import normalisation, zernike

NAMES = {"ZFR": "fringe", "ZRN": "standard"}
DEFAULT_SAMPLES = 255
MAX_TERMS = 120
MAX_INFLATION = 1e4  # of a term's error over that on a whole disk


@dataclass(frozen=True)
class Disk:
    """The unit disk on a map's pixels: radius and centre in pixels, pixel k's centre at k, row 0 at the bottom."""

    radius: float
    row: float
    column: float


def term_nm(name: str, number: int) -> tuple[int, int]:
    """(n, m) of the term of a number, from 1; m > 0 a cosine, m < 0 a sine."""
    if name == "ZFR":
        return fringe_to_nm(number)
    order, first = 0, 1
    while number >= first + order + 1:
        first += order + 1
        order += 1
    return order, order - 2 * (number - first)


def terms(name: str, count: int, x: ArrayLike, y: ArrayLike) -> FloatArray:
    """Values [terms, samples] of the first `count` terms, 1 at the rim."""
    rows = []
    for number in range(1, count + 1):
        n, m = term_nm(name, number)
        rows.append(zernike(nm_to_noll(n, m), x, y) / normalisation(n, m))
    return np.stack(rows)


def samples_of(name: str, coefficients: FloatArray, samples: int) -> FloatArray:
    """The sum of the terms on a square of pixels, the rim on the outer edges of the outer pixels; NaN outside."""
    place = (2 * np.arange(samples) + 1 - samples) / samples
    x, y = np.meshgrid(place, place)
    inside = x * x + y * y <= 1
    values = np.full((samples, samples), np.nan)
    total = np.zeros(int(inside.sum()))
    for number, coefficient in enumerate(coefficients, 1):
        if coefficient:
            n, m = term_nm(name, number)
            total += coefficient / normalisation(n, m) * zernike(nm_to_noll(n, m), x[inside], y[inside])
    values[inside] = total
    return values


def enclosing_disk(height_map: HeightMap) -> Disk:
    """The smallest circle about the middle of the valid pixels' bounding box that holds these pixels' centres, and
    half a pixel more."""
    rows, columns = np.nonzero(height_map.valid)
    row, column = (rows.min() + rows.max()) / 2, (columns.min() + columns.max()) / 2
    return Disk(float(np.hypot(rows - row, columns - column).max()) + 0.5, float(row), float(column))


def disk_in_pixels(height_map: HeightMap, disk: Unit) -> Disk:
    """A disk in mm on the map's pixels; one in pixels from the map's middle where the pitch is unknown."""
    pitch = 1.0 if height_map.pitch_mm is None else height_map.pitch_mm[0]
    rows, columns = height_map.heights_mm.shape
    x, y = ((at - middle) / pitch for at, middle in zip((disk.x_mm, disk.y_mm), height_map.centre_mm, strict=True))
    return Disk(disk.radius_mm / pitch, (rows - 1) / 2 + y, (columns - 1) / 2 + x)


def fitted(
    where: str, name: str, height_map: HeightMap, count: int, disk: Disk | None
) -> tuple[FloatArray, Disk, float]:
    """Coefficients [count] in mm by least squares over the valid pixels on the disk, the disk, and the rms left.

    Raises ValueError for pixels that are not square and samples that cannot separate the terms.
    """
    if not 1 <= count <= MAX_TERMS:
        raise ValueError(f"{where}: {count} Zernike terms: must be 1 to {MAX_TERMS}")
    if height_map.pitch_mm and abs(height_map.pitch_mm[0] / height_map.pitch_mm[1] - 1) > 1e-9:
        raise ValueError(f"{where}: pixels that are not square: a Zernike fit needs square ones")
    disk = disk or enclosing_disk(height_map)
    rows, columns = height_map.heights_mm.shape
    u = np.asarray((np.arange(columns) - disk.column) / disk.radius, np.float64)
    v = np.asarray((np.arange(rows) - disk.row) / disk.radius, np.float64)
    inside = height_map.valid & (u[None, :] ** 2 + v[:, None] ** 2 <= 1 + 1e-12)
    pairs = [term_nm(name, number) for number in range(1, count + 1)]
    nolls = [nm_to_noll(n, m) for n, m in pairs]
    pixels = int(inside.sum())
    fit = grid_fit(u, v, inside, nolls, MAX_INFLATION) if pixels >= count else None
    if fit is None or fit.dropped:
        raise ValueError(f"{where}: {pixels} pixels on the disk cannot separate {count} Zernike terms: ask for fewer")
    of_noll = fit.coefficients(height_map.heights_mm)
    rest = (height_map.heights_mm - fit.values(of_noll))[inside]
    by_noll = dict(zip(fit.nolls, of_noll, strict=True))
    found = np.array([by_noll[j] * normalisation(n, m) for j, (n, m) in zip(nolls, pairs, strict=True)])
    return found, disk, float(np.sqrt(np.mean(rest**2)))
