"""A cubic B-spline through heights on an even grid: value, slopes and second derivatives in float64.

The spline goes through every height; its second derivatives are continuous. It is mirrored at the grid's edge, so that
its slope across the edge is 0 there: beyond the edge it goes on at the edge's height without a kink.

kernels/mirror/map_bicubic.cl is its twin for devices.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.maths.arrays import FloatArray

CHUNK = 2**13  # points evaluated at a time: their data stays in the cache
MIN_NODES = 2  # along each axis
KNOT_WEIGHTS = (1 / 6, 2 / 3, 1 / 6)  # of three neighbouring coefficients in a height


@dataclass(frozen=True)
class BicubicSpline:
    """coefficients: [rows + 2, columns + 2], those of the nodes with a border of one on every side."""

    coefficients: FloatArray = field(repr=False)

    @classmethod
    def through(cls, heights: FloatArray) -> BicubicSpline:
        """The spline through heights [rows, columns], at least MIN_NODES along each axis."""
        from scipy.ndimage import spline_filter  # imported late: few surfaces have a map

        return cls(np.pad(spline_filter(heights, order=3, mode="mirror"), 1, mode="reflect"))

    @property
    def shape(self) -> tuple[int, int]:
        """Nodes: (rows, columns)."""
        rows, columns = self.coefficients.shape
        return rows - 2, columns - 2

    def at(self, column: FloatArray, row: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height and its derivatives by column and by row, at places counted from the first node.

        column, row: of one shape. NaN where a place is NaN.
        """
        height, by_column, by_row = self._evaluated(column, row, ((0, 0), (1, 0), (0, 1)))
        return height, by_column, by_row

    def bend(self, column: FloatArray, row: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Second derivatives: by column twice, by column and row, by row twice."""
        twice, mixed, row_twice = self._evaluated(column, row, ((2, 0), (1, 1), (0, 2)))
        return twice, mixed, row_twice

    def nodes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height and derivatives by column and by row at all nodes, each [rows, columns]."""
        c = self.coefficients
        outer, inner, _ = KNOT_WEIGHTS
        along = outer * (c[:, :-2] + c[:, 2:]) + inner * c[:, 1:-1]
        across = outer * (c[:-2] + c[2:]) + inner * c[1:-1]
        height = outer * (along[:-2] + along[2:]) + inner * along[1:-1]
        return height, (across[:, 2:] - across[:, :-2]) / 2, (along[2:] - along[:-2]) / 2

    def _evaluated(self, column: FloatArray, row: FloatArray, orders: tuple[tuple[int, int], ...]) -> FloatArray:
        """Derivatives [orders, ...] of order (by column, by row)."""
        column, row = np.broadcast_arrays(np.asarray(column, float), np.asarray(row, float))
        shape, column, row = column.shape, column.ravel(), row.ravel()
        found = np.empty((len(orders), column.size))
        for first in range(0, column.size, CHUNK):
            part = slice(first, first + CHUNK)
            found[:, part] = self._part(column[part], row[part], orders)
        return found.reshape(len(orders), *shape)

    def _part(self, column: FloatArray, row: FloatArray, orders: tuple[tuple[int, int], ...]) -> FloatArray:
        rows, columns = self.shape
        (left, u, within_u), (low, v, within_v) = _cell(column, columns), _cell(row, rows)
        flat, stride = self.coefficients.ravel(), columns + 2
        by_u = {order: _weights(u, order) for order in {order[0] for order in orders}}
        by_v = {order: _weights(v, order) for order in {order[1] for order in orders}}
        found = np.zeros((len(orders), column.size))
        start = low * stride + left
        for j in range(4):
            nodes = [flat.take(start + (j * stride + k)) for k in range(4)]
            sums = {order: sum(w * a for w, a in zip(of_u, nodes, strict=True)) for order, of_u in by_u.items()}
            for k, (order_u, order_v) in enumerate(orders):
                found[k] += by_v[order_v][j] * sums[order_u]
        for k, (order_u, order_v) in enumerate(orders):
            if order_u:
                found[k] *= within_u
            if order_v:
                found[k] *= within_v
        found[:, np.isnan(column) | np.isnan(row)] = np.nan
        return found


def _cell(place: FloatArray, count: int) -> tuple[np.ndarray, FloatArray, np.ndarray]:
    """First coefficient of the cell, place in it from 0 to 1, and whether it is in the grid; if not, the nearest's."""
    inside = np.fmin(np.fmax(place, 0.0), count - 1.0)  # of NaN: 0
    cell = np.minimum(inside.astype(np.intp), count - 2)
    return cell, inside - cell, inside == place


def _weights(t: FloatArray, order: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Weights of four neighbouring coefficients in the spline's derivative of an order, t from 0 to 1 in the cell."""
    s = 1.0 - t
    if order == 0:
        first, last = s * s * s / 6, t * t * t / 6
        return first, 2 / 3 - t * t * (1 + s) / 2, 2 / 3 - s * s * (1 + t) / 2, last
    if order == 1:
        return -s * s / 2, t * (3 * t - 4) / 2, s * (4 - 3 * s) / 2, t * t / 2
    return s, 3 * t - 2, 3 * s - 2, t
