"""Tables of fiducials: marks on the mirror whose places are known, as TOML or CSV.

    kind = "dot"               # or "cross"
    size_mm = 8.0              # diameter of a dot, length of a cross's arms from end to end
    [[mark]]
    name = "A"
    x_mm = 120.0               # in the mirror's frame
    y_mm = -40.0

A mark may have its own kind, size_mm, width_mm (of a cross's arms), turn_deg, bright. A CSV file has the same names in
its first line.
"""

from __future__ import annotations

import csv
import io
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, Strict, TypeAdapter, ValidationError

from irtscots_cl.scene.validation import Degrees, PositiveMm, SceneError, bounded, checked, nearest, translate

MAX_MARKS = 1000
LEAST_MARKS = 4
STRAIGHT = 0.02  # width over length of marks that lie on a line
_Place = Annotated[float, Strict(), bounded(ge=-1e6, le=1e6)]
_Name = Annotated[str, Strict(), Field(min_length=1, max_length=64, description="a text of 1 to 64 characters")]
COMMON = ("kind", "size_mm", "width_mm", "turn_deg", "bright")


@checked("mark")
class Mark:
    """One mark at (x_mm, y_mm) of the mirror. size_mm: diameter of a dot; length of a cross's arms. width_mm: of the
    arms; None: a fifth of the length. turn_deg: of the arms from the mirror's x, y. bright: brighter than the mirror;
    others are darker."""

    name: _Name
    x_mm: _Place
    y_mm: _Place
    size_mm: PositiveMm
    kind: Annotated[Literal["dot", "cross"], Field(description="dot or cross")] = "dot"
    width_mm: Annotated[float | None, Field(gt=0, le=1e6, description="a number above 0, at most 1e6")] = None
    turn_deg: Degrees = 0.0
    bright: Annotated[bool, Strict(), Field(description="true or false")] = False

    @property
    def arm_mm(self) -> float:
        """Width of a cross's arms."""
        return self.width_mm if self.width_mm is not None else self.size_mm / 5


@dataclass(frozen=True)
class Marks:
    """The marks of a file, four or more, not on one line."""

    marks: tuple[Mark, ...]
    source: str

    @property
    def points_mm(self) -> np.ndarray:
        """Places x, y [n, 2]."""
        return np.array([(mark.x_mm, mark.y_mm) for mark in self.marks])


def read_marks(path: Path, radius_mm: float) -> Marks:
    """The marks of a file. radius_mm: of the mirror, on which they must lie.

    Raises ValueError, with a message of one line, for a file that is no table of marks.
    """
    where = f"--fiducials = {str(path)!r}"
    if not path.is_file():
        why = "it is a folder" if path.is_dir() else "there is no file of that name"
        raise ValueError(f"{where}: {why}; must be a TOML or CSV table of marks")
    try:
        text = path.read_text(encoding="utf-8-sig")
        rows = _of_toml(text) if path.suffix.lower() == ".toml" else _of_csv(text)
        marks = tuple(_mark(row, where, k) for k, row in enumerate(rows, 1))
    except SceneError:
        raise
    except (OSError, UnicodeDecodeError, ValueError, csv.Error) as error:  # TOMLDecodeError is a ValueError
        raise ValueError(f"{where}: {str(error).splitlines()[0]}") from None
    _check(marks, radius_mm, where)
    return Marks(marks, str(path))


def _of_toml(text: str) -> list[dict[str, Any]]:
    table = tomllib.loads(text)
    rows = table.pop("mark", None)
    for key in table:
        if key not in COMMON:
            raise ValueError(f"{key}: unknown key; {nearest(key, (*COMMON, 'mark'))}")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ValueError("no tables [[mark]]: must have one for every mark, with name, x_mm, y_mm")
    return [table | row for row in rows]


def _of_csv(text: str) -> list[dict[str, Any]]:
    rows = list(csv.DictReader(io.StringIO(text), strict=True))
    found: list[dict[str, Any]] = []
    for k, row in enumerate(rows, 1):
        if None in row or None in row.values():
            raise ValueError(f"mark {k}: another number of values than the first line has names")
        found.append({key.strip(): _value(key.strip(), str(value).strip()) for key, value in row.items() if value})
    return found


def _value(key: str, text: str) -> Any:
    if key == "bright":
        return {"true": True, "false": False}.get(text.lower(), text)
    if key in ("name", "kind"):
        return text
    try:
        return float(text)
    except ValueError:
        return text


def _mark(row: dict[str, Any], where: str, number: int) -> Mark:
    numbers = {key: float(v) if isinstance(v, int) and not isinstance(v, bool) else v for key, v in row.items()}
    try:
        return TypeAdapter(Mark).validate_python(numbers)
    except ValidationError as error:
        raise translate(error, Mark, where, ("mark", number)) from None


def _check(marks: tuple[Mark, ...], radius_mm: float, where: str) -> None:
    if not LEAST_MARKS <= len(marks) <= MAX_MARKS:
        raise ValueError(
            f"{where}: has {len(marks)} marks; must have {LEAST_MARKS} to {MAX_MARKS}: fewer do not show a wrong one"
        )
    names = [mark.name for mark in marks]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{where}: name = {name!r}: is that of two marks; must be different names")
    for mark in marks:
        if np.hypot(mark.x_mm, mark.y_mm) > radius_mm:
            raise ValueError(
                f"{where}: mark {mark.name}: x_mm, y_mm = {mark.x_mm:g}, {mark.y_mm:g}: must lie on the mirror, within "
                f"{radius_mm:g} mm of its middle"
            )
    points = np.array([(mark.x_mm, mark.y_mm) for mark in marks])
    for k, (one, mark) in enumerate(zip(points, marks, strict=True)):
        near = [other for other in range(k) if np.hypot(*(points[other] - one)) < mark.size_mm]
        if near:
            raise ValueError(f"{where}: marks {marks[near[0]].name} and {mark.name} overlap; must be apart")
    if is_straight(points):
        raise ValueError(f"{where}: all marks lie on one line; must spread over the mirror, to tell turn and scale")


def is_straight(points: np.ndarray) -> bool:
    """Whether points [n, 2] lie on a line, nearly."""
    if len(points) < 3:
        return True
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return bool(spread[1] <= STRAIGHT * spread[0])
