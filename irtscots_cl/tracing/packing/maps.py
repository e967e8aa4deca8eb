"""A mirror's height maps as the kernels' structures and tables."""

from __future__ import annotations

import numpy as np

from irtscots_cl.opencl.structs import map_grid_dtype
from irtscots_cl.optics.height_map import MapDeparture

MAX_NUMBERS = 2**31 - 1  # of all tables: their places are 32-bit integers


def pack_maps(departure: MapDeparture, real, first: int):
    """For kernels/mirror/map_bicubic.cl: choices, structures, constants, values, and numbers [n] of the tables, where
    they begin at `first`.

    Raises ValueError for more than the kernels can count.
    """
    grid = map_grid_dtype(real)
    out = np.zeros((), np.dtype([("grid", grid, len(departure.maps))], align=True))
    numbers = []
    for entry, placed in zip(out["grid"], departure.maps, strict=True):
        coefficients = placed.spline.coefficients
        if first + coefficients.size > MAX_NUMBERS:
            raise ValueError(
                f"mirror.map: {first + coefficients.size} numbers of all maps: must be at most {MAX_NUMBERS}"
            )
        rows, columns = coefficients.shape
        (column_x, column_y), (row_x, row_y) = placed.matrix
        for name, value in {
            "column_x": column_x, "column_y": column_y, "column": placed.offset[0],
            "row_x": row_x, "row_y": row_y, "row": placed.offset[1],
            "columns": columns - 2, "rows": rows - 2, "stride": columns, "offset": first,
        }.items():  # fmt: skip
            entry[name] = value
        numbers.append(coefficients.astype(real).ravel())
        first += coefficients.size
    return {"map": "bicubic"}, {"MapGrid": grid, "Map": out.dtype}, {}, {"map": out[()]}, np.concatenate(numbers)
