"""A camera's frames with what the camera itself adds taken out: dark, bias and flat frames, repeated exposures.

    calibration = camera_calibration(dark=open_frames("dark/"), flat=open_frames("flat/"), saturation=4095)
    frames = LabFrames(open_frames("recorded/"), calibration, saturation=4095)
    stack = FringeStack(sets, frames)

A value is (raw - dark) / response, in counts. Bad pixels and saturated samples are no numbers (NaN).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.formats.images import FramePart
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.system import interruption

LEAST_RESPONSE = 0.1  # of the median: what answers less is a dead pixel, or is shaded by dust
MOST_BAD = 0.5  # of the flat frames' pixels that may be saturated or dead
# A longer exposure loses its weight between this part of the full scale and the whole. Were it dropped at one count,
# samples just below would be those whose noise is negative: a bias of up to 0.4 of their noise, here about 0.05.
FADES_FROM = 0.8
ORDERS = ("together", "in turn")


class Frames(Protocol):
    """Images [rows, columns], read when they are asked for: a FrameSource, a part of it, or an array [frames, rows,
    columns]."""

    def __len__(self) -> int: ...
    def __getitem__(self, number: int, /) -> NDArray[Any]: ...


@dataclass(frozen=True)
class MeanFrame:
    """mean: [rows, columns]; NaN where a sample is missing. saturated: [rows, columns], in any of the frames. error:
    standard error [rows, columns] of the mean by the frames' scatter; NaN for one frame. levels: mean of each frame."""

    mean: FloatArray = field(repr=False)
    saturated: BoolArray = field(repr=False)
    count: int
    error: FloatArray = field(repr=False)
    levels: tuple[float, ...] = ()


def mean_frame(frames: Frames, saturation: float = math.inf) -> MeanFrame:
    """The mean of frames, read one at a time. Raises ValueError for none, or for shapes that differ."""
    if not len(frames):
        raise ValueError("no frames for a mean")
    mean, squares = np.zeros(np.shape(frames[0])), np.zeros(np.shape(frames[0]))
    saturated = np.zeros(mean.shape, bool)
    levels = []
    for k in range(len(frames)):
        interruption.check()
        image = frames[k]
        if np.shape(image) != mean.shape:
            raise ValueError(f"frame {k} has shape {np.shape(image)}, the first one {mean.shape}")
        step = image - mean
        mean += step / (k + 1)
        squares += step * (image - mean)  # Welford: no difference of large numbers
        saturated |= is_saturated(image, saturation)
        known = np.isfinite(image)
        levels.append(float(image.mean(where=known, dtype=float)) if known.any() else math.nan)
    count = len(frames)
    error = np.sqrt(squares / (count * (count - 1))) if count > 1 else np.full(mean.shape, np.nan)
    return MeanFrame(mean, saturated, count, error, tuple(levels))


def is_saturated(image: NDArray[Any], saturation: float) -> BoolArray:
    """The samples at or above a count. Whole numbers are compared as such, not first turned into 64-bit ones."""
    if math.isfinite(saturation) and image.dtype.kind in "ui":
        return np.asarray(image >= math.ceil(saturation))
    return np.asarray(image >= saturation)


@dataclass(frozen=True)
class CameraCalibration:
    """What a camera adds to its frames, [rows, columns] each, None where it is not known.

    bias: counts without light at no exposure. dark: counts without light at dark_exposure_s, the bias included.
    response: of a pixel to light, of median 1. bad: pixels whose samples mean nothing; dead: those of them that the
    flat frames show and no map. notes: one line each. means: of the frames that were averaged, by what they are.
    """

    bias: FloatArray | None = field(default=None, repr=False)
    dark: FloatArray | None = field(default=None, repr=False)
    dark_exposure_s: float | None = None
    response: FloatArray | None = field(default=None, repr=False)
    bad: BoolArray | None = field(default=None, repr=False)
    notes: tuple[str, ...] = ()
    dead: BoolArray | None = field(default=None, repr=False)
    means: Mapping[str, MeanFrame] = field(default_factory=dict, repr=False)

    def offset(self, exposure_s: float | None, what: str) -> FloatArray | float:
        """Counts without light at an exposure; that of the dark frames where none is given.

        Raises ValueError, which names `what`, where the dark frames have another exposure and nothing tells the part
        of them that grows with it.
        """
        if self.dark is None:
            return 0.0 if self.bias is None else self.bias
        if exposure_s is None or self.dark_exposure_s is None or math.isclose(exposure_s, self.dark_exposure_s):
            return self.dark
        if self.bias is None:
            raise ValueError(
                f"{what}: {exposure_s:g} s, the dark frames {self.dark_exposure_s:g} s: must be equal, or "
                "give bias frames"
            )
        return self.bias + (self.dark - self.bias) * (exposure_s / self.dark_exposure_s)


