"""A mirror that is no whole disk: the table [mirror.outline]. Only scenes that have one import this module.

The mirror is the disk of diameter_mm without the hole of obscuration_mm, and of that the part within the outline: one
shape, or the union of several parts, without the strips of spiders. Frame: the mirror's x and y. Angles are told from
+x towards +y.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, model_validator

from irtscots_cl.scene.validation import (
    MAX_LENGTH_MM,
    Degrees,
    NonNegativeMm,
    OffsetMm,
    OptionalMm,
    OptionalSizeMm,
    PitchMm,
    PositiveMm,
    array_of,
    checked,
    refuse,
)

MAX_POINTS = 256  # of a polygon: its sides are compared with each other
MAX_CORNERS = 1024  # of all parts and spiders: a device's constant memory holds them
MAX_PARTS = 128
SHAPES = ("circle", "rectangle", "hexagon", "polygon", "mask")
ACROSS = ("across_flats_mm", "across_corners_mm")
ALLOWS = {  # what each shape needs or may have
    "circle": ("diameter_mm", "obscuration_mm", "centre_mm"),
    "rectangle": ("size_mm", "centre_mm", "rotation_deg"),
    "hexagon": (*ACROSS, "centre_mm", "rotation_deg"),
    "polygon": ("points_mm", "centre_mm", "rotation_deg"),
    "mask": ("file", "pitch_mm", "centre_mm"),
}
NEEDS = {"circle": ("diameter_mm",), "rectangle": ("size_mm",), "polygon": ("points_mm",), "mask": ("file", "pitch_mm")}
MEASURES = ("diameter_mm", "obscuration_mm", "size_mm", *ACROSS, "points_mm", "rotation_deg", "file", "pitch_mm",
            "centre_mm")  # fmt: skip
_Coordinate = Annotated[float, Strict(), Field(ge=-MAX_LENGTH_MM, le=MAX_LENGTH_MM, allow_inf_nan=False)]
_Point = tuple[_Coordinate, _Coordinate]
_POINTS = f"an array of [x, y], 3 to {MAX_POINTS} corners in order, finite numbers within {MAX_LENGTH_MM:g}"
Points = Annotated[tuple[_Point, ...], *array_of(_POINTS)]
Ends = Annotated[
    tuple[_Point, ...], *array_of(f"[[x, y], [x, y]], its two ends, finite numbers within {MAX_LENGTH_MM:g}")
]
Angles = Annotated[
    tuple[Annotated[float, Strict(), Field(ge=-360, le=360)], ...], *array_of("an array of angles from -360 to 360")
]
_WORD = Field(description=f"one of {', '.join(SHAPES)}")
Point = tuple[float, float]


@checked("part")
class OutlinePart:
    """One shape. circle: a disk or, with obscuration_mm, a ring; a hexagon has a corner towards +x, a rectangle its
    width along x, before they are turned by rotation_deg about their centre. A polygon's points are told from
    centre_mm.

    Raises SceneError for a value that is not allowed.
    """

    shape: Annotated[
        Literal["circle", "rectangle", "hexagon", "polygon"], Field(description=f"one of {', '.join(SHAPES[:-1])}")
    ]
    diameter_mm: OptionalMm = None
    obscuration_mm: NonNegativeMm = 0.0
    size_mm: OptionalSizeMm = None
    across_flats_mm: OptionalMm = None
    across_corners_mm: OptionalMm = None
    points_mm: Points = ()
    centre_mm: OffsetMm = (0.0, 0.0)
    rotation_deg: Degrees = 0.0

    @model_validator(mode="after")
    def _check(self) -> OutlinePart:
        check_shape(self)
        return self


@checked("spider")
class Spider:
    """Straight strips of width_mm that send no light: from centre_mm outwards at angles_deg, or between two ends_mm.

    Raises SceneError for a value that is not allowed.
    """

    width_mm: PositiveMm
    angles_deg: Angles = ()
    ends_mm: Ends = ()
    centre_mm: OffsetMm = (0.0, 0.0)

    @model_validator(mode="after")
    def _check(self) -> Spider:
        if bool(self.angles_deg) == bool(self.ends_mm):
            refuse(("angles_deg",), self.angles_deg, "be given, or ends_mm, and not both")
        if self.ends_mm and (len(self.ends_mm) != 2 or self.ends_mm[0] == self.ends_mm[1]):
            refuse(("ends_mm",), self.ends_mm, "be two different points [[x, y], [x, y]]")
        if self.ends_mm and self.centre_mm != (0.0, 0.0):
            refuse(("centre_mm",), self.centre_mm, "be left out where ends_mm is given")
        if len(self.angles_deg) > MAX_PARTS:
            refuse(("angles_deg",), f"{len(self.angles_deg)} angles", f"be at most {MAX_PARTS}")
        return self

    def strips_mm(self, reach_mm: float) -> list[list[Point]]:
        """Corners of each strip, counterclockwise. reach_mm: to what distance from the origin strips at an angle go."""
        if self.ends_mm:
            return [_strip(self.ends_mm[0], self.ends_mm[1], self.width_mm)]
        x, y = self.centre_mm
        length = reach_mm + math.hypot(x, y)
        turns = [math.radians(angle) for angle in self.angles_deg]
        return [_strip((x, y), (x + length * math.cos(t), y + length * math.sin(t)), self.width_mm) for t in turns]


@checked("outline")
class Outline:
    """The part of the disk that is the mirror: one shape, as in OutlinePart; a mask, a picture that is not 0 where the
    mirror is; or the union of `part`. Spiders are taken away; with nothing else the whole disk is meant.

    file: of a mask: row k of n lies at y = centre_mm[1] + (k - (n - 1) / 2) pitch_mm, columns likewise along x.

    Raises SceneError for a value that is not allowed.
    """

    shape: Annotated[Literal["circle", "rectangle", "hexagon", "polygon", "mask"] | None, _WORD] = None
    diameter_mm: OptionalMm = None
    obscuration_mm: NonNegativeMm = 0.0
    size_mm: OptionalSizeMm = None
    across_flats_mm: OptionalMm = None
    across_corners_mm: OptionalMm = None
    points_mm: Points = ()
    centre_mm: OffsetMm = (0.0, 0.0)
    rotation_deg: Degrees = 0.0
    file: Annotated[
        Annotated[str, Strict(), Field(min_length=1, max_length=4096)] | None,
        Field(description="the path of a picture, an NPY file, or an HDF5 file with a dataset `mask`"),
    ] = None
    pitch_mm: Annotated[PitchMm | None, Field(description="the distance of a mask's pixels, or an array [x, y]")] = None
    part: Annotated[tuple[OutlinePart, ...], Field(description="tables [[mirror.outline.part]]")] = ()
    spider: Annotated[tuple[Spider, ...], Field(description="tables [[mirror.outline.spider]]")] = ()

    @model_validator(mode="after")
    def _check(self) -> Outline:
        check_shape(self)
        if self.part and self.shape is not None:
            refuse(("shape",), self.shape, "be left out where there are tables [[mirror.outline.part]]")
        if not (self.part or self.spider or self.shape is not None):
            refuse(("shape",), None, "be given, or tables [[mirror.outline.part]], or [[mirror.outline.spider]]")
        if self.is_mask and self.spider:
            refuse(("spider",), f"{len(self.spider)} tables", "be left out with a mask: 0 in the file, instead")
        strips = sum(max(len(spider.angles_deg), 1) for spider in self.spider)
        if len(self.part) + strips > MAX_PARTS:
            refuse(("part",), f"{len(self.part)} parts and {strips} strips", f"be at most {MAX_PARTS}")
        corners = sum(len(corners_mm(shape)) for shape in self.shapes) + 4 * strips
        if corners > MAX_CORNERS:
            refuse(("part",), f"{corners} corners", f"have at most {MAX_CORNERS} corners together")
        return self

    @property
    def is_mask(self) -> bool:
        return self.shape == "mask"

    @property
    def shapes(self) -> tuple[Any, ...]:
        """The shapes of which the mirror is the union; none of a mask, and where only spiders are told of."""
        if self.part:
            return self.part
        return () if self.shape is None or self.is_mask else (self,)

    @property
    def is_convex(self) -> bool:
        """Whether it is one convex polygon and nothing else: chords across it are in one piece."""
        if len(self.shapes) != 1 or self.spider:
            return False
        points = corners_mm(self.shapes[0])
        return len(points) > 2 and all(
            _turn(*(points[(k + m) % len(points)] for m in range(3))) >= 0 for k in range(len(points))
        )

    @property
    def pitch_xy_mm(self) -> Point:
        """Of a mask's pixels, along x and y."""
        pitch = self.pitch_mm or 1.0
        return pitch if isinstance(pitch, tuple) else (pitch, pitch)

    def check_within(self, diameter_mm: float, obscuration_mm: float) -> None:
        """Refuse shapes that leave nothing of a disk with a hole; what only sticks out is cut by the disk."""
        for k, shape in enumerate(self.shapes):
            _meets(shape, ("outline", "part", k) if self.part else ("outline",), diameter_mm, obscuration_mm)


