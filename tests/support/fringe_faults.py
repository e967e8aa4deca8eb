"""What goes wrong with a laboratory's images of fringes: one function a fault, and what a measurement must make of it.

Every function takes the frames [N, rows, columns] of a Lab (fringe_folders.py) in counts with noise, and a random
generator; it returns other frames. The order is dark, white, x fringes of 0.9 periods in four steps, x of 2.46, y of
0.9, y of 2.46. FAULTS says of each what must come out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from fringe_folders import DARK_COUNTS, READ

TOP = 4095
FIRST = 2  # frame of fringes
Frames = np.ndarray
Change = Callable[[Frames, np.random.Generator], Frames]


def nothing(frames: Frames, random) -> Frames:
    return frames


def swapped(first: int, second: int) -> Change:
    def change(frames, random):
        order = np.arange(len(frames))
        order[[first, second]] = second, first
        return frames[order]

    return change


def replaced(frame: int, by: int) -> Change:
    """The frame shows what another one does, with noise of its own."""

    def change(frames, random):
        new = frames.copy()
        new[frame] = frames[by] + random.normal(0, 3.0, frames[by].shape)
        return new

    return change


def copied(frame: int, of: int) -> Change:
    def change(frames, random):
        new = frames.copy()
        new[frame] = frames[of]
        return new

    return change


def late(frames: Frames, random) -> Frames:
    """From the sixth frame of fringes on every image is the one before it; the last was not recorded."""
    new = frames.copy()
    new[FIRST + 6 :] = frames[FIRST + 5 : -1] + random.normal(0, 3.0, frames[FIRST + 5 : -1].shape)
    return new


def scaled(numbers, factor) -> Change:
    """Light of some frames times a factor: exposure or screen."""

    def change(frames, random):
        new = frames.copy()
        new[numbers] = DARK_COUNTS + (frames[numbers] - DARK_COUNTS) * np.reshape(factor, (-1, 1, 1))
        return new

    return change


def drift(share: float) -> Change:
    def change(frames, random):
        return scaled(slice(None), np.linspace(1, 1 + share, len(frames)))(frames, random)

    return change


def flicker(share: float) -> Change:
    def change(frames, random):
        return scaled(slice(None), random.normal(1, share, len(frames)))(frames, random)

    return change


def lamp(first: int, counts: float, even: bool = False) -> Change:
    """Light of the room from a frame on, stronger on one side."""

    def change(frames, random):
        new = frames.astype(float)
        veil = np.ones(frames.shape[2]) if even else np.linspace(0.5, 1.5, frames.shape[2])
        new[first:] += counts * veil
        return new

    return change


def flash(frame: int, counts: float) -> Change:
    def change(frames, random):
        new = frames.astype(float)
        new[frame] += counts
        return new

    return change


def moved(first: int, rows: float, columns: float) -> Change:
    """The camera moves before a frame, and stays there."""
    from scipy.ndimage import shift

    def change(frames, random):
        new = frames.astype(float)
        for k in range(first, len(frames)):
            new[k] = shift(new[k], (rows, columns), order=1, mode="nearest")
        return new

    return change


def shaken(frame: int, rows: float, columns: float) -> Change:
    from scipy.ndimage import shift

    def change(frames, random):
        new = frames.astype(float)
        new[frame] = shift(new[frame], (rows, columns), order=1, mode="nearest")
        return new

    return change


def filled(frame: int, counts: float) -> Change:
    def change(frames, random):
        new = frames.astype(float)
        new[frame] = counts + random.normal(0, READ, new[frame].shape)
        return new

    return change


def noise_series(first: int, count: int = 4) -> Change:
    """A series without fringes: the screen showed an even grey."""

    def change(frames, random):
        new = frames.astype(float)
        grey = frames[first : first + count].mean(0)
        new[first : first + count] = grey + random.normal(0, 0.01 * TOP, (count, *grey.shape))
        return new

    return change


def black_series(first: int, count: int = 4) -> Change:
    def change(frames, random):
        new = frames.astype(float)
        new[first : first + count] = DARK_COUNTS + random.normal(0, READ, new[first : first + count].shape)
        return new

    return change


def foreign(frame: int) -> Change:
    """Another picture: a chequerboard on the mirror."""

    def change(frames, random):
        new = frames.astype(float)
        row, column = np.indices(frames.shape[1:])
        board = (row // 6 + column // 6) % 2
        new[frame] = DARK_COUNTS + (frames[1] - DARK_COUNTS) * board
        return new

    return change


def overexposed(factor: float, numbers=slice(None)) -> Change:
    return lambda frames, random: np.minimum(scaled(numbers, factor)(frames.astype(float), random), TOP)


def half_lost(frame: int) -> Change:
    """The lower half of a frame was not transferred."""

    def change(frames, random):
        new = frames.copy()
        new[frame, frames.shape[1] // 2 :] = 0
        return new

    return change


def offset_too_low(frames: Frames, random) -> Frames:
    """The camera's black level is below zero: dark fringes are cut off at 0."""
    return np.maximum(frames.astype(float) - 300, 0)


def gamma_between(first: int, gamma: float) -> Change:
    """The camera's or the screen's curve changes between two series."""

    def change(frames, random):
        new = frames.astype(float)
        light = np.clip((frames[first:] - DARK_COUNTS) / TOP, 0, None)
        new[first:] = DARK_COUNTS + TOP * light**gamma
        return new

    return change


