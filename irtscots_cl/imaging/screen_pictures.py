"""Pictures for a real screen: the pixels of patterns as the screen shows them.

A picture's first row is the screen's +y edge. Its first column is the +x edge: the screen's z points away from the
mirror, so that x grows to the left for who looks at the screen with y up.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.imaging.dots import dot_values
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.gray_code import GraySet
from irtscots_cl.imaging.line_pictures import line_values
from irtscots_cl.imaging.shown_frames import DARK, DOTS, GRAY, LINE, PICTURE, WHITE, ShownFrame
from irtscots_cl.scene.model import Scene

BITS = (8, 16)
_LEAST_PIXELS = 6  # of a period: below, the steps of the pixels are no sinusoid
_MOST_PRECISE = 3.41  # 2 pi over the maximum of J1: periods in half-widths of the aperture's image where p J(p) is most
_FIRST = 0.9  # periods: one place only has its phase
_RATIO = 6.0  # of the periods of neighbouring series: the phase of one tells the order of the next


def values_of(frame: ShownFrame, scene: Scene) -> NDArray[Any]:
    """What the screen's columns (of a frame along x) or rows show, from 0 to 1: [pixels along the axis]."""
    pixels = scene.screen.pixels["xy".index(frame.axis)]
    if frame.shows == LINE:
        return line_values(frame.first_px[0], frame.width_px, pixels)
    if frame.shows == GRAY:
        code = GraySet(frame.axis, frame.cells)
        shown = code.plane(frame.bit, code.cell((np.arange(pixels) + 0.5) / pixels)).astype(float)
        return 1 - shown if frame.inverted else shown
    fringes = FringeSet(frame.axis, (frame.periods,), ((0.0, 2.0, 4.0),))
    place = fringes.pixel_fractions(pixels)
    values: NDArray[Any] = 0.5 + 0.5 * np.cos(2 * np.pi * frame.periods * place - np.radians(frame.step_deg))
    return values


def upright_values(frame: ShownFrame, scene: Scene) -> NDArray[Any]:
    """What the screen's pixels show, from 0 to 1: [rows, columns], the first ones at its -y and -x edge.

    Raises ValueError for a frame that shows a picture of the user's, which its file alone tells.
    """
    columns, rows = scene.screen.pixels
    if frame.shows in (DARK, WHITE):
        return np.full((rows, columns), float(frame.shows == WHITE))
    if frame.shows == DOTS:
        return dot_values(frame, scene.screen.pixels)
    if frame.shows == PICTURE:
        raise ValueError(f"{frame.text}: only its file tells what it shows")
    line = values_of(frame, scene)
    return np.broadcast_to(line[None, :] if frame.axis == "x" else line[:, None], (rows, columns))


def picture(frame: ShownFrame, scene: Scene, bits: int = 8) -> NDArray[Any]:
    """The picture [rows, columns] of a frame, first row and first column at the screen's +y and +x edge.

    Raises ValueError for a number of bits that is not of BITS.
    """
    return as_picture(upright_values(frame, scene), bits)


def as_picture(values: NDArray[Any], bits: int = 8) -> NDArray[Any]:
    """Upright values [rows, columns] from 0 to 1 as the pixels of a picture. Raises ValueError as `picture` does."""
    if bits not in BITS:
        raise ValueError(f"bits = {bits}: must be one of {', '.join(map(str, BITS))}")
    whole = np.rint(values * (2**bits - 1)).astype(np.uint8 if bits == 8 else np.uint16)
    return np.ascontiguousarray(whole[::-1, ::-1])  # +x and +y come first


def write_picture(path: Path, values: NDArray[Any]) -> None:
    """Write a grey PNG of 8 or 16 bits, pixel for pixel."""
    from PIL import Image

    Image.fromarray(values).save(path, format="PNG")


def usual_periods(pixels: int, pitch_mm: float, half_width_mm: float, box_mm: float) -> tuple[float, ...]:
    """Numbers of periods that suit a screen of so many pixels along an axis.

    The lowest is below 1, so that it tells the place; the highest is where the number of periods times the modulation,
    and so the precision, is greatest, for a pixel's light of this half-width of the aperture's image and this width of
    the pixel's own.
    """
    width_mm = pixels * pitch_mm
    finest = width_mm / (_MOST_PRECISE * np.hypot(half_width_mm, box_mm / 2))
    highest = max(float(min(finest, pixels / _LEAST_PIXELS)), _FIRST)
    if highest < 1.5 * _FIRST:
        return (_FIRST,)
    count = int(np.ceil(np.log(highest / _FIRST) / np.log(_RATIO)))
    return tuple(float(f"{_FIRST * (highest / _FIRST) ** (k / count):.3g}") for k in range(count + 1))