def check_shape(shape: Any) -> None:
    """Refuse an OutlinePart, or an Outline of one shape, whose measures do not fit its kind."""
    kind = shape.shape
    for key in MEASURES:
        value = getattr(shape, key, None)
        given = value not in (None, (), 0.0, (0.0, 0.0))
        if given and key not in ALLOWS.get(kind, ()):
            if kind is None:
                refuse((key,), value, "be left out without a shape")
            refuse((key,), value, f"be left out for shape {kind!r}")
        if not given and key in NEEDS.get(kind, ()):
            refuse((key,), value or None, f"be given for shape {kind!r}")
    if kind == "hexagon" and (shape.across_flats_mm is None) == (shape.across_corners_mm is None):
        refuse(("across_flats_mm",), shape.across_flats_mm, "be given, or across_corners_mm, and not both")
    if kind == "circle" and not shape.obscuration_mm < shape.diameter_mm:
        refuse(("obscuration_mm",), shape.obscuration_mm, f"be below diameter_mm ({shape.diameter_mm!r})")
    if kind == "polygon":
        check_polygon(shape.points_mm)


def corners_mm(shape: Any) -> list[Point]:
    """Corners of a rectangle, hexagon or polygon in the mirror's x, y, counterclockwise; [] of other shapes."""
    if shape.shape == "rectangle":
        half_x, half_y = (size / 2 for size in shape.size_mm)
        points = [(half_x, half_y), (-half_x, half_y), (-half_x, -half_y), (half_x, -half_y)]
    elif shape.shape == "hexagon":
        radius = shape.across_corners_mm / 2 if shape.across_flats_mm is None else shape.across_flats_mm / math.sqrt(3)
        sixth = math.pi / 3
        points = [(radius * math.cos(k * sixth), radius * math.sin(k * sixth)) for k in range(6)]
    elif shape.shape == "polygon":
        points = list(shape.points_mm)
        points = points if _area(points) > 0 else points[::-1]
    else:
        return []
    turn, (x, y) = math.radians(shape.rotation_deg), shape.centre_mm
    c, s = math.cos(turn), math.sin(turn)
    return [(x + c * u - s * v, y + s * u + c * v) for u, v in points]


