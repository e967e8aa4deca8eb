"""Tables of a scene file that few scenes have: each is checked by a module that only such scenes import."""

from __future__ import annotations

import functools
import os
from importlib import import_module
from typing import Any

from pydantic import TypeAdapter, ValidationError

from irtscots_cl.scene.validation import nearest, problem, shown_word, translate

NOISE, RESPONSE = ("camera", "detector", "noise"), ("screen", "response")
INTRINSICS = ("camera", "intrinsics")
KINDS = {  # path of keys -> (module of irtscots_cl.scene, its checked dataclass)
    NOISE: ("detector_noise", "DetectorNoise"),
    RESPONSE: ("screen_response", "ScreenResponse"),
    INTRINSICS: ("camera_intrinsics", "Intrinsics"),
    ("screen", "shape"): ("screen_shape", "ScreenShape"),
    ("screen", "cover_glass"): ("screen_shape", "CoverGlass"),
    ("screen", "lines"): ("screen_shape", "ScanLines"),
    ("mirror", "asphere"): ("asphere", "Asphere"),
    ("mirror", "outline"): ("outline", "Outline"),
    ("calibration",): ("calibration_known", "Calibration"),
    ("budget",): ("error_sources", "Budget"),
}
LISTS: dict[tuple[str, ...], tuple[str, str]] = {  # the same for arrays of tables
    ("mirror", "polynomial"): ("polynomial", "Polynomial"),
    ("mirror", "map"): ("height_map", "MirrorMap"),
}
FILES = ("quantum_efficiency_map", "brightness_map", "file", "calibrated", "stray_light")  # keys whose value is a path
READ_LATER = ("file", "calibrated", "stray_light")  # perhaps elsewhere: by a worker, or when a run is resumed
_adapter = functools.cache(TypeAdapter)


def _kind(steps: tuple[str, ...]) -> Any:
    module, name = (KINDS | LISTS)[steps]
    return getattr(import_module(f"irtscots_cl.scene.{module}"), name)


def checked_tables(data: dict[str, Any], source: str) -> dict[str, Any]:
    """The data of a scene file with the tables of KINDS and LISTS, where it has them, replaced by checked dataclasses.

    Paths in them are relative to the folder of the file `source`. Raises SceneError.
    """
    for steps in KINDS:
        table = _at(data, steps)
        if steps == INTRINSICS and isinstance(table, dict) and "file" in table:
            from irtscots_cl.scene.camera_file import with_camera_file  # imported late: few scenes name such a file

            table = with_camera_file(table, source, steps, _at(data, ("camera", "detector", "pixels")))
        if table is not None:
            data = _replaced(data, steps, _checked(_kind(steps), table, source, steps))
    for steps in LISTS:
        tables = _at(data, steps)
        if isinstance(tables, list):
            kind = _kind(steps)
            made = tuple(_checked(kind, table, source, (*steps, k)) for k, table in enumerate(tables))
            data = _replaced(data, steps, made)
    return data


def noise_from_file(data: dict[str, Any], source: str) -> tuple[Any, Any]:
    """The DetectorNoise and the ScreenResponse of a file without other tables; None for one that it lacks.

    Raises SceneError.
    """
    _refuse_others(data, {"camera": {"detector": {"noise": None}}, "screen": {"response": None}}, source, ())
    noise, response = _at(data, NOISE), _at(data, RESPONSE)
    if noise is None and response is None:
        raise problem(source, (), "has no noise; must have a table [camera.detector.noise] or [screen.response]")
    return (
        None if noise is None else _checked(_kind(NOISE), noise, source, NOISE),
        None if response is None else _checked(_kind(RESPONSE), response, source, RESPONSE),
    )


def _at(data: Any, steps: tuple[str, ...]) -> Any:
    """What lies at a path of keys, or None."""
    for step in steps:
        data = data.get(step) if isinstance(data, dict) else None
    return data


def _replaced(data: dict[str, Any], steps: tuple[str, ...], value: object) -> dict[str, Any]:
    """A copy of nested tables with another value at a path of keys."""
    first, *others = steps
    return {**data, first: _replaced(data[first], tuple(others), value) if others else value}


def _refuse_others(data: dict[str, Any], allowed: dict[str, Any], source: str, steps: tuple[str, ...]) -> None:
    """Raise SceneError for keys on the way to the two tables that lead elsewhere."""
    for key, value in data.items():
        if key not in allowed:
            raise problem(source, (*steps, key), f"unknown key; {nearest(shown_word(key), allowed)}")
        if allowed[key] is not None:
            if not isinstance(value, dict):
                raise problem(source, (*steps, key), f"must be a table [{'.'.join((*steps, key))}]", value)
            _refuse_others(value, allowed[key], source, (*steps, key))


def _checked(kind: Any, table: object, source: str, steps: tuple[Any, ...]) -> Any:
    if not isinstance(table, dict):
        named = f"[{'.'.join(step for step in steps if isinstance(step, str))}]"
        raise problem(source, steps, f"must be a table {f'[{named}]' if steps[:-1] in LISTS else named}", table)
    try:
        found = _adapter(kind).validate_python(table)
    except ValidationError as error:
        raise translate(error, kind, source, steps) from None
    for key in FILES:
        if getattr(found, key, None) is not None:  # frozen: made anew, with the path as seen from where we are
            path = os.path.join(os.path.dirname(source), getattr(found, key))
            table = {**table, key: os.path.abspath(path) if key in READ_LATER else path}
            found = _adapter(kind).validate_python(table)
    return found
