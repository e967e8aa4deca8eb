"""What goes wrong with a laboratory's images: one function a fault, and what a measurement must make of it.

Every function takes Images (noisy_images.py) with noise, and a random generator for the faults that need chance; it
returns other Images. FAULTS says of each what must come out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from noisy_images import Images, small
from scenes import with_part

from irtscots_cl.scene.model import Scene

FRAME = 10  # of 21: the middle one, which lights most pixels


# --- noise and background -----------------------------------------------------------------------------------


def nothing(images: Images, random) -> Images:
    return images


def more_noise(share: float):
    return lambda images, random: images.each(lambda a: a + random.normal(0, share * images.peak, a.shape))


def pedestal(share: float):
    return lambda images, random: images.each(lambda a: a + share * images.peak)


def dark_level(images: Images, random) -> Images:
    """A dark image of 6 % that was not subtracted: each pixel has its own level."""
    level = random.normal(0.06, 0.01, images.x.shape[1:]) * images.peak
    return images.each(lambda a: a + level)


def hot_pixels(images: Images, random) -> Images:
    hot = random.random(images.x.shape[1:]) < 0.01
    return images.each(lambda a: a + hot * 0.02 * images.peak)


def flickering_pixels(images: Images, random) -> Images:
    """One pixel in 100 with 20 times the noise of the others."""
    hot = random.random(images.x.shape[1:]) < 0.01
    return images.each(lambda a: a + hot * random.normal(0, 0.04 * images.peak, a.shape))


# --- frames -------------------------------------------------------------------------------------------------


def _frames(images: Images, change: Callable[[np.ndarray], None]) -> Images:
    """The x scan changed in place by `change`."""
    x = images.x.copy()
    change(x)
    return replace(images, x=x)


def black_frame(images: Images, random) -> Images:
    def change(x):
        x[FRAME] = 0.0

    return _frames(images, change)


def two_black_frames(images: Images, random) -> Images:
    def change(x):
        x[[FRAME - 3, FRAME + 2]] = 0.0

    return _frames(images, change)


def repeated_frame(images: Images, random) -> Images:
    def change(x):
        x[FRAME] = x[FRAME - 1]

    return _frames(images, change)


def exchanged_frames(images: Images, random) -> Images:
    def change(x):
        x[[FRAME, FRAME + 1]] = x[[FRAME + 1, FRAME]]

    return _frames(images, change)


def half_exposed_frame(images: Images, random) -> Images:
    def change(x):
        x[FRAME] *= 0.5

    return _frames(images, change)


def frame_offset(images: Images, random) -> Images:
    """The black level of one frame is another."""

    def change(x):
        x[FRAME] += 0.05 * images.peak

    return _frames(images, change)


def light_on(images: Images, random) -> Images:
    """The room's light was on in one frame."""

    def change(x):
        x[FRAME] += images.peak * np.linspace(0.3, 0.7, x.shape[2])

    return _frames(images, change)


def one_line_late(images: Images, random) -> Images:
    return _frames(images, lambda x: x.__setitem__(slice(None), np.roll(x, 1, axis=0)))


def drift(images: Images, random) -> Images:
    return replace(images, x=images.x * np.linspace(0.975, 1.025, len(images.x))[:, None, None])


def jitter(images: Images, random) -> Images:
    return images.each(lambda a: a * random.normal(1, 0.03, (len(a), 1, 1)))


def doubled_exposure(images: Images, random) -> Images:
    """The y scan was exposed twice as long as the x scan."""
    return replace(images, y=2 * images.y)


# --- camera -------------------------------------------------------------------------------------------------


def overexposed(images: Images, random) -> Images:
    """Twice the full well, 12 bits in the upper bits of 16."""
    return images.each(lambda a: np.clip(np.round(a / images.peak * 2 * 4095), 0, 4095) * 16)


def few_saturated(images: Images, random) -> Images:
    """One pixel in 100 has its peaks cut off; a full pixel changes none of its neighbours."""
    peaks = np.maximum(images.x.max(0), images.y.max(0))
    ceiling = np.quantile(peaks[peaks > 0.5 * images.peak], 0.99)
    return images.each(lambda a: np.minimum(np.round(a / ceiling * 4095), 4095))


def eight_bits(images: Images, random) -> Images:
    return images.each(lambda a: np.clip(np.round(a / images.peak * 230), 0, 255))


def gamma(images: Images, random) -> Images:
    return images.each(lambda a: np.clip(a / images.peak, 0, None) ** (1 / 2.2))


# --- pixels -------------------------------------------------------------------------------------------------


def _grid(images: Images) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = images.x.shape[1:]
    row, column = np.mgrid[:rows, :columns]
    return row - rows // 2, column - columns // 2


def cross(images: Images, random) -> Images:
    row, column = _grid(images)
    return images.each(lambda a: np.where((row == 0) | (column == 0), 0.0, a))


def ring(images: Images, random) -> Images:
    row, column = _grid(images)
    return images.each(lambda a: np.where(np.abs(np.hypot(row, column) - len(row) / 4) < 1, 0.0, a))


def dead_columns(images: Images, random) -> Images:
    _, column = _grid(images)
    return images.each(lambda a: np.where((column == -7) | (column == 5), 0.0, a))


def dead_pixels(share: float):
    def fault(images: Images, random) -> Images:
        dead = random.random(images.x.shape[1:]) < share
        return images.each(lambda a: np.where(dead, 0.0, a))

    return fault


def masked_pixel(images: Images, random) -> Images:
    row, column = _grid(images)
    return images.each(lambda a: np.where((row == 0) & (column == -7), np.nan, a))


def masked_samples(images: Images, random) -> Images:
    """Single samples are missing, as where a cosmic ray was found: 1 in 100 of all."""
    return images.each(lambda a: np.where(random.random(a.shape) < 0.01, np.nan, a))


