"""The Cramer-Rao bound of a place by any pattern: no frames of a pixel tell more.

A frame of the pattern f (0 to 1 on the screen) brings a pixel S = E int f l electrons, l its light's density along an
axis and E its electrons under a white screen, and tells the place with the information S'^2 / (read + gain S), S' the
change of S by place. The pattern that makes this greatest is white where -l' / l is above a threshold, and black
elsewhere: it is found among those. It is tuned to the place of this one pixel, so that real sets stay above the bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.pattern_design.camera import DesignCamera
from irtscots_cl.measurement.pattern_design.pixels import SeenPixels

CELLS = 160  # across a pixel's light, finest at its ends


@dataclass(frozen=True)
class PlaceBounds:
    """[2, n] in mm along x and y, of one frame exposed as for a white screen. of_frames: the best frame. of_light: at
    the same exposure in all, which longer frames of fewer lit places may share, `longest` at most each."""

    of_frames: FloatArray
    of_light: FloatArray


def place_bounds(seen: SeenPixels, camera: DesignCamera, longest: float) -> PlaceBounds:
    """The bounds of all pixels. longest: the longest exposure of a frame, over that for a white screen."""
    both = [_of_axis(seen, camera, axis, max(longest, 1.0)) for axis in range(2)]
    return PlaceBounds(np.stack([one[0] for one in both]), np.stack([one[1] for one in both]))


def _of_axis(seen: SeenPixels, camera: DesignCamera, axis: int, longest: float) -> tuple[FloatArray, FloatArray]:
    share, change = _cells(seen, axis)
    electrons = camera.electrons * seen.bright[:, None]
    best = np.zeros((2, len(share)))
    for sign in (1.0, -1.0):
        with np.errstate(divide="ignore", invalid="ignore"):
            steepness = np.where(share > 0, sign * change / share, -np.inf)
        order = np.argsort(-steepness, axis=1)
        light, slope = (np.cumsum(np.take_along_axis(part, order, 1), axis=1) for part in (share, sign * change))
        light, slope = electrons * light, electrons * slope
        with np.errstate(divide="ignore", invalid="ignore"):
            times = np.clip(np.nan_to_num(camera.electrons / light, nan=1.0, posinf=longest), 1.0, longest)
            for k, longer in enumerate((np.ones_like(times), times)):
                found = slope**2 / (camera.noise.read / longer + camera.noise.gain * light)
                best[k] = np.maximum(best[k], np.nanmax(np.where(light > 0, found, 0.0), axis=1))
    with np.errstate(divide="ignore"):
        errors: FloatArray = 1 / np.sqrt(best)
    return errors[0], errors[1]


def _cells(seen: SeenPixels, axis: int) -> tuple[FloatArray, FloatArray]:
    """Shares [n, CELLS] of a pixel's light in cells of the screen, and how they grow [1/mm] as the light moves up."""
    middle, half = seen.light.extent("uv"[axis])
    edges = middle[:, None] - half[:, None] * np.cos(np.pi * np.arange(CELLS + 1) / CELLS)
    share = np.maximum(seen.light.light("uv"[axis], edges), 0.0)
    share = share / share.sum(1, keepdims=True)
    width, centre = np.diff(edges, axis=1), (edges[:, :-1] + edges[:, 1:]) / 2
    density = share / width
    inner = edges[:, 1:-1]
    along = (inner - centre[:, :-1]) / np.diff(centre, axis=1)
    at_edges = np.zeros_like(edges)
    at_edges[:, 1:-1] = density[:, :-1] + along * np.diff(density, axis=1)
    change: FloatArray = at_edges[:, :-1] - at_edges[:, 1:]
    return share, change
