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
from irtscots_cl.maths.zernike.indices import fringe_to_nm, nm_to_noll
from irtscots_cl.maths.zernike.polynomials import normalisation, zernike

NAMES = {"ZFR": "fringe", "ZRN": "standard"}
DEFAULT_SAMPLES = 255
MAX_TERMS = 120
MAX_CONDITION = 1e6  # of the terms' values at the pixels


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
    rows, columns = np.nonzero(height_map.valid)
    x, y = ((at - middle) / disk.radius for at, middle in ((columns, disk.column), (rows, disk.row)))
    inside = x * x + y * y <= 1 + 1e-12
    values = height_map.heights_mm[rows, columns][inside]
    basis = terms(name, count, x[inside], y[inside]).T
    solution = np.linalg.lstsq(basis, values) if len(values) >= count else None
    if solution is None or solution[3][-1] * MAX_CONDITION < solution[3][0]:
        raise ValueError(
            f"{where}: {len(values)} pixels on the disk cannot separate {count} Zernike terms: ask for fewer"
        )
    found = np.asarray(solution[0], np.float64)
    rest = values - basis @ found
    return found, disk, float(np.sqrt(np.mean(rest**2)))
