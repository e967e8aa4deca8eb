"""Edges of a scan's lines, which may be narrower or wider than their distance, in line numbers."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray, IntArray


def line_edges(first: IntArray | FloatArray, count: int, line_width: float) -> FloatArray:
    """Edges of `count` lines from each of first [n] on, for a function that gives the light between adjacent edges.

    line_width: in distances of the lines. [n, count + 1] for lines that touch; else [n, 2 count], each line's own two.
    """
    if line_width == 1.0:
        edges: FloatArray = first[:, None] + np.arange(count + 1) - 0.5
        return edges
    lines = first[:, None] + np.arange(count)
    return np.stack([lines - line_width / 2, lines + line_width / 2], -1).reshape(len(first), -1)


def on_lines(between: FloatArray, line_width: float) -> FloatArray:
    """The values of the lines among those between adjacent line_edges."""
    return between if line_width == 1.0 else between[..., ::2]


def uncovered(line_width: float) -> float:
    """Largest distance between successive edges of all lines, in distances of the lines: narrower light may hide."""
    rest = line_width % 1.0
    return max(rest, 1.0 - rest)
