"""What a real screen shows: uneven brightness and dead pixels as a map, drift and jitter as factors of whole frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.maps import read_map
from irtscots_cl.imaging.streams import EVERYWHERE, Stream, place_of
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.counter_random import normal, uniform
from irtscots_cl.scene.screen_response import NO_POLYNOMIAL, ScreenResponse


def brightness_map(response: ScreenResponse, pixels: tuple[int, int]) -> FloatArray:
    """Factor [rows, columns] on the radiance of every pixel of a screen of `pixels` (columns, rows).

    Raises ValueError for a map that cannot be read, or a polynomial that is negative somewhere on the screen.
    """
    columns, rows = pixels
    factor = np.ones((rows, columns))
    if response.brightness_map is not None:
        factor = read_map(response.brightness_map, "screen.response.brightness_map", (rows, columns))
    if response.brightness_polynomial != NO_POLYNOMIAL:
        factor = factor * _polynomial(response, columns, rows)
    factor[_dead(response, columns, rows)] = 0.0
    return factor


def _polynomial(response: ScreenResponse, columns: int, rows: int) -> FloatArray:
    x, y = (2.0 * (np.arange(count) + 0.5) / count - 1.0 for count in (columns, rows))
    by_x, by_y, by_xx, by_xy, by_yy = response.brightness_polynomial
    y = y[:, None]
    factor: FloatArray = 1.0 + by_x * x + by_y * y + by_xx * x**2 + by_xy * x * y + by_yy * y**2
    if factor.min() < 0:
        row, column = np.unravel_index(np.argmin(factor), factor.shape)
        raise ValueError(
            f"screen.response.brightness_polynomial = {list(response.brightness_polynomial)}: is {factor.min():.3g} at "
            f"column {column}, row {row}; must be at least 0 everywhere on the screen"
        )
    return factor


def _dead(response: ScreenResponse, columns: int, rows: int) -> BoolArray:
    """Screen pixels [rows, columns] that stay dark, by the lists and at random."""
    pixels = _random(response.dead_pixel_share, response.seed, Stream.SCREEN_DEAD_PIXEL, rows * columns)
    dead = pixels.reshape(rows, columns)
    for column, row in response.dead_pixels:
        dead[row, column] = True
    dead[:, _random(response.dead_line_share, response.seed, Stream.SCREEN_DEAD_COLUMN, columns)] = True
    dead[_random(response.dead_line_share, response.seed, Stream.SCREEN_DEAD_ROW, rows)] = True
    dead[:, list(response.dead_columns)] = True
    dead[list(response.dead_rows)] = True
    return dead


def _random(share: float, seed: int, stream: Stream, count: int) -> BoolArray:
    """Each of `count` things with the chance `share`."""
    return uniform(seed, stream, EVERYWHERE, count) < share if share else np.zeros(count, bool)


def frame_factors(
    response: ScreenResponse | None, scan: str, line: int, lines: int, exposure: int = 0, frames: int = 1
) -> FloatArray:
    """Brightness [frames] of the averaged frames under one line, relative to an even screen that is full on."""
    if response is None:
        return np.ones(frames)
    drift = 1.0 + response.drift * (line - (lines - 1) / 2) / max(lines - 1, 1)
    factors: FloatArray = np.full(frames, response.level * drift)
    if response.jitter:
        factors *= 1.0 + response.jitter * normal(
            response.seed, Stream.SCREEN_JITTER, place_of(scan, line, exposure), frames
        )
    return np.clip(factors, 0.0, None)  # of a jitter so large that the normal distribution reaches below


def shown(stack: ImageStack, response: ScreenResponse) -> ImageStack:
    """The images under a screen with that drift, jitter and grey level, for a camera without noise; in W as before."""
    return ImageStack(_shown(stack.x, response), _shown(stack.y, response))


def _shown(scan: Scan, response: ScreenResponse) -> Scan:
    count = len(scan.positions_mm)
    factors = np.concatenate([frame_factors(response, scan.axis, line, count) for line in range(count)])
    # in a window wider than the scan, samples past the last line are dark
    return replace(scan, flux_w=scan.flux_w * factors[np.minimum(scan.lines, count - 1)])
