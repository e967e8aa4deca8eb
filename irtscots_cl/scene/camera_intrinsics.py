"""A calibrated camera as calibration programs describe it: the table [camera.intrinsics].

Only scenes with that table import this module. All numbers are those of the picture as OpenCV counts it: whole numbers
at the pixels' centres, (0, 0) the centre of the top left pixel, x to the right, y down.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, Strict, model_validator

from irtscots_cl.maths import lens_distortion
from irtscots_cl.scene.validation import MAX_PIXELS_PER_AXIS, array_of, bounded, checked, refuse

_Number = Annotated[float, Strict(), Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
_Size = Annotated[int, Strict(), Field(ge=1, le=4 * MAX_PIXELS_PER_AXIS)]
_First = Annotated[int, Strict(), Field(ge=0, lt=4 * MAX_PIXELS_PER_AXIS)]
_Bin = Annotated[int, Strict(), Field(ge=1, le=64)]
_FOCAL = bounded(gt=0, le=1e9)
OptionalFocal = Annotated[Annotated[float, Strict(), _FOCAL] | None, Field(description=_FOCAL.description)]
COUNTS = (0, 4, 5, 8)  # of distortion coefficients, as OpenCV's calibrations give them
PATH_STEPS, NEWTON_STEPS = 24, 6  # from the principal point to a point of the image's edge
BETWEEN = 4  # places on each of those steps
EDGE_POINTS = 8  # on each side of the image
MIN_DETERMINANT = 0.05  # of the distortion: below it an image point says next to nothing about the direction


_DISTORTION = "[k1, k2, p1, p2], [k1, k2, p1, p2, k3] or these with k4, k5, k6, finite numbers within 1e6"


@checked("intrinsics")
class Intrinsics:
    """Focal lengths fx, fy and principal point in pixels, distortion, region of interest, binning.

    image_size_px: (columns, rows) of the picture that was calibrated; None: what roi_px and binning make of the
    detector's pixels. roi_px: the picture's first (column, row) that is read out. binning: (x, y) pixels of the picture
    that make one of the detector's. fx, fy None: image distance over pitch; principal_point_px None: the middle of the
    picture. distortion: in OpenCV's order, see maths/lens_distortion.py.

    Raises SceneError for a value that is not allowed.
    """

    image_size_px: Annotated[
        Annotated[tuple[_Size, _Size], *array_of("")] | None,
        Field(description=f"[columns, rows], two integers from 1 to {4 * MAX_PIXELS_PER_AXIS}"),
    ] = None
    principal_point_px: Annotated[
        Annotated[tuple[_Number, _Number], *array_of("")] | None,
        Field(description="[x, y], two finite numbers within 1e6"),
    ] = None
    fx: OptionalFocal = None
    fy: OptionalFocal = None
    distortion: Annotated[tuple[_Number, ...], *array_of(_DISTORTION)] = ()
    roi_px: Annotated[tuple[_First, _First], *array_of("[column, row], two integers of at least 0")] = (0, 0)
    binning: Annotated[tuple[_Bin, _Bin], *array_of("[x, y], two integers from 1 to 64")] = (1, 1)

    @model_validator(mode="after")
    def _check(self) -> Intrinsics:
        if len(self.distortion) not in COUNTS:
            refuse(("distortion",), self.distortion, f"be {_DISTORTION}")
        return self

    @property
    def is_distorted(self) -> bool:
        return any(self.distortion)


def picture_size(intrinsics: Intrinsics, pixels: tuple[int, int]) -> tuple[int, int]:
    """Columns and rows of the calibrated picture of a detector with so many pixels (columns, rows)."""
    read = tuple(roi + n * b for roi, n, b in zip(intrinsics.roi_px, pixels, intrinsics.binning, strict=True))
    return intrinsics.image_size_px or (read[0], read[1])


def check_intrinsics(
    intrinsics: Intrinsics, pixels: tuple[int, int], pitch_mm: float, image_distance_mm: float
) -> None:
    """Raise the error that a checked dataclass turns into a SceneError, unless the numbers fit a detector.

    pixels: the detector's (columns, rows). Refused are a region outside the picture, a focal length in pixels that is
    far from the camera's own, a principal point far outside the picture, and a distortion that folds the image.
    """
    size = picture_size(intrinsics, pixels)
    for k, axis in enumerate(("columns", "rows")):
        last = intrinsics.roi_px[k] + pixels[k] * intrinsics.binning[k]
        if last > size[k]:
            must = f"leave room for {pixels[k]} {axis} of {intrinsics.binning[k]} pixels in a picture of {size[k]}"
            refuse(("intrinsics", "roi_px"), intrinsics.roi_px, must)
        if intrinsics.principal_point_px is not None:
            point = intrinsics.principal_point_px[k]
            if not -size[k] <= point <= 2 * size[k]:
                must = f"lie within one size of the picture of {list(size)} pixels about it"
                refuse(("intrinsics", "principal_point_px"), intrinsics.principal_point_px, must)
        # of pixels that binning has not left square, pitch_mm is one side
        own = [image_distance_mm / pitch_mm * joined for joined in sorted(intrinsics.binning)]
        focal = (intrinsics.fx, intrinsics.fy)[k]
        if focal is not None and not 0.5 * own[0] <= focal <= 2.0 * own[1]:
            one = f"{own[0]:.6g}" if own[0] == own[1] else f"{own[0]:.6g} to {own[1]:.6g}"
            must = f"be within a factor of 2 of {one}, the image distance over the pitch of the picture's pixels"
            refuse(("intrinsics", ("fx", "fy")[k]), focal, must)
    if intrinsics.is_distorted and (at := _fold(intrinsics, pixels, pitch_mm, image_distance_mm)):
        must = f"be one-to-one in the image; it folds beyond {at}, towards pixel [{round(at.column)}, {round(at.row)}]"
        refuse(("intrinsics", "distortion"), intrinsics.distortion, must)


class Fold:
    """Where a distortion folds: radius in units of the focal length, on the way to a pixel of the picture."""

    def __init__(self, radius: float, column: float, row: float):
        self.radius, self.column, self.row = radius, column, row

    def __str__(self) -> str:
        return f"{self.radius:.3g} focal lengths from the principal point"


def _fold(intrinsics: Intrinsics, pixels: tuple[int, int], pitch_mm: float, image_distance_mm: float) -> Fold | None:
    """The first place where the distortion is not one-to-one between the principal point and the image's edge."""
    coefficients = lens_distortion.full(intrinsics.distortion)
    size = picture_size(intrinsics, pixels)
    focal = [f or image_distance_mm / pitch_mm * b
             for f, b in zip((intrinsics.fx, intrinsics.fy), intrinsics.binning, strict=True)]  # fmt: skip
    middle = intrinsics.principal_point_px or ((size[0] - 1) / 2, (size[1] - 1) / 2)
    goals = {(column, row): ((column - middle[0]) / focal[0], (row - middle[1]) / focal[1])
             for column, row in _edge(intrinsics, pixels)}  # fmt: skip
    if _is_slight(2 * max(math.hypot(*goal) for goal in goals.values()), coefficients):
        return None
    for (column, row), goal in goals.items():
        if (radius := _fold_towards(goal, coefficients)) is not None:
            return Fold(radius, column, row)
    return None


