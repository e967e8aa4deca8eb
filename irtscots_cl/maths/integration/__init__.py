"""Integration: two slope maps to one height map, on nodes at their true positions and any mask.

The nodes form a logical grid [rows, columns] that need not be regular: neighbours along a row may differ in y, and
neighbours along a column in x. An island is a set of nodes connected along rows and columns. Islands
are joined where the gap between them is small against the correlation length of the heights (islands.py). The piston of
a group of joined islands is free, and is set so that its mean height is 0. Methods:

- southwell: zonal; trapezoids between neighbours. Exact for quadratic surfaces on any nodes.
- cubic: zonal; between two neighbours, positions and slopes run as cubics through four nodes of the row or column.
- spline: zonal; as cubic, but with one cubic spline through all nodes of an unbroken row or column. Both are exact for
  quadratic surfaces on any nodes and, where rows and columns are straight and have four nodes, for quartic ones.
- modal: gradients of Zernike polynomials are fitted to the slopes of each island; finer structure is lost.

docs/accuracy.md has the errors of each.
"""

from irtscots_cl.maths.integration.islands import Islands, separate_islands
from irtscots_cl.maths.integration.methods import METHODS, Integration, integrate, integrate_slopes
from irtscots_cl.maths.integration.misfit import Misfit, integration_misfit, white_noise
from irtscots_cl.maths.integration.noise_gain import NoiseGain, noise_gain

__all__ = [
    "METHODS",
    "Integration",
    "Islands",
    "Misfit",
    "NoiseGain",
    "integrate",
    "integrate_slopes",
    "integration_misfit",
    "noise_gain",
    "separate_islands",
    "white_noise",
]