def camera_calibration(
    *,
    bias: Frames | None = None,
    dark: Frames | None = None,
    flat: Frames | None = None,
    flat_dark: Frames | None = None,
    bad: NDArray[Any] | None = None,
    dark_exposure_s: float | None = None,
    flat_exposure_s: float | None = None,
    saturation: float = math.inf,
) -> CameraCalibration:
    """A camera's calibration from its frames. Each kind may be missing.

    flat: frames of evenly lit pixels. flat_dark: dark frames at the flat frames' exposure; without them the flat
    frames' offset is that of the dark or bias frames. bad: [rows, columns] map, not 0 for bad pixels. Pixels that are
    saturated in the flat frames, or that answer less than a tenth of the median, are bad as well.

    Raises ValueError for shapes that differ, for flat frames that are no brighter than their dark frames, for those of
    which half are unusable, and for exposures that cannot be reconciled.
    """
    means = {
        name: None if frames is None else mean_frame(frames, saturation)
        for name, frames in (("bias", bias), ("dark", dark), ("flat", flat), ("flat dark", flat_dark))
    }
    shapes = {name: one.mean.shape for name, one in means.items() if one is not None}
    shapes |= {} if bad is None else {"bad-pixel map": np.shape(bad)}
    first = next(iter(shapes.items()), None)
    for name, shape in shapes.items():
        if first is not None and (shape != first[1] or len(shape) != 2):
            raise ValueError(f"{name}: shape {shape}; {first[0]}: {first[1]}; must be equal, [rows, columns]")
    bias_mean, dark_mean, flat_dark_mean = (
        None if one is None else one.mean for one in (means["bias"], means["dark"], means["flat dark"])
    )
    known = CameraCalibration(bias_mean, dark_mean, dark_exposure_s)
    is_bad = None if bad is None else np.asarray(bad) != 0
    notes = [] if is_bad is None else [f"{int(is_bad.sum())} bad pixels by the map"]
    response, dead = None, None
    if means["flat"] is not None:
        offset = known.offset(flat_exposure_s, "flat frames") if flat_dark_mean is None else flat_dark_mean
        response, dead = _response(means["flat"], offset, is_bad)
        notes.append(f"{int(dead.sum())} pixels that are saturated or dead in the flat frames")
        is_bad = dead if is_bad is None else is_bad | dead
    made = {name: one for name, one in means.items() if one is not None}
    return CameraCalibration(bias_mean, dark_mean, dark_exposure_s, response, is_bad, tuple(notes), dead, made)


def _response(flat: MeanFrame, offset: FloatArray | float, bad: BoolArray | None) -> tuple[FloatArray, BoolArray]:
    """The pixels' response, of median 1, and the pixels that are not known bad and have none."""
    light = flat.mean - offset
    usable = np.isfinite(light) & ~flat.saturated & (True if bad is None else ~bad)
    middle = float(np.median(light[usable])) if usable.any() else math.nan
    if usable.any() and not middle > 0:
        raise ValueError(
            f"flat frames: {middle:g} counts above their dark frames in the middle: must be brighter; are they swapped?"
        )
    live = usable & (light >= LEAST_RESPONSE * middle)
    most = light.size if bad is None else int((~bad).sum())
    if live.sum() <= MOST_BAD * most:
        raise ValueError(f"flat frames: {most - int(live.sum())} of {most} pixels are saturated or dead: too many")
    return np.where(live, light / middle, np.nan), ~live & (True if bad is None else ~bad)


@dataclass(frozen=True)
class LabFrame:
    """values: [rows, columns] float32, counts at the first exposure; NaN for what is missing. saturated: [rows,
    columns], of samples that are missing since they were saturated."""

    values: NDArray[np.float32] = field(repr=False)
    saturated: BoolArray = field(repr=False)


