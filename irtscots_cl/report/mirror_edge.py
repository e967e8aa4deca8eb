"""The edge of a mirror that is no whole disk, drawn on its maps."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from matplotlib.axes import Axes

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.optics.outline_curves import edge_curves
from irtscots_cl.optics.surface import Surface
from irtscots_cl.report.fiducial import MapFrame
from irtscots_cl.scene.mirror import Mirror

POINTS = 1024  # of a curve


def draw_edge(axes: Axes, result: Reconstruction, frame: MapFrame) -> None:
    """Draw the edge of the design's mirror on a map; nothing for a disk, whose edge needs no drawing."""
    mirror = result.nominal.mirror
    if mirror.outline is None:
        return
    limits = axes.axis()
    for curve in _curves(mirror):
        if "mm" in frame.x_label:
            x, y = curve.T
        else:
            y, x = result.setup.chief_rays.pixel(*curve.T)
        axes.plot(np.append(x, x[0]), np.append(y, y[0]), color="black", linewidth=0.6, gid="edge")
    axes.axis(limits)


@lru_cache(maxsize=4)
def _curves(mirror: Mirror) -> tuple[FloatArray, ...]:
    return tuple(curve for curve, _ in edge_curves(Surface.of(mirror), POINTS))
