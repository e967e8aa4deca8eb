"""Checked values: each range and its text in one place, and a one-line error for each invalid value.

The error is a `SceneError` that names the source, the key, the value and the allowed values. Only the standard library
and pydantic are imported, so that the program starts fast.
"""

from __future__ import annotations

import functools
import math
import re
import typing
from collections.abc import Callable
from typing import Annotated, Any

from pydantic import AfterValidator, ConfigDict, Field, Strict, ValidationError, WrapValidator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

MAX_LENGTH_MM = 1e12  # as a radius it means a plane mirror: 0.1 nm of sag over a metre
MIN_LENGTH_MM = 1 / MAX_LENGTH_MM  # with it no inverse of a length overflows, not even in single precision
MAX_PIXELS_PER_AXIS = 16384
SHOWN_CHARACTERS = 40
LISTS = ("element", "zernike", "polynomial", "part", "spider")  # keys of arrays of tables


class SceneError(ValueError):
    """An invalid scene. The message is one printable line `FILE: key.path = VALUE: what is allowed`."""


# --- one definition of each range and of its text -----------------------------------------------------------


def bounded(**bounds: float) -> Any:
    """A range of floats, given as pydantic's gt, ge, le, with its text for error messages."""
    words = {"gt": "above", "ge": "at least", "le": "at most", "lt": "below"}
    text = "a finite number " + " and ".join(f"{words[kind]} {limit:g}" for kind, limit in bounds.items())
    limits: dict[str, Any] = dict(bounds)
    return Field(allow_inf_nan=False, description=text, **limits)


def _whole(value: object, check: Any) -> object:
    """Accept a list (TOML's array) or a tuple, but no set. An error reports the whole value, not one element."""
    try:
        return check(tuple(value) if isinstance(value, list) else value)
    except ValidationError:
        raise PydanticCustomError("array", "array") from None


def _not_zero(value: float) -> float:
    if abs(value) < MIN_LENGTH_MM:
        raise PydanticCustomError("zero", "zero")
    return value


def _mirror_radius(value: float) -> float:
    if not (MIN_LENGTH_MM <= abs(value) <= MAX_LENGTH_MM or value == math.inf):  # NaN fails too
        raise PydanticCustomError("radius", "radius")
    return value


_ARRAY = (Strict(), WrapValidator(_whole))


def array_of(text: str) -> tuple[Any, ...]:
    """Annotations of a tuple that a file gives as an array, with its text for error messages."""
    return (*_ARRAY, Field(description=text))


_Coordinate = Annotated[float, Strict(), bounded(ge=-MAX_LENGTH_MM, le=MAX_LENGTH_MM)]
_Count = Annotated[int, Strict(), Field(ge=1, le=MAX_PIXELS_PER_AXIS)]
_GRID_TEXT = f"[columns, rows], two integers from 1 to {MAX_PIXELS_PER_AXIS}"
_NAME_TEXT = "1 to 64 characters of A-Z a-z 0-9 . _ - without a leading dot"