@dataclass(frozen=True)
class LabFrames(Sequence[NDArray[Any]]):
    """Calibrated frames, made when they are asked for: lab[k] has the values, lab.frame(k) also what was saturated.

    frames: as recorded. saturation: count at which their samples are saturated. exposures_s: of the repeats that make
    one frame, their number being that of the repeats. Repeats of equal exposure are averaged; longer and shorter ones
    are merged: the counts of those that are not saturated over the sum of their exposures, which is the best estimate
    from shot noise. A sample is saturated where any of the shortest exposures is. order: the repeats of a frame follow
    each other ("together"), or the whole series is repeated ("in turn").

    Raises ValueError for shapes that differ, frames that are no multiple of the repeats, and unknown exposures.
    """

    frames: Frames = field(repr=False)
    calibration: CameraCalibration = field(default_factory=CameraCalibration)
    saturation: float = math.inf
    exposures_s: tuple[float | None, ...] = (None,)
    order: str = "together"
    _last: dict[int, LabFrame] = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        repeats = len(self.exposures_s)
        if self.order not in ORDERS:
            raise ValueError(f"order = {self.order!r}: must be one of {', '.join(map(repr, ORDERS))}")
        if not repeats or not len(self.frames) or len(self.frames) % repeats:
            raise ValueError(f"{len(self.frames)} frames: must be a multiple of the {repeats} repeats, above 0")
        known = [time for time in self.exposures_s if time is not None]
        if len(known) not in (0, repeats) or not all(0 < time < math.inf for time in known):
            raise ValueError(f"exposures_s = {list(self.exposures_s)}: must be numbers above 0")
        shape = np.shape(self.frames[0])
        for name in ("bias", "dark", "response", "bad"):
            part = getattr(self.calibration, name)
            if part is not None and part.shape != shape:
                raise ValueError(f"the camera's {name} frame has shape {part.shape}, the frames {shape}: must be equal")
        for time in self.exposures_s:
            self.calibration.offset(time, "exposures_s")

    @cached_property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of the frames."""
        rows, columns = np.shape(self.frames[0])
        return rows, columns

    def __len__(self) -> int:
        return len(self.frames) // len(self.exposures_s)

    @overload
    def __getitem__(self, number: int) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, number: slice) -> list[NDArray[Any]]: ...

    def __getitem__(self, number: int | slice) -> NDArray[Any] | list[NDArray[Any]]:
        if isinstance(number, slice):
            return [self[k] for k in range(*number.indices(len(self)))]
        return self.frame(number).values

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return (self[k] for k in range(len(self)))

    def name(self, number: int) -> str:
        """What to call a frame in messages: the first of the recorded ones that make it."""
        return self.recorded_name(self.recorded(number)[0])

    def recorded_name(self, number: int) -> str:
        """What to call a recorded frame in messages."""
        name = getattr(self.frames, "name", None)
        return f"frame {number + 1}" if name is None else str(name(number))

    def part(self, numbers: Iterable[int]) -> FramePart:
        """Some of the frames, in the order asked for."""
        return FramePart(self, tuple(range(len(self))[k] for k in numbers))

    def recorded(self, number: int) -> list[int]:
        """Numbers of the recorded frames that make a frame."""
        repeats = range(len(self.exposures_s))
        return [number + k * len(self) if self.order == "in turn" else number * len(repeats) + k for k in repeats]

    def frame(self, number: int) -> LabFrame:
        """A calibrated frame. The last one is kept, since a stack asks for its shape again."""
        number = range(len(self))[number]  # IndexError outside
        made = self._last.get(number)
        if made is None:
            made = self._made(number)
            self._last.clear()
            self._last[number] = made
        return made

    def _made(self, number: int) -> LabFrame:
        values, saturated = self._merged(self.recorded(number))
        if self._gain is not None:
            values *= self._gain
        if self.calibration.bad is not None:
            saturated = saturated & ~self.calibration.bad
        values[saturated] = np.nan
        values.flags.writeable = False
        return LabFrame(values, saturated)

    def _merged(self, numbers: list[int]) -> tuple[NDArray[np.float32], BoolArray]:
        """Counts above the offset at the first exposure, and where the shortest exposures are saturated."""
        times = [1.0 if time is None else time for time in self.exposures_s]
        shortest = min(times)
        rate, clipped = self._light(numbers, times, shortest)[::2]  # counts in the shortest exposure
        exposure = np.full(self.shape, times.count(shortest), np.float32) if len(set(times)) > 1 else None
        for time in sorted(set(times) - {shortest}):
            assert exposure is not None
            light, mean, saturated = self._light(numbers, times, time)
            share = np.clip((1 - mean / self.saturation) / (1 - FADES_FROM), 0, 1)
            share[saturated] = 0
            longer = time / shortest * times.count(time)
            rate += share * (longer / (exposure + longer)) * (light * (shortest / time) - rate)
            exposure += share * longer
        if times[0] != shortest:
            rate *= times[0] / shortest
        return rate, clipped

    def _light(
        self, numbers: list[int], times: list[float], time: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], BoolArray]:
        """Of the repeats of one exposure: mean counts above the offset, mean counts, and any saturated. In 32 bits: an
        error of 0.004 counts in 65535."""
        chosen = [k for k, own in zip(numbers, times, strict=True) if own == time]
        mean, saturated = np.zeros(self.shape, np.float32), np.zeros(self.shape, bool)
        for k in chosen:
            image = self.frames[k]
            if np.shape(image) != self.shape:
                raise ValueError(f"frame {k} has shape {np.shape(image)}, the first one {self.shape}: must be equal")
            np.add(mean, image, out=mean, casting="same_kind")
            saturated |= is_saturated(image, self.saturation)
        if len(chosen) > 1:
            mean /= len(chosen)
        return mean - self._offsets[time], mean, saturated

    @cached_property
    def _offsets(self) -> dict[float, Any]:
        """Counts without light, by the exposure; 1 stands for one that is not known."""
        of = self.calibration.offset
        return {time or 1.0: np.float32(of(time, "exposures_s")) for time in self.exposures_s}

    @cached_property
    def _gain(self) -> NDArray[np.float32] | None:
        """1 over the response; NaN for bad pixels."""
        known = self.calibration
        if known.response is None and known.bad is None:
            return None
        gain = np.ones(self.shape) if known.response is None else 1 / known.response
        return np.asarray(gain if known.bad is None else np.where(known.bad, np.nan, gain), np.float32)