# --- orientation, place, lines ------------------------------------------------------------------------------


def turned(change: Callable[[np.ndarray], np.ndarray]):
    """change: of the last two axes of images."""
    return lambda images, random: images.each(lambda a: np.ascontiguousarray(change(a)))


def reversed_scan(axes: str):
    return lambda images, random: replace(images, **{axis: getattr(images, axis)[::-1] for axis in axes})


def exchanged_scans(images: Images, random) -> Images:
    return replace(images, x=images.y, y=images.x)


def shifted(rows: int, columns: int):
    return lambda images, random: images.each(lambda a: np.roll(a, (rows, columns), (1, 2)))


def lines_from_zero(images: Images, random) -> Images:
    return replace(images, lines_x=images.lines_x - images.lines_x[0], lines_y=images.lines_y - images.lines_y[0])


def pitch(factor: float):
    return lambda images, random: replace(images, lines_x=images.lines_x * factor, lines_y=images.lines_y * factor)


# --- table --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Fault:
    """right: the height must be right within its stated error, of at least the share `used` of the mirror's pixels.
    named: checks, at least one of which must not be ok. refused: a check that must be an error, or what the message of
    a refusal must hold. lines: of each scan."""

    name: str
    make: Callable[[Images, np.random.Generator], Images]
    right: bool = False
    named: tuple[str, ...] = ()
    refused: str = ""
    used: float = 0.97
    lines: int = 21

    @property
    def scene(self) -> Scene:
        return with_part(small(), "screen", pixels=(self.lines, self.lines))


FAULTS = [
    Fault("none", nothing, right=True),
    Fault("noise of 1 %", more_noise(0.01), right=True),
    Fault("noise of 0.5 %, 201 lines", more_noise(0.005), right=True, lines=201),
    Fault("pedestal of 1 %", pedestal(0.01), right=True),
    Fault("pedestal of 5 %", pedestal(0.05), right=True),
    Fault("pedestal of 20 %", pedestal(0.2), right=True),
    Fault("negative pedestal", pedestal(-0.05), right=True),
    Fault("dark level left in", dark_level, right=True),
    Fault("hot pixels", hot_pixels, right=True),
    Fault("flickering pixels", flickering_pixels, right=True),
    Fault("black frame", black_frame, right=True, named=("frames x",)),
    Fault("two black frames", two_black_frames, right=True, named=("frames x",)),
    Fault("repeated frame", repeated_frame, right=True, named=("frames x",)),
    Fault("exchanged frames", exchanged_frames, right=True, named=("frames x",)),
    Fault("half exposed frame", half_exposed_frame, right=True, named=("gains x",)),
    Fault("frame offset", frame_offset, right=True),
    Fault("light on in a frame", light_on, right=True, named=("frames x",)),
    Fault("scan one line late", one_line_late, named=("place x",)),
    Fault("drift of 5 %", drift, right=True),
    Fault("jitter of 3 %", jitter, right=True, named=("gains x", "gains y")),
    Fault("exposure doubled between the scans", doubled_exposure, right=True),
    # flanks alone are left of most curves: the design's profile, which is not quite the light's, moves them
    Fault("overexposed twice", overexposed, named=("saturation",)),
    Fault("1 % of the pixels saturated", few_saturated, right=True, named=("saturation",)),
    Fault("8 bits", eight_bits, right=True),
    Fault("gamma 2.2", gamma, named=("profile x", "profile y")),
    Fault("dark cross", cross, right=True, used=0.9),
    Fault("dark ring", ring, right=True, used=0.85),
    Fault("two dead columns", dead_columns, right=True, used=0.9),
    Fault("10 % of the pixels dead", dead_pixels(0.1), right=True, used=0.87),
    Fault("30 % of the pixels dead", dead_pixels(0.3), right=True, named=("pixels",), used=0.65),
    Fault("50 % of the pixels dead", dead_pixels(0.5), right=True, named=("pixels",), used=0.4),
    Fault("a masked pixel", masked_pixel, right=True),
    Fault("1 % of the samples masked", masked_samples, right=True),
    Fault("rows upside down", turned(lambda a: a[:, ::-1]), refused="orientation"),
    Fault("columns mirrored", turned(lambda a: a[..., ::-1]), refused="orientation"),
    Fault("half a turn", turned(lambda a: a[:, ::-1, ::-1]), refused="orientation"),
    Fault("rows and columns exchanged", turned(lambda a: a.transpose(0, 2, 1)), refused="orientation"),
    Fault("a quarter turn", turned(lambda a: np.rot90(a, 1, (1, 2))), refused="orientation"),
    Fault("a quarter turn back", turned(lambda a: np.rot90(a, -1, (1, 2))), refused="orientation"),
    Fault("other diagonal", turned(lambda a: a[:, ::-1, ::-1].transpose(0, 2, 1)), refused="orientation"),
    Fault("x scan reversed", reversed_scan("x"), refused="orientation"),
    Fault("y scan reversed", reversed_scan("y"), refused="orientation"),
    Fault("both scans reversed", reversed_scan("xy"), refused="orientation"),
    Fault("scans exchanged", exchanged_scans, refused="orientation"),
    Fault("shifted by 5 rows", shifted(5, 0), refused="outline"),
    Fault("shifted by 3 rows and 4 columns", shifted(3, -4), refused="outline"),
    Fault("lines from zero", lines_from_zero, refused="/lines/x_mm: 21 lines from 0 to 4 mm"),
    Fault("pitch wrong by 1 %", pitch(1.01), named=("lines x",)),
    Fault("lines in metres", pitch(1e-3), refused="the positions seem to be in metres"),
]