def _strip(start: Point, end: Point, width_mm: float) -> list[Point]:
    """Corners, counterclockwise, of a strip about the straight line from start to end."""
    (x0, y0), (x1, y1) = start, end
    length = math.hypot(x1 - x0, y1 - y0)
    u, v = (x1 - x0) / length * width_mm / 2, (y1 - y0) / length * width_mm / 2
    return [(x0 + v, y0 - u), (x1 + v, y1 - u), (x1 - v, y1 + u), (x0 - v, y0 + u)]


def check_polygon(points: tuple[Point, ...]) -> None:
    count = len(points)
    if not 3 <= count <= MAX_POINTS:
        refuse(("points_mm",), f"{count} points", f"be 3 to {MAX_POINTS} corners")
    sides = list(pairwise((*points, points[0])))
    for a, b in sides:
        if a == b:
            must = "differ from the corner before it; the last side leads back to the first corner by itself"
            refuse(("points_mm",), list(b), must)
    for k, (a, b) in enumerate(sides):
        for m in range(k + 1, count):
            c, d = sides[m]
            adjacent = m == k + 1 or (k == 0 and m == count - 1)
            if _folds(sides[k], sides[m], m == k + 1) if adjacent else _cross(a, b, c, d):
                must = f"be a polygon whose sides do not meet: side {k + 1} meets side {m + 1}"
                refuse(("points_mm",), f"{count} points", must)


