"""Types of the facts about a laboratory's images and camera, named as in report.json."""

from __future__ import annotations

from typing import TypedDict


class ImageFileFacts(TypedDict):
    """The images as they were read. bits: of a sample, 0 for floating point. saturation: count at which samples are
    taken for saturated, None where that is not known. notes: what was found, done or left out in reading them."""

    frames: int
    files: int
    bits: int
    saturation: float | None
    notes: list[str]


class CameraFacts(TypedDict):
    """What was known about the camera. exposures_s: of the images of a frame, empty where not known. averaged: number
    of frames by their kind; counts, standard_error: medians over the pixels of their mean and of its standard error,
    NaN for a single frame. bad_pixels: by the map, and dead or saturated in the flat frames."""

    images_per_frame: int
    exposures_s: list[float]
    averaged: dict[str, int]
    counts: dict[str, float]
    standard_error: dict[str, float]
    bad_pixels: int
    dead_pixels: int