_POSITIVE = bounded(ge=MIN_LENGTH_MM, le=MAX_LENGTH_MM)
PositiveMm = Annotated[float, Strict(), _POSITIVE]
OptionalMm = Annotated[PositiveMm | None, Field(description=_POSITIVE.description)]
_PITCH = f"{_POSITIVE.description}, or an array [x, y] of two of them"
PitchMm = Annotated[PositiveMm | tuple[PositiveMm, PositiveMm], WrapValidator(_whole), Field(description=_PITCH)]
Degrees = Annotated[float, Strict(), bounded(ge=-360, le=360)]
NonNegativeMm = Annotated[float, Strict(), bounded(ge=0, le=MAX_LENGTH_MM)]
PointMm = Annotated[
    tuple[_Coordinate, _Coordinate, _Coordinate],
    *_ARRAY,
    Field(description=f"[x, y, z], three finite numbers within {MAX_LENGTH_MM:g}"),
]
OffsetMm = Annotated[
    tuple[_Coordinate, _Coordinate],
    *_ARRAY,
    Field(description=f"[x, y], two finite numbers within {MAX_LENGTH_MM:g}"),
]
PixelGrid = Annotated[tuple[_Count, _Count], *_ARRAY, Field(description=_GRID_TEXT)]
Fraction = Annotated[float, Strict(), bounded(gt=0, le=1)]
_SIGNED = f"a number from {MIN_LENGTH_MM:g} to {MAX_LENGTH_MM:g} on either side of 0"
OptionalSignedMm = Annotated[
    Annotated[float, Strict(), bounded(ge=-MAX_LENGTH_MM, le=MAX_LENGTH_MM), AfterValidator(_not_zero)] | None,
    Field(description=_SIGNED),
]
_CURVED = f"{_SIGNED}, below 0 for a convex mirror, or inf for a flat one"
MirrorRadiusMm = Annotated[float, Strict(), AfterValidator(_mirror_radius), Field(description=_CURVED)]
_PERCENT = bounded(ge=0, le=1)
OptionalFraction = Annotated[Annotated[float, Strict(), _PERCENT] | None, Field(description=_PERCENT.description)]
_INDEX = bounded(ge=1, le=10)
OptionalIndex = Annotated[Annotated[float, Strict(), _INDEX] | None, Field(description=_INDEX.description)]
OptionalSizeMm = Annotated[
    Annotated[tuple[PositiveMm, PositiveMm], *_ARRAY] | None,
    Field(description=f"[width, height], each {_POSITIVE.description}"),
]
Radiance = Annotated[float, Strict(), bounded(gt=0, le=1e12)]
Conic = Annotated[float, Strict(), bounded(ge=-1e6, le=1e6)]
# Errors of an index or a coefficient are reported one step below the field; see _allowed.
_COEFFICIENT_RANGE = bounded(ge=-1e6, le=1e6)
Coefficients = Annotated[
    dict[Annotated[int, Strict()], Annotated[float, Strict(), _COEFFICIENT_RANGE]],
    Field(description="a table { index = micrometres } of at least one term", min_length=1),
]
# TOML's integers have 64 bits and a sign.
Seed = Annotated[int, Strict(), Field(ge=0, lt=2**63, description="an integer from 0 to 2^63 - 1")]
NumpyFile = Annotated[
    Annotated[str, Strict(), Field(min_length=1, max_length=4096)] | None, Field(description="the path of an NPY file")
]
SceneName = Annotated[str, Strict(), Field(pattern=r"^[A-Za-z0-9_-][A-Za-z0-9._-]{0,63}$", description=_NAME_TEXT)]


# --- one line per problem -----------------------------------------------------------------------------------


def _shown(value: object) -> str:
    """`value` as at most 40 printable characters."""
    try:
        text = repr(list(value) if isinstance(value, tuple) else value)
    except (ValueError, RecursionError):  # an integer with too many digits, or arrays nested too deeply
        text = f"<{type(value).__name__}>"
    return text if len(text) <= SHOWN_CHARACTERS else text[: SHOWN_CHARACTERS - 3] + "..."


def shown_word(step: object) -> str:
    return step if isinstance(step, str) else _shown(step)


def _key_path(steps: tuple[Any, ...]) -> str:
    """`("mirror", "zernike", 0, "noll_um", 6)` as `mirror.zernike[0].noll_um.6`."""
    path = ""
    for k, step in enumerate(steps):
        if k and steps[k - 1] in LISTS and isinstance(step, int):
            path += f"[{step}]"
        else:
            path += "." + (shown_word(step) if re.fullmatch(r"[A-Za-z0-9_-]{1,40}", shown_word(step)) else _shown(step))
    return path.removeprefix(".")


def nearest(word: str, known: typing.Iterable[str]) -> str:
    """`did you mean X?`, or the list of known words if none is similar."""
    import difflib  # imported late: only errors need it

    close = difflib.get_close_matches(word[:100], known, n=1)  # longer words only take time
    return f"did you mean {close[0]}?" if close else f"allowed: {', '.join(known)}"


