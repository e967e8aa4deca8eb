"""A mirror's height maps as the kernels' structures and tables."""

from __future__ import annotations

import os

import numpy as np

from irtscots_cl.opencl.structs import map_grid_dtype
from irtscots_cl.optics.height_map import MapDeparture, PlacedMap

MAX_NUMBERS = 2**31  # of all tables: their places are 32-bit integers
REPEATED_NODES = int(os.environ.get("REP", 2**24))


def pack_maps(departure: MapDeparture, real, first: int):
    """For kernels/mirror/map_bicubic.cl: choices, structures, constants, values, and numbers [n] of the tables, where
    they begin at `first`.

    Raises ValueError for more than the kernels can count.
    """
    grid = map_grid_dtype(real)
    out = np.zeros((), np.dtype([("grid", grid, len(departure.maps))], align=True))
    numbers = []
    for entry, placed in zip(out["grid"], departure.maps, strict=True):
        numbers.append(_pack(entry, placed, first).astype(real))
        first += len(numbers[-1])
    return {"map": "bicubic"}, {"MapGrid": grid, "Map": out.dtype}, {}, {"map": out[()]}, np.concatenate(numbers)


def _pack(out: np.ndarray, placed: PlacedMap, first: int) -> np.ndarray:
    coefficients = placed.spline.coefficients
    rows, columns = coefficients.shape
    (column_x, column_y), (row_x, row_y) = placed.matrix
    by_column, by_row = (column_x, column_y, placed.offset[0]), (row_x, row_y, placed.offset[1])
    if repeated := coefficients.size <= REPEATED_NODES:
        windows = np.lib.stride_tricks.sliding_window_view(coefficients, 4, axis=0)  # [rows - 3, columns, 4]
        numbers, u, v, nodes, steps = windows.ravel(), by_row, by_column, (rows - 2, columns - 2), (4 * columns, 4)
    else:
        numbers, u, v, nodes, steps = coefficients.ravel(), by_column, by_row, (columns - 2, rows - 2), (1, columns)
    if first + len(numbers) > MAX_NUMBERS:
        raise ValueError(f"mirror.map: {first} numbers of all maps on the mirror: must be at most {MAX_NUMBERS}")
    values = [*u, *v, *nodes, *steps, first]
    for name, value in zip(("u_x", "u_y", "u", "v_x", "v_y", "v", "u_nodes", "v_nodes", "u_step", "v_step", "offset"),
                           values, strict=True):
        out[name] = value
    return numbers
