"""Text of calibration programs as nested tables: OpenCV's FileStorage (YAML and JSON), ROS's camera_info, plain YAML.

All plain values stay text until a number is asked for. YAML's own rules for what looks like a number differ from those
of the programs that write these files: to PyYAML, 1e-05 and .Nan are text, 0123 is 83 and 1:30 is 90. OpenCV up to 4
begins its files with %YAML:1.0, which is no YAML; its tags !!opencv-matrix are known to no other reader; its JSON may
hold .Nan, which is no JSON.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

MAX_BYTES = 2**22  # such files may hold the corners of all calibration images, too
MAX_NUMBERS = 64  # in a matrix that is asked for
_HEADER = re.compile(r"^\s*%YAML[: ][^\n]*\n")


def read_tables(path: Path) -> dict[str, Any]:
    """The file's tables. Raises ValueError, with one line, for one that cannot be read or holds no table."""
    try:
        with open(path, "rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror or type(error).__name__}") from None
    except ValueError:  # a null character in the name
        raise ValueError(f"{path}: cannot be read: no file can have this name") from None
    if len(data) > MAX_BYTES:
        raise ValueError(f"{path}: is too large; a calibration file has at most {MAX_BYTES} bytes")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{path}: is not UTF-8 text (byte {error.start}); a calibration file is YAML or JSON"
        ) from None
    if text.lstrip().startswith("<"):
        raise ValueError(f"{path}: is XML; must be YAML or JSON, as cv::FileStorage writes for names in .yml or .json")
    tables = _parsed(text, path)
    if not isinstance(tables, dict):
        raise ValueError(f"{path}: holds no table of keys and values; a calibration file is YAML or JSON")
    return tables


def _parsed(text: str, path: Path) -> Any:
    if text.lstrip().startswith("{"):
        try:
            return json.loads(text, parse_float=str, parse_int=str, parse_constant=str)
        except (ValueError, RecursionError):
            pass  # YAML reads most of what is nearly JSON
    try:
        return yaml.load(_HEADER.sub("", text), getattr(yaml, "CBaseLoader", yaml.BaseLoader))
    except RecursionError:
        raise ValueError(f"{path}: is not valid YAML: nested too deep") from None
    except (yaml.YAMLError, ValueError) as error:
        problem, mark = getattr(error, "problem", None), getattr(error, "problem_mark", None)
        reason = str(problem or error).splitlines()[0] if str(problem or error) else type(error).__name__
        place = f" in line {mark.line + 1}" if mark else ""
        raise ValueError(f"{path}: is not valid YAML or JSON: {_printable(reason)}{place}") from None


def find(tables: dict[str, Any], names: Iterable[str]) -> tuple[str, Any]:
    """The first of the names that the table has, and its value; ("", None) if it has none."""
    return next(((name, tables[name]) for name in names if name in tables), ("", None))


def number(value: Any, path: Path, key: str) -> float:
    """A finite number. Raises ValueError."""
    try:
        found = float(value) if isinstance(value, str | int | float) else math.nan
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise ValueError(f"{path}: {key} = {shown(value)}: must be a finite number")
    return found


def whole(value: Any, path: Path, key: str, least: int = 0) -> int:
    """A whole number of at least `least`. Raises ValueError."""
    found = number(value, path, key)
    if found != int(found) or found < least:
        raise ValueError(f"{path}: {key} = {shown(value)}: must be a whole number of at least {least}")
    return int(found)


def numbers(value: Any, path: Path, key: str) -> list[float]:
    """A row of numbers: an array, an array of arrays row by row, or a table with its numbers under `data`."""
    if isinstance(value, dict):
        if "data" not in value:
            raise ValueError(f"{path}: {key}: a table without `data`; must have its numbers there")
        found = numbers(value["data"], path, f"{key}.data")
        sizes = [value[name] for name in ("rows", "cols") if name in value] or value.get("sizes", [])
        sizes = sizes if isinstance(sizes, list) else [sizes]
        if sizes and math.prod(whole(n, path, f"{key}: size") for n in sizes) != len(found):
            raise ValueError(f"{path}: {key}: {len(found)} numbers in a matrix of {' x '.join(map(shown, sizes))}")
        return found
    if not isinstance(value, list) or len(value) > MAX_NUMBERS:
        raise ValueError(f"{path}: {key} = {shown(value)}: must be an array of at most {MAX_NUMBERS} numbers")
    flat: list[Any] = []
    for entry in value:
        flat += entry if isinstance(entry, list) else [entry]
        if len(flat) > MAX_NUMBERS:
            raise ValueError(f"{path}: {key}: too many numbers; must be at most {MAX_NUMBERS}")
    return [number(entry, path, key) for entry in flat]


def shown(value: Any) -> str:
    """A value as at most 40 printable characters."""
    if isinstance(value, dict | list):
        return "a table" if isinstance(value, dict) else f"an array of {len(value)}"
    return _printable(str(value)[:41]) if len(str(value)) <= 40 else _printable(str(value)[:37]) + "..."


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text[:200])
