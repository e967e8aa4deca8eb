"""What is known of a set-up before its images are seen: the table [calibration.known].

Only scenes with that table import this module. A key is the name of an unknown, such as "camera.x_mm" (the names are
those of irtscots_cl/calibration), or a distance, "camera to screen". Its value is a standard deviation, or a table.
"""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, Strict, model_validator

from irtscots_cl.scene.validation import OptionalMm, bounded, checked, refuse

PLACES = ("camera", "screen", "mirror")  # between which distances may be known
DISTANCE = re.compile(rf"({'|'.join(PLACES)}) to ({'|'.join(PLACES)})")
MAX_SOURCE = 200
_SIGMA = bounded(gt=0, le=1e6)


@checked("known")
class Knowledge:
    """Standard deviation of what is known, in the unit of the name; of a distance in mm.

    mm: of a distance, the measured one; None: the scene's own. source: where it comes from, in words.
    Raises SceneError for a value that is not allowed.
    """

    sigma: Annotated[float, Strict(), _SIGMA]
    mm: OptionalMm = None
    source: Annotated[
        str, Strict(), Field(max_length=MAX_SOURCE, description=f"a text of at most {MAX_SOURCE} characters")
    ] = ""


def flat_names(table: Any, keys: tuple[str, ...], of_number: str) -> Any:
    """The table with one level of keys: TOML reads camera.x_mm without quotes as a table in a table.

    keys: of a value that is a table. of_number: the key that a plain number stands for.
    """
    if not isinstance(table, dict):
        return table
    found: dict[Any, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict) and not value.keys() & set(keys):
            found |= {f"{key}.{inner}": part for inner, part in flat_names(value, keys, of_number).items()}
        elif isinstance(value, float | int):
            found[key] = {of_number: value}
        elif isinstance(value, dict) or hasattr(value, of_number):
            found[key] = value
        else:
            refuse((key,), value, f"be a number, or a table {{ {', '.join(keys)} }}")
    return found


def _flat(table: Any) -> Any:
    return flat_names(table, ("sigma", "mm", "source"), "sigma")


@checked("calibration")
class Calibration:
    """known: name -> Knowledge. Raises SceneError for a value that is not allowed."""

    known: Annotated[
        dict[str, Knowledge],
        BeforeValidator(_flat),
        Field(description='a table of names with standard deviations: "camera.x_mm" = 0.5, or { sigma, mm, source }'),
    ] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> Calibration:
        for name, known in self.known.items():
            ends = distance_ends(name)
            if ends is not None and ends[0] == ends[1]:
                refuse(("known", name), known.sigma, "be between two different ones of camera, screen, mirror")
            if ends is None and known.mm is not None:
                must = 'be left out: only distances such as "camera to screen" have it'
                refuse(("known", name, "mm"), known.mm, must)
        return self

    def __hash__(self) -> int:  # a dict has none
        return hash(frozenset(self.known.items()))


def distance_ends(name: str) -> tuple[str, str] | None:
    """The two places of a distance's name, "camera to screen"; None for any other name."""
    found = DISTANCE.fullmatch(name)
    return (found[1], found[2]) if found else None
