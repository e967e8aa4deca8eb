"""The tables [camera.detector.noise] and [screen.response] of a scene file or of a file of their own."""

from __future__ import annotations

import functools
import os
from typing import Any

from pydantic import TypeAdapter, ValidationError

from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.screen_response import ScreenResponse
from irtscots_cl.scene.validation import nearest, problem, shown_word, translate

NOISE, RESPONSE = ("camera", "detector", "noise"), ("screen", "response")
FILES = ("quantum_efficiency_map", "brightness_map")  # keys whose value is a path
_adapter = functools.cache(TypeAdapter)


def checked_tables(data: dict[str, Any], source: str) -> dict[str, Any]:
    """The data of a scene file with the two tables, where it has them, replaced by checked dataclasses.

    Paths in them are relative to the folder of the file `source`. Raises SceneError.
    """
    for kind, steps in ((DetectorNoise, NOISE), (ScreenResponse, RESPONSE)):
        table = _at(data, steps)
        if table is not None:
            data = _replaced(data, steps, _checked(kind, table, source, steps))
    return data


def noise_from_file(data: dict[str, Any], source: str) -> tuple[DetectorNoise | None, ScreenResponse | None]:
    """The two tables of a file that has no others; None for one that it lacks. Raises SceneError."""
    _refuse_others(data, {"camera": {"detector": {"noise": None}}, "screen": {"response": None}}, source, ())
    noise, response = _at(data, NOISE), _at(data, RESPONSE)
    if noise is None and response is None:
        raise problem(source, (), "has no noise; must have a table [camera.detector.noise] or [screen.response]")
    return (
        None if noise is None else _checked(DetectorNoise, noise, source, NOISE),
        None if response is None else _checked(ScreenResponse, response, source, RESPONSE),
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


def _checked(kind: Any, table: object, source: str, steps: tuple[str, ...]) -> Any:
    if not isinstance(table, dict):
        raise problem(source, steps, f"must be a table [{'.'.join(steps)}]", table)
    try:
        found = _adapter(kind).validate_python(table)
    except ValidationError as error:
        raise translate(error, kind, source, steps) from None
    for key in FILES:
        if getattr(found, key, None) is not None:  # frozen: made anew, with the path as seen from where we are
            table = {**table, key: os.path.join(os.path.dirname(source), getattr(found, key))}
            found = _adapter(kind).validate_python(table)
    return found
