"""Checked values as TOML."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

LISTS = (
    "element",
    "polynomial",
    "part",
    "spider",
)  # fields that are arrays of tables; [[mirror.zernike]] has a form of its own


def _toml_value(value: Any) -> str:
    if isinstance(value, str):
        plain = (c if " " <= c <= "~" and c not in '"\\' else f"\\U{ord(c):08X}" for c in value)
        return '"' + "".join(plain) + '"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_toml_key(key)} = {_toml_value(v)}" for key, v in value.items()) + " }"
    if dataclasses.is_dataclass(value):
        parts = ((field.name, getattr(value, field.name)) for field in dataclasses.fields(value))
        return _toml_value({name: part for name, part in parts if part is not None})
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    return repr(value)


def _toml_key(key: object) -> str:
    return str(key) if re.fullmatch("[A-Za-z0-9_-]+", str(key)) else _toml_value(str(key))


def toml_table(path: tuple[str, ...], part: Any) -> str:
    """The fields of `part` as TOML, with plain values before tables, as TOML requires."""
    values, tables = "", ""
    for field in dataclasses.fields(part):
        value, inner = getattr(part, field.name), (*path, field.name)
        if dataclasses.is_dataclass(value) and field.name != "scatter":
            tables += f"\n[{'.'.join(inner)}]\n" + toml_table(inner, value)
        elif field.name == "scatter" and value is not None:
            tables += f'\n[{".".join(inner)}]\nmodel = "{type(value).__name__.lower()}"\n' + toml_table(inner, value)
        elif field.name == "zernike":
            for terms in value:
                key = f"{terms.ordering}_um"
                tables += f"\n[[{'.'.join(inner)}]]\nradius_mm = {_toml_value(terms.radius_mm)}\n"
                tables += f"obscuration = {_toml_value(terms.obscuration)}\n" if terms.obscuration else ""
                tables += f"{key} = {_toml_value(terms.coefficients_um)}\n"
        elif field.name in LISTS:
            for element in value:
                tables += f"\n[[{'.'.join(inner)}]]\n" + toml_table(inner, element)
        elif value is not None:
            values += f"{field.name} = {_toml_value(value)}\n"
    return values + tables