def _area(points: list[Point]) -> float:
    """Signed: above 0 if counterclockwise. Told from the first point, which keeps its digits."""
    x0, y0 = points[0]
    moved = [(x - x0, y - y0) for x, y in points]
    return sum(x * v - y * u for (x, y), (u, v) in pairwise((*moved, moved[0]))) / 2


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _between(a: Point, b: Point, c: Point) -> bool:
    """Whether c, on the line through a and b, lies between them."""
    return min(a[0], b[0]) <= c[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= c[1] <= max(a[1], b[1])


def _cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether two sides without a common corner meet."""
    of_ab, of_cd = (_turn(a, b, c), _turn(a, b, d)), (_turn(c, d, a), _turn(c, d, b))
    if of_ab[0] * of_ab[1] < 0 and of_cd[0] * of_cd[1] < 0:
        return True
    on = ((of_ab[0], a, b, c), (of_ab[1], a, b, d), (of_cd[0], c, d, a), (of_cd[1], c, d, b))
    return any(turn == 0 and _between(*points) for turn, *points in on)


def _folds(one: tuple[Point, Point], other: tuple[Point, Point], follows: bool) -> bool:
    """Whether neighbouring sides lie on each other."""
    (a, b), (_, d) = (one, other) if follows else (other, one)
    back = (b[0] - a[0]) * (d[0] - b[0]) + (b[1] - a[1]) * (d[1] - b[1]) < 0
    return _turn(a, b, d) == 0 and back


def _meets(shape: Any, steps: tuple[Any, ...], diameter_mm: float, obscuration_mm: float) -> None:
    """Refuse a shape beside the disk, or in its hole. steps: from the mirror to the shape."""
    nearest, farthest = _distances(shape)
    if nearest >= diameter_mm / 2:
        must = f"reach into the disk of mirror.diameter_mm ({diameter_mm!r})"
        refuse((*steps, "shape"), shape.shape, must)
    if farthest <= obscuration_mm / 2:
        must = f"reach out of the hole of mirror.obscuration_mm ({obscuration_mm!r})"
        refuse((*steps, "shape"), shape.shape, must)


def _distances(shape: Any) -> tuple[float, float]:
    """Least and largest distance of a shape's points from the mirror's centre."""
    if shape.shape == "circle":
        away, outer, inner = math.hypot(*shape.centre_mm), shape.diameter_mm / 2, shape.obscuration_mm / 2
        return max(away - outer, inner - away, 0.0), away + outer
    points = corners_mm(shape)
    sides = list(pairwise((*points, points[0])))
    farthest = max(math.hypot(*point) for point in points)
    inside = sum((a[1] <= 0) != (b[1] <= 0) and a[0] - a[1] * (b[0] - a[0]) / (b[1] - a[1]) > 0 for a, b in sides) % 2
    return (0.0 if inside else min(_from_origin(a, b) for a, b in sides)), farthest


def _from_origin(a: Point, b: Point) -> float:
    """Distance of a side from the origin."""
    u, v = b[0] - a[0], b[1] - a[1]
    share = min(max(-(a[0] * u + a[1] * v) / (u * u + v * v), 0.0), 1.0)
    return math.hypot(a[0] + share * u, a[1] + share * v)