def hot(frames: Frames, random) -> Frames:
    new = frames.astype(float)
    new[:, random.random(frames.shape[1:]) < 0.01] += 300
    return new


def dead(share: float) -> Change:
    def change(frames, random):
        new = frames.copy()
        new[:, random.random(frames.shape[1:]) < share] = 0
        return new

    return change


def hand(frame: int) -> Change:
    """Something in the light's way in one frame."""

    def change(frames, random):
        new = frames.astype(float)
        row, column = np.indices(frames.shape[1:]) / frames.shape[1]
        shadow = np.hypot(row - 0.4, column - 0.5) < 0.15
        new[frame, shadow] = DARK_COUNTS + 0.3 * (new[frame, shadow] - DARK_COUNTS)
        return new

    return change


@dataclass(frozen=True)
class Fault:
    """right: the height must be right within its stated error. named: words that the text of a check, or of the
    refusal, must hold. refused: whether it must be an error; None: either."""

    name: str
    make: Change
    right: bool = False
    named: tuple[str, ...] = ()
    refused: bool | None = None


FAULTS = [
    Fault("none", nothing, right=True),
    Fault("neighbours of a series swapped", swapped(4, 5), named=("image 5", "image 6"), refused=True),
    Fault("opposite steps swapped", swapped(6, 8), named=("image 7", "image 9"), refused=True),
    Fault("frames of two axes swapped", swapped(7, 12), named=("image 8", "image 13"), refused=True),
    Fault("frames of two series swapped", swapped(3, 8), named=("image 4", "image 9"), refused=True),
    Fault("white and a frame of fringes swapped", swapped(1, 9), named=("white image 2",), refused=True),
    Fault("dark and a frame of fringes swapped", swapped(0, 6), named=("dark image 1",), refused=True),
    Fault("dark and white swapped", swapped(0, 1), named=("dark", "white"), refused=True),
    Fault("a copy", copied(9, 8), named=("image 10", "image 9"), refused=True),
    Fault("a copy of another series", copied(9, 13), named=("image 10", "image 14"), refused=True),
    Fault("a frame recorded twice", replaced(9, 8), named=("image 10",), refused=True),
    Fault("a frame of another series", replaced(12, 16), named=("image 13",), refused=True),
    Fault("all one late", late, named=("image",), refused=True),
    Fault("a blank frame", filled(7, DARK_COUNTS), named=("image 8",), refused=True),
    Fault("a grey frame", filled(7, 1500), named=("image 8",), refused=True),
    Fault("a white frame", replaced(7, 1), named=("image 8",), refused=True),
    Fault("a dark frame among fringes", replaced(14, 0), named=("image 15",), refused=True),
    Fault("a saturated frame", filled(7, 2 * TOP), named=("image 8",)),
    Fault("a foreign picture", foreign(11), named=("image 12",), refused=True),
    Fault("half a frame lost", half_lost(10), named=("image 11",)),
    Fault("a series without fringes", noise_series(6), named=("x fringes of 2.46 periods",), refused=True),
    Fault("a black series", black_series(14), named=("y fringes of 2.46 periods",), refused=True),
    Fault("one frame half exposed", scaled([8], 0.5), right=True, named=("image 9",)),
    Fault("one frame of 5 % more exposure", scaled([12], 1.05), right=True, named=("image 13",)),
    Fault("one frame of 1 % more exposure", scaled([12], 1.01), right=True),
    Fault("a drift of 5 %", drift(0.05), right=True),
    Fault("a drift of 20 %", drift(-0.2), right=True, named=("image",)),
    Fault("flicker of 2 %", flicker(0.02), right=True, named=("image",)),
    Fault("flicker of 0.3 %", flicker(0.003), right=True),
    Fault("exposure doubled between the axes", scaled(slice(10, None), 0.5), right=True),
    Fault("light turned on half way", lamp(9, 200), named=("image 10",)),
    Fault("even light turned on half way", lamp(12, 100, even=True), named=("image 13",)),
    Fault("light turned on between the axes", lamp(10, 300), right=True, named=("image 11",)),
    Fault("a flash in one frame", flash(13, 300), named=("image 14",)),
    Fault("camera moved by 3 pixels", moved(9, 2, -2), named=("image 10",)),
    Fault("camera moved by half a pixel", moved(9, 0.4, 0.3), named=("image 10",)),
    Fault("camera moved by 5 pixels between the axes", moved(10, 3, 4), named=("image 11",)),
    Fault("camera shaken in one frame", shaken(7, 0, 1.0), named=("image 8",)),
    Fault("overexposed by 10 %", overexposed(1.22), named=("saturat",)),
    Fault("overexposed by half", overexposed(1.65), named=("saturat",)),
    Fault("one frame overexposed twice", overexposed(2.0, [8]), named=("image 9",)),
    Fault("black level below zero", offset_too_low, named=("cut off at 0",)),
    Fault("a curve that changes between the series", gamma_between(10, 1.5), right=True, named=("image 11",)),
    Fault("hot pixels", hot, right=True),
    Fault("3 % of the pixels dead", dead(0.03), right=True),
    Fault("30 % of the pixels dead", dead(0.3), right=True, named=("pixels",)),
    Fault("a hand in one frame", hand(11), named=("image 12",)),
]