def problem(source: str, steps: tuple[Any, ...], message: str, *value: object) -> SceneError:
    """The error `SOURCE: key.path = VALUE: message`. The key path and the value are optional."""
    shown_source = "".join(c if c.isprintable() else repr(c)[1:-1] for c in source)
    key = _key_path(steps) + "".join(f" = {_shown(v)}" for v in value)
    return SceneError(": ".join(part for part in (shown_source, key.removeprefix(" = "), message) if part))


def _allowed(kind: Any, steps: tuple[Any, ...]) -> tuple[Any, str]:
    """The dataclass that `steps` from `kind` lead to, and the text of the allowed values there."""
    text = "a table"
    for step in steps:
        if step in kind.__pydantic_fields__:
            owner, text = kind, kind.__pydantic_fields__[step].description
            kind = _parts.get(step, kind)
        else:  # an unknown key, an element of zernike, or an index or coefficient
            owner = kind
            text = _COEFFICIENT_RANGE.description if "coefficients_um" in steps else "a table"
    return (owner if steps else kind), text


def translate(
    error: ValidationError, kind: Any, source: str, prefix: tuple[Any, ...] = (), rename: str = ""
) -> SceneError:
    """The most useful of pydantic's errors. A misspelt key comes first, because it also makes another key missing.

    `prefix` is the path of keys from the file's top level to `kind`; `rename` is the file's name of `coefficients_um`.
    """
    misspelt = ("unexpected_keyword_argument", "unexpected_positional_argument", "invalid_key")
    rank = {**dict.fromkeys(misspelt, 0), "missing": 2}
    first = min(error.errors(include_url=False), key=lambda entry: rank.get(entry["type"], 1))
    cross = first["ctx"] if first["type"] == "cross" else {"steps": (), "value": first["input"]}
    steps = (*(step for step in first["loc"] if step != "[key]"), *cross["steps"])
    if steps and isinstance(steps[0], int) and first["type"] not in misspelt:  # a positional argument
        steps = (list(kind.__pydantic_fields__)[steps[0]], *steps[1:])
    owner, text = _allowed(kind, steps)
    path = (*prefix, *(rename if rename and step == "coefficients_um" else step for step in steps))
    if first["type"] in misspelt:
        return problem(source, path, f"unknown key; {nearest(shown_word(steps[-1]), owner.__pydantic_fields__)}")
    if first["type"] == "missing":
        return problem(source, path, f"missing; needs {text}")
    if "[key]" in first["loc"]:
        text = "an integer index"
    return problem(source, path, f"must {cross.get('must', f'be {text}')}", cross["value"])


def refuse(steps: tuple[Any, ...], value: object, must: str) -> typing.NoReturn:
    """Raise an error that no field's range can express. `steps` leads from the checked dataclass to the value."""
    raise PydanticCustomError("cross", "cross", {"steps": steps, "value": value, "must": must})


_Part = typing.TypeVar("_Part")
_parts: dict[str, Any] = {}  # key in a scene file -> its dataclass, to find the allowed values of a nested key


@typing.dataclass_transform(frozen_default=True, field_specifiers=(Field,))
def checked(key: str) -> Callable[[type[_Part]], type[_Part]]:
    """Make a class a frozen pydantic dataclass without unknown keys, whose constructor raises `SceneError`.

    `key`: its name in a scene file.
    """

    def decorate(cls: type[_Part]) -> type[_Part]:
        made = dataclass(frozen=True, config=ConfigDict(extra="forbid"))(cls)
        cls = _parts[key] = typing.cast("type[_Part]", made)
        build = cls.__init__

        @functools.wraps(build)
        def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
            try:
                build(self, *args, **kwargs)
            except ValidationError as error:
                raise translate(error, cls, cls.__name__) from None

        cls.__init__ = __init__  # type: ignore[method-assign]
        return cls

    return decorate
