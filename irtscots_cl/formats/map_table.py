"""Height maps as text: a table of heights (CSV), or lines of x, y and height (XYZ).

Values are separated by commas, semicolons, tabs or spaces; decimals have a point. Lines that begin with # are
comments; those of the form `# key = value` or `# key: value` tell unit, pitch_mm, wavelength_nm, kind,
centre_mm. A table's first row is the top one, as a spreadsheet or an image shows it; `# first_row = bottom` says
otherwise. Missing heights are NaN, empty, or left out of an XYZ file, whose size then is in `# shape = rows, columns`.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.formats.frames import MAX_FRAME_VALUES, check_size, reading
from irtscots_cl.formats.height_map import KINDS, UNIT_MM, Findings, HeightMap, MapOptions, unit_named
from irtscots_cl.formats.text_numbers import comment_lines, cut_off, line_of, number, opened_text, short
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system.atomic_files import replacing

MISSING = dict.fromkeys(("", "nan", "-nan", "na", "n/a", "bad", "none", "null", "no data", "nodata", "--"), np.nan)
KEYS = ("unit", "pitch_mm", "wavelength_nm", "kind", "centre_mm", "first_row", "columns", "shape")
COMMENT = ""  # what is no key
MAX_COMMENT = 4000
MAX_WARNINGS = 20
NOISE_JUMP = 50.0  # from steps that are noise on equal places to steps of a grid
GRID_TOLERANCE = 0.1  # of the pitch, that places of an XYZ file may be off their grid: noise, few decimals


def is_table(path: Path) -> bool:
    """Whether a text file's first line that is no comment begins with a number, or is empty between separators."""
    with opened_text(path) as file:
        for _ in range(1000):
            line = file.readline(10**5)
            if line.strip() and not line.startswith("#"):
                break
    words = _split(line, _separator(line))
    try:
        number(words[0], "", MISSING)
    except (ValueError, IndexError):
        return False
    return bool(line.strip())


def read_map_table(path: Path, options: MapOptions) -> HeightMap:
    """The map of a CSV or XYZ file. Raises ValueError, with one line, for what cannot be read.

    A file of three columns and more than three rows is taken as XYZ unless it says `# columns = heights`.
    """
    found = Findings(str(path), options)
    with reading(path, "CSV"), opened_text(path) as file:
        said: dict[str, str] = {}
        found.warnings += cut_off(path)
        table = _rows(file, str(path), said, found)
        _no_numbering(table, str(path))
        wavelength = found.wavelength_nm(_numbers_said(said, "wavelength_nm", 1, found)[0])
        unit_mm = found.unit_mm(_unit_said(said, found), wavelength)
        kind = said.get("kind")
        if kind not in (None, *KINDS):
            raise ValueError(f"{path}: kind = {short(kind or '')}: must be {' or '.join(KINDS)}")
        pitch: tuple[float, float] | None
        middle: tuple[float, float] | None
        xyz = table.shape[1] == 3 and len(table) > 3 and said.get("columns") != "heights"
        if xyz:
            heights, pitch, middle = _gridded(table, str(path), _grid_said(said, found))
        else:
            heights = _upright(table, said, found)
            pitch, middle = _pair(said, "pitch_mm", found), _pair(said, "centre_mm", found)
    return found.build(
        heights,
        "XYZ" if xyz else "CSV",
        unit_mm,
        pitch_mm=found.pitch_mm(pitch),
        wavelength_nm=wavelength,
        kind=found.kind(kind),
        centre_mm=middle or (0.0, 0.0),
        comment=comment_lines(said.get(COMMENT, "").splitlines()),
    )


def _separator(line: str) -> str | None:
    """What separates the values of a line; None: spaces."""
    return next((mark for mark in (";", "\t", ",") if mark in line), None)


def _split(line: str, separator: str | None) -> list[str]:
    words = line.strip("\r\n").split(separator)
    return [word.strip() for word in words]


def _rows(file: IO[str], where: str, said: dict[str, str], found: Findings) -> FloatArray:
    """All rows of numbers [rows, columns]; what the comments say goes into `said`."""
    values = array("d")  # of all rows: no array of its own for each
    width = 0
    separator: str | None = None
    for at, line in enumerate(_lines(file, where), 1):
        if line.startswith("#"):
            _take_in(line, said, found)
            continue
        if not line.strip():
            continue
        separator = separator if width else _separator(line)
        words = _split(line, separator)
        if separator is not None and len(words) > 1 and not words[-1] and width in (0, len(words) - 1):
            words.pop()  # a separator at the end of the line
        width = width or len(words)
        if len(words) != width:
            raise ValueError(f"{where}: line {at}: {len(words)} values; the first row has {width}")
        values.extend(number(word, f"{where}: line {at}", MISSING) for word in words)
        if len(values) > MAX_FRAME_VALUES:
            raise ValueError(f"{where}: more than {MAX_FRAME_VALUES} values")
    if not values:
        raise ValueError(f"{where}: holds no numbers")
    return np.frombuffer(values).reshape(-1, width)


