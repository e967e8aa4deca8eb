"""Mirrors that are no whole disk, and a plain oracle for which points lie on them."""

from __future__ import annotations

import functools
import math
from pathlib import Path

import numpy as np

from irtscots_cl.scene.outline import Outline, OutlinePart, Spider

# An L and an F, which no flip or turn takes into themselves, in units of the mirror's radius.
ELL = ((-0.55, -0.6), (0.45, -0.6), (0.45, -0.25), (-0.15, -0.25), (-0.15, 0.7), (-0.55, 0.7))
EFF = ((-0.4, -0.75), (-0.1, -0.75), (-0.1, -0.1), (0.3, -0.1), (0.3, 0.15), (-0.1, 0.15), (-0.1, 0.45), (0.5, 0.45),
       (0.5, 0.75), (-0.4, 0.75))  # fmt: skip
OUTLINED = ("hexagon", "rectangle", "cut hexagon", "ell", "eff", "parts", "spiders", "mask")
PIXELS = 64  # of the mask, per axis


def grown(points, size: float):
    return tuple((x * size, y * size) for x, y in points)


def outline_of(kind: str, diameter_mm: float, folder: Path | None = None) -> Outline:
    """An outline of a kind of OUTLINED for a mirror of that diameter. folder: where a mask's file is written."""
    r = diameter_mm / 2
    if kind == "hexagon":
        return Outline(shape="hexagon", across_flats_mm=1.6 * r, rotation_deg=11.0)
    if kind == "cut hexagon":  # the disk cuts its corners
        return Outline(shape="hexagon", across_corners_mm=2.2 * r, rotation_deg=4.0, centre_mm=(0.02 * r, -0.03 * r))
    if kind == "rectangle":
        return Outline(shape="rectangle", size_mm=(1.5 * r, 0.8 * r), rotation_deg=25.0, centre_mm=(0.05 * r, 0.1 * r))
    if kind in ("ell", "eff"):
        return Outline(shape="polygon", points_mm=grown(ELL if kind == "ell" else EFF, r))
    if kind == "parts":
        return Outline(
            part=(
                OutlinePart(shape="circle", diameter_mm=0.8 * r, obscuration_mm=0.3 * r, centre_mm=(-0.4 * r, 0.2 * r)),
                OutlinePart(shape="hexagon", across_flats_mm=0.6 * r, centre_mm=(0.45 * r, 0.3 * r)),
                OutlinePart(shape="polygon", points_mm=grown(ELL, 0.6 * r), centre_mm=(0.3 * r, -0.4 * r)),
            ),
            spider=(Spider(width_mm=0.06 * r, ends_mm=((-0.9 * r, 0.5 * r), (0.8 * r, 0.2 * r))),),
        )
    if kind == "spiders":
        return Outline(spider=(Spider(width_mm=0.07 * r, angles_deg=(20.0, 130.0, 250.0), centre_mm=(0.1 * r, 0.0)),))
    assert folder is not None
    path = folder / "mask.npy"
    np.save(path, ell_picture())
    return Outline(
        shape="mask", file=str(path), pitch_mm=(1.6 * r / PIXELS, 1.7 * r / PIXELS), centre_mm=(0.04 * r, 0.0)
    )


@functools.cache
def ell_picture() -> np.ndarray:
    """An L of whole pixels."""
    picture = np.zeros((PIXELS, PIXELS), np.uint8)
    picture[5:60, 8:24] = 255
    picture[5:20, 24:58] = 255
    return picture


def in_polygon(points, x: float, y: float) -> bool:
    """By the angle that the corners turn about the point: a whole turn inside, none outside."""
    turn = 0.0
    for (x0, y0), (x1, y1) in zip(points, [*points[1:], points[0]], strict=True):
        a, b = complex(x0 - x, y0 - y), complex(x1 - x, y1 - y)
        turn += math.atan2((a.conjugate() * b).imag, (a.conjugate() * b).real)
    return abs(turn) > math.pi


def is_on(outline: Outline, diameter_mm: float, obscuration_mm: float, x: float, y: float) -> bool:
    """Whether one point lies on the mirror, from the outline's keys alone."""
    r = math.hypot(x, y)
    if r > diameter_mm / 2 or r < obscuration_mm / 2:
        return False
    for spider in outline.spider:
        ends = [spider.ends_mm] if spider.ends_mm else [
            (spider.centre_mm, tuple(c + 9 * diameter_mm * f(math.radians(angle)) for c, f in
                                     zip(spider.centre_mm, (math.cos, math.sin), strict=True)))
            for angle in spider.angles_deg
        ]  # fmt: skip
        for (x0, y0), (x1, y1) in ends:
            length = math.hypot(x1 - x0, y1 - y0)
            along = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length
            across = ((x - x0) * (y1 - y0) - (y - y0) * (x1 - x0)) / length
            if 0 <= along <= length and abs(across) <= spider.width_mm / 2:
                return False
    shapes = outline.part or ([outline] if outline.shape else [])
    return not shapes or any(_in_shape(shape, x, y) for shape in shapes)


def _in_shape(shape, x: float, y: float) -> bool:
    u, v = x - shape.centre_mm[0], y - shape.centre_mm[1]
    if shape.shape == "circle":
        return shape.obscuration_mm / 2 <= math.hypot(u, v) <= shape.diameter_mm / 2
    if shape.shape == "mask":
        picture, (pitch_x, pitch_y) = ell_picture(), shape.pitch_mm
        row, column = math.floor(v / pitch_y + len(picture) / 2), math.floor(u / pitch_x + len(picture[0]) / 2)
        return 0 <= row < len(picture) and 0 <= column < len(picture[0]) and bool(picture[row, column])
    turn = math.radians(shape.rotation_deg)
    u, v = u * math.cos(turn) + v * math.sin(turn), v * math.cos(turn) - u * math.sin(turn)
    if shape.shape == "rectangle":
        return abs(u) <= shape.size_mm[0] / 2 and abs(v) <= shape.size_mm[1] / 2
    if shape.shape == "hexagon":
        flats = shape.across_flats_mm or shape.across_corners_mm * math.sqrt(3) / 2
        return all(abs(u * math.sin(k * math.pi / 3) - v * math.cos(k * math.pi / 3)) <= flats / 2 for k in range(3))
    return in_polygon(list(shape.points_mm), u, v)
