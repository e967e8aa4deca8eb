"""Exposure times of recorded images: as told, or as their files say."""

from __future__ import annotations

import math
from collections.abc import Sequence

from irtscots_cl.formats.images import FrameSource
from irtscots_cl.imaging.camera_files import CameraFiles

CLOSE = 1e-3  # relative: camera programs round


def exposures_of(frames: FrameSource, camera: CameraFiles) -> tuple[float | None, ...]:
    """Of the images that make a frame, in their order; None where neither the camera's table nor all files say.

    Raises ValueError for files that contradict the table or, at the same place of different frames, each other. One
    image per frame may have an exposure of its own: `check_equal` says where not.
    """
    repeats, known = camera.images_of_frame, frames.exposures_s
    times: list[float | None] = list(camera.exposures_s) or [None] * repeats
    if repeats == 1 and not camera.exposures_s:
        common = common_exposure(frames)
        other = next((k for k, own in enumerate(known) if None not in (own, known[0]) and not _alike(known[0], own)), 0)
        if other and camera.dark:
            raise ValueError(
                f"{frames.name(other)}: {known[other]:g} s by the file, {frames.name(0)} {known[0]:g} s: must be equal "
                "where dark frames are taken off"
            )
        return (common,)
    count = len(frames) // repeats
    for number, own in enumerate(known):
        place = number % repeats if camera.repeat_order == "together" else number // count
        if own is None:
            continue
        if times[place] is None:
            times[place] = own
        elif not _alike(times[place], own):
            said = "exposures_s says" if camera.exposures_s else "the first of its place has"
            raise ValueError(f"{frames.name(number)}: {own:g} s by the file; {said} {times[place]:g} s: must be equal")
    if len([time for time in times if time is not None]) < repeats:
        return (None,) * repeats
    return tuple(times)


def check_equal(frames: FrameSource, series: Sequence[Sequence[int]], name: str) -> None:
    """Raise ValueError where the files say that images of one series have different exposures.

    series: numbers of the images of each. name: what a series is, for the message.
    """
    known = frames.exposures_s
    for numbers in series:
        for number in numbers[1:]:
            if not _alike(known[numbers[0]], known[number]):
                one, other = (f"{frames.name(k)}: {known[k]} s" for k in (number, numbers[0]))
                raise ValueError(f"{one} exposure, {other}, by the files: must be equal in {name}")


def common_exposure(frames: FrameSource | None) -> float | None:
    """Exposure of all frames by their files; None where they do not say, or differ."""
    if frames is None:
        return None
    known = frames.exposures_s
    return known[0] if all(_alike(known[0], own) for own in known) else None


def _alike(one: float | None, other: float | None) -> bool:
    if one is None or other is None:
        return one is other
    return math.isclose(one, other, rel_tol=CLOSE)