def _no_numbering(table: FloatArray, where: str) -> None:
    """Refuse a table whose first row and column only count, as programs for tables write them beside the values."""
    if min(table.shape) < 2:
        return
    across, down = table[0, 1:], table[1:, 0]
    if np.isnan(table[0, 0]) and all((line == line[0] + np.arange(len(line))).all() for line in (across, down)):
        raise ValueError(f"{where}: its first row and column number the others: save it without them (index, header)")


def _take_in(line: str, said: dict[str, str], found: Findings) -> None:
    """What a comment line tells: `# key = value`, or text."""
    key, mark, value = re.match(r"([^=:]*)([=:]?)(.*)", line[1:200].strip("\r\n")).groups()  # type: ignore[union-attr]
    name = key.strip().lower()
    if mark and name in KEYS:
        said[name] = value.strip().lower()
        return
    near = get_close_matches(name, KEYS, 1, 0.7) if mark and len(name) < 20 else []
    if near and len(found.warnings) < MAX_WARNINGS:
        found.warnings.append(f"{short(line)!r} is not used: is {near[0]} meant?")
    if len(said.get(COMMENT, "")) < MAX_COMMENT:
        text = value if mark and name == "comment" else line[1:200]
        said[COMMENT] = said.get(COMMENT, "") + text.strip() + "\n"


def _lines(file: IO[str], where: str) -> Iterator[str]:
    at = 1
    while line := line_of(file, where, at):
        yield line
        at += 1


def _upright(table: FloatArray, said: dict[str, str], found: Findings) -> FloatArray:
    first = said.get("first_row")
    if first not in (None, "top", "bottom"):
        raise ValueError(f"{found.where}: first_row = {short(first or '')}: must be top or bottom")
    if first is None:
        found.warnings.append("the table does not tell its row order: the first row is taken as the top")
    return table if first == "bottom" else table[::-1]


def _unit_said(said: dict[str, str], found: Findings) -> str | None:
    if "unit" not in said:
        return None
    unit = unit_named(said["unit"])
    if unit is None:
        raise ValueError(f"{found.where}: unit = {short(said['unit'])}: must be a length such as nm, or wave")
    return unit


def _numbers_said(said: dict[str, str], key: str, count: int, found: Findings) -> list[float | None]:
    if key not in said:
        return [None] * count
    words = said[key].replace(",", " ").split()
    if len(words) != count:
        raise ValueError(f"{found.where}: {key} = {short(said[key])}: must be {count} number{'s' * (count > 1)}")
    return [number(word, f"{found.where}: {key}") for word in words]


def _pair(said: dict[str, str], key: str, found: Findings) -> tuple[float, float] | None:
    x, y = _numbers_said(said, key, 2, found)
    return None if x is None or y is None else (x, y)


_Grid = tuple[tuple[float, float], tuple[float, float], tuple[int, int]]  # pitch, centre, (columns, rows)


def _grid_said(said: dict[str, str], found: Findings) -> _Grid | None:
    """The grid of an XYZ file whose comments tell all of it."""
    pitch, centre, shape = (_pair(said, key, found) for key in ("pitch_mm", "centre_mm", "shape"))
    if pitch is None or centre is None or shape is None:
        return None
    if not all(p > 0 for p in pitch) or not all(1 <= n <= MAX_FRAME_VALUES for n in shape):
        raise ValueError(f"{found.where}: pitch_mm and shape must be above 0, the shape at most {MAX_FRAME_VALUES}")
    return pitch, centre, (int(shape[1]), int(shape[0]))


