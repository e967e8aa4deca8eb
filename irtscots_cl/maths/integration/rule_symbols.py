"""How zonal integration passes on waves: the symbols of its rules on an even grid without edges.

A wave turns by theta from a node to the next along a chain. With slopes exp(i theta n) a rule's rise from node n to
n + 1 is m(theta) exp(i theta (n + 1/2)) times the step; true heights rise by sin(theta / 2) / (theta / 2) instead of
m. Least squares over the pairs along rows and columns (node_graph.py) then give the height

    z = sum over both of 2 sin(theta / 2) m(theta) rise / sum over both of 4 sin^2(theta / 2),

with the rise that the wave's slopes have over a step: theta times its amplitude.

Sources: L. P. Yaroslavsky, A. Moreno, J. Campos, Opt. Express 13, 2892 (2005), for rules of integration as filters;
W. H. Southwell, J. Opt. Soc. Am. 70, 998 (1980), for trapezoids and least squares; C. de Boor, A Practical Guide to
Splines (1978), for the cubic spline's second derivatives on an even grid.
"""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray

ZONAL = ("southwell", "cubic", "spline")
_NO_WAVE = 1e-9  # of the largest sum of squares: such a wave differs from node to node by nothing


def rise_symbol(method: str, turn: FloatArray) -> FloatArray:
    """m(theta) of a zonal rule at turns theta [...] rad. Raises ValueError for a method without one."""
    if method not in ZONAL:
        raise ValueError(f"integration method {method!r} has no transfer function; must be one of {', '.join(ZONAL)}")
    half = np.asarray(turn) / 2
    if method == "southwell":
        symbol = np.cos(half)
    elif method == "cubic":  # weights -1, 13, 13, -1 over 24
        symbol = (13 * np.cos(half) - np.cos(3 * half)) / 12
    else:
        symbol = np.cos(half) * (1 + (1 - np.cos(2 * half)) / (2 * (2 + np.cos(2 * half))))
    return np.asarray(symbol, np.float64)


def height_symbol(method: str, turns: FloatArray, rises: FloatArray | None = None) -> FloatArray:
    """Height amplitude [...] of waves by their turns [..., 2] rad along columns and rows.

    rises: [..., 2], the amplitudes of the rises that the slopes have over a step along each; default: the turns, those
    of a true wave of height 1. NaN where the wave is the same at all nodes, whose slopes look like a tilt.
    """
    turns = np.asarray(turns, np.float64)
    rises = turns if rises is None else rises
    sine = 2 * np.sin(turns / 2)
    below = np.sum(sine**2, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        height = np.sum(sine * rise_symbol(method, turns) * rises, axis=-1) / below
    return np.where(below > 8 * _NO_WAVE, height, np.nan)


def noise_symbol(method: str, turns: FloatArray, rise_noise: FloatArray) -> FloatArray:
    """Variance [...] of the height's Fourier component over that of white slope noise of 1 at every node.

    turns: [..., 2] as height_symbol's. rise_noise: [2], standard deviation of slope x step along columns and rows. NaN
    where height_symbol is.
    """
    sine = 2 * np.sin(np.asarray(turns) / 2)
    below = np.sum(sine**2, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        variance = np.sum((sine * rise_symbol(method, turns) * rise_noise) ** 2, axis=-1) / below**2
    return np.where(below > 8 * _NO_WAVE, variance, np.nan)
