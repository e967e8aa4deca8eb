"""Scatter models from tables of a scene file."""

from __future__ import annotations

import functools
from typing import Any

from pydantic import TypeAdapter, ValidationError

from irtscots_cl.scene.scatter.lobe import ScatterModel
from irtscots_cl.scene.scatter.models import ABg, Harvey, Lambertian
from irtscots_cl.scene.validation import nearest, problem, shown_word, translate

# --- the TOML form ------------------------------------------------------------------------------------------
MODELS: dict[str, Any] = {"lambertian": Lambertian, "harvey": Harvey, "abg": ABg}
_adapter = functools.cache(TypeAdapter)


def scatter_from_table(table: dict[str, Any], source: str, steps: tuple[Any, ...] = ()) -> ScatterModel:
    """The model of `{ model = "harvey", l = 0.01, s = -1.5, tis = 0.0025 }`; raises SceneError.

    The message names `source` as the file; `steps` is the path of keys from the file's top level to the table.
    """
    names = ", ".join(MODELS)
    if not isinstance(table, dict):
        raise problem(source, steps, f"must be a table with the key model, one of {names}", table)
    if "model" not in table:
        known = ["model", *(key for kind in MODELS.values() for key in kind.__pydantic_fields__)]
        for key in table:
            if key not in known:  # a misspelt model
                raise problem(source, (*steps, key), f"unknown key; {nearest(shown_word(key), known[:1])}")
        raise problem(source, (*steps, "model"), f"missing; needs one of {names}")
    name = table["model"]
    if not isinstance(name, str) or name not in MODELS:
        raise problem(source, (*steps, "model"), f"unknown model; {nearest(shown_word(name), MODELS)}", name)
    kind = MODELS[name]
    adapter: TypeAdapter[ScatterModel] = _adapter(kind)
    try:
        return adapter.validate_python({key: value for key, value in table.items() if key != "model"})
    except ValidationError as error:
        raise translate(error, kind, source, steps) from None