def _gridded(
    points: FloatArray, where: str, grid: _Grid | None
) -> tuple[FloatArray, tuple[float, float], tuple[float, float]]:
    """Heights [rows, columns] of points x, y, z on a grid, its pitch and centre; NaN where a point is left out.

    grid: where it is known. Raises ValueError for points that are on no grid, or twice.
    """
    if not np.isfinite(points[:, :2]).all():
        raise ValueError(f"{where}: a place that is no finite number")
    axes = [_axis(points[:, k], where, "xy"[k]) for k in (0, 1)] if grid is None else list(zip(*grid, strict=True))
    (x_pitch, x_centre, x_count), (y_pitch, y_centre, y_count) = axes
    # a sparse file may name few points of a large grid
    check_size(where, x_count, y_count, 1, 1, len(points), 64)
    columns = _numbers_on(points[:, 0], *axes[0], f"{where}: x")
    rows = _numbers_on(points[:, 1], *axes[1], f"{where}: y")
    if len(np.unique(rows * x_count + columns)) < len(points):
        raise ValueError(f"{where}: the same place is there twice")
    heights = np.full((y_count, x_count), np.nan)
    heights[rows, columns] = points[:, 2]
    return heights, (x_pitch, y_pitch), (x_centre, y_centre)


def _axis(places: FloatArray, where: str, name: str) -> tuple[float, float, int]:
    """Pitch, centre and number of the places along an axis."""
    ordered = np.unique(places)
    steps = np.diff(ordered)
    if not steps.size:
        raise ValueError(f"{where}: all points have the same {name}: no map")
    span = float(ordered[-1] - ordered[0])
    count = int(min(np.rint(span / _pitch(np.sort(steps))), MAX_FRAME_VALUES)) + 1
    return span / (count - 1), float((ordered[0] + ordered[-1]) / 2), count


def _pitch(steps: FloatArray) -> float:
    """The pitch behind ascending steps between places: those far below the others are noise on the places."""
    with np.errstate(divide="ignore"):
        jumps = steps[1:] / steps[:-1]
    if jumps.size and jumps.max() > NOISE_JUMP:
        steps = steps[int(np.argmax(jumps)) + 1 :]
    return float(np.median(steps[steps < 1.5 * steps[0]]))


def _numbers_on(places: FloatArray, pitch: float, centre: float, count: int, where: str) -> NDArray[np.intp]:
    """The number on an even grid of each place."""
    index = (places - centre) / pitch + (count - 1) / 2
    nearest = np.rint(index)
    if not (np.abs(index - nearest).max() <= GRID_TOLERANCE and nearest.min() >= 0 and nearest.max() < count):
        raise ValueError(f"{where}: places are not on a grid of even steps; interpolate them first")
    return nearest.astype(np.intp)


def _comments(height_map: HeightMap, unit: str) -> list[str]:
    lines = [f"# unit = {unit}", f"# kind = {height_map.kind}"]
    if height_map.wavelength_nm is not None:
        lines.append(f"# wavelength_nm = {height_map.wavelength_nm!r}")
    if height_map.pitch_mm is not None:
        lines.append("# pitch_mm = {!r}, {!r}".format(*height_map.pitch_mm))
    lines.append("# centre_mm = {!r}, {!r}".format(*height_map.centre_mm))
    return lines + [f"# comment: {line}" for line in height_map.comment]


def write_map_csv(path: Path, height_map: HeightMap, unit: str = "nm") -> tuple[str, ...]:
    """Write a table of heights in a unit of length, the top row first. Returns notes, none."""
    lines = [*_comments(height_map, unit), "# first_row = top", "# columns = heights"]
    with replacing(path) as temporary, open(temporary, "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")
        for row in height_map.heights_mm[::-1] / UNIT_MM[unit]:
            file.write(",".join(map(repr, row.tolist())) + "\n")
    return ()


def write_map_xyz(path: Path, height_map: HeightMap, unit: str = "nm") -> tuple[str, ...]:
    """Write a line for each valid pixel: x and y in mm, height in a unit of length. Returns notes.

    Raises ValueError for a map without a lateral scale.
    """
    if height_map.pitch_mm is None:
        raise ValueError(f"{path}: an XYZ file needs a lateral scale, which the map does not have: give --pitch-mm")
    x, y = height_map.positions_mm()
    good = height_map.valid
    lines = [
        *_comments(height_map, unit),
        "# shape = {}, {}".format(*good.shape),
        f"# columns = x [mm], y [mm], height [{unit}]; invalid pixels are left out",
    ]
    with replacing(path) as temporary, open(temporary, "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")
        for row, used in enumerate(good):
            heights = height_map.heights_mm[row, used] / UNIT_MM[unit]
            beside = f" {y[row, 0].item()!r} "
            pairs = zip(x[row, used].tolist(), heights.tolist(), strict=True)
            file.writelines(f"{at!r}{beside}{height!r}\n" for at, height in pairs)
    return ()