def _is_slight(radius: float, coefficients: lens_distortion.Coefficients) -> bool:
    """Whether a distortion changes distances by less than half everywhere within a radius, by a bound on its matrix.

    Then it is one-to-one there, its determinant is above 1/4, and what it puts within half the radius lies within it.
    """
    k1, k2, p1, p2, k3, *rational = coefficients
    r2 = radius * radius
    most = r2 * (3 * abs(k1) + r2 * (5 * abs(k2) + r2 * 7 * abs(k3))) + 8 * radius * (abs(p1) + abs(p2))
    return not any(rational) and most < 0.5


def _fold_towards(goal: tuple[float, float], coefficients: lens_distortion.Coefficients) -> float | None:
    """Radius of the last place before a fold, on the way from the principal point to what the lens puts at the goal."""
    x = y = 0.0
    for step in range(1, PATH_STEPS + 1):
        before, share = (x, y), step / PATH_STEPS
        try:
            for _ in range(NEWTON_STEPS):
                x, y, _ = lens_distortion.towards(x, y, share * goal[0], share * goal[1], coefficients)
                if not abs(x) + abs(y) < 1e3:
                    return math.hypot(*before)
            # the way there too: a step may lead over a fold to where the image has turned twice
            for part in range(1, BETWEEN + 1):
                at_x, at_y = (a + (b - a) * part / BETWEEN for a, b in zip(before, (x, y), strict=True))
                xx, xy, yy = lens_distortion.distortion_matrix(at_x, at_y, coefficients)
                if not xx * yy - xy * xy > MIN_DETERMINANT:
                    return math.hypot(*before)
            at = lens_distortion.distort(x, y, coefficients)
        except ZeroDivisionError:  # of a determinant, or where the rational term ends
            return math.hypot(*before)
        if not abs(at[0] - share * goal[0]) + abs(at[1] - share * goal[1]) < 1e-6:
            return math.hypot(*before)
    return None


def _edge(intrinsics: Intrinsics, pixels: tuple[int, int]) -> list[tuple[float, float]]:
    """Points (column, row) of the picture on the edge of the part that is read out."""
    first = [roi - 0.5 for roi in intrinsics.roi_px]
    length = [n * b for n, b in zip(pixels, intrinsics.binning, strict=True)]
    points = []
    for k in range(EDGE_POINTS + 1):
        share = k / EDGE_POINTS
        for end in (0.0, 1.0):
            points.append((first[0] + share * length[0], first[1] + end * length[1]))
            points.append((first[0] + end * length[0], first[1] + share * length[1]))
    return points
