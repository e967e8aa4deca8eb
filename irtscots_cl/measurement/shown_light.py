"""What a pixel's light makes of patterns of lines: the design's light, moved to a place, on what the screen shows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.scene.instrument import Screen
from irtscots_cl.system import interruption

AT_ONCE = 2**20  # values of the light on the screen's lines


def first_edge_mm(screen: Screen, axis: str) -> float:
    """Where the first column (x) or row begins, in the screen's own x or y."""
    k = "xy".index(axis)
    return -screen.pixels[k] * screen.pitch_xy_mm[k] / 2 + screen.centre_offset_mm[k]


def light_on_lines(
    light: PixelLight, screen: Screen, axis: str, place_mm: FloatArray, at_once: int = AT_ONCE
) -> Iterator[tuple[FloatArray, IntArray]]:
    """Shares [n, lines] of each pixel's light on the screen's columns (x) or rows, and their numbers; in parts.

    place_mm: [n] where the light's centroids are along the axis. Zero where the light is not known or off the screen.
    at_once: values of a part.
    """
    k = "xy".index(axis)
    output, pitch, count = "uv"[k], screen.pitch_xy_mm[k], screen.pixels[k]
    own = light.means(output)[0]
    middle, half = light.extent(output)
    known = light.valid() & np.isfinite(own) & np.isfinite(place_mm) & np.isfinite(middle) & np.isfinite(half)
    moved = np.where(known, place_mm - own, 0.0)
    start_mm = first_edge_mm(screen, axis)
    first = np.floor((np.where(known, middle + moved - half, 0.0) - start_mm) / pitch) - 1
    most = math.ceil(2 * half[known].max(initial=0.0) / pitch) + 3
    step = max(1, at_once // max(len(own), 1))
    for begin in range(0, most, step):
        interruption.check()
        lines = first[:, None] + begin + np.arange(min(step, most - begin) + 1)
        share = light.light(output, start_mm + pitch * lines - moved[:, None])
        number = lines[:, :-1]
        on_screen = (number >= 0) & (number < count)
        yield np.where(on_screen & known[:, None], share, 0.0), np.clip(number, 0, count - 1).astype(np.int64)


def shown_light(
    light: PixelLight, screen: Screen, axis: str, patterns: NDArray[Any], place_mm: FloatArray
) -> NDArray[Any]:
    """Mean of patterns [kinds, lines] of the screen's columns (x) or rows over each pixel's light: [kinds, n].

    place_mm: [n] where the light's centroids are along the axis. NaN where the light is not known or off the screen.
    """
    sums = np.zeros((len(patterns), len(place_mm)), patterns.dtype)
    whole = np.zeros(len(place_mm))
    for share, number in light_on_lines(light, screen, axis, place_mm):
        whole += share.sum(1)
        for kind, pattern in enumerate(patterns):
            sums[kind] += (share * pattern[number]).sum(1)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean: NDArray[Any] = np.where(whole > 0, sums / whole, np.nan)
        return mean
