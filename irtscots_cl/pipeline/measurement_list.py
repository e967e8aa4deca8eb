"""The measurements of a calibration: files on the command line, or a TOML list that says what differed between them.

[[measurement]]
images = "before.h5"

[[measurement]]
images = "turned.h5"
mirror_turn_deg = 120.0
own = ["mirror.tilt_x_rad", "mirror.tilt_y_rad"]
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, Strict, TypeAdapter, ValidationError

from irtscots_cl.calibration.parameters import moved, parameter
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import Degrees, SceneError, array_of, bounded, checked, nearest, problem, translate

MAX_MEASUREMENTS = 100
_Text = Annotated[str, Strict(), Field(min_length=1, max_length=4096, description="a text")]
_Amount = Annotated[float, Strict(), bounded(ge=-1e6, le=1e6)]


@checked("measurement")
class Entry:
    """One measurement.

    images: its file, relative to the list. mirror_turn_deg: by which the mirror was turned about its axis, from x
    towards y. moved: known changes by the unknowns' names. own: unknowns that have a further value of their own here.
    reference: a scene whose mirror, with its figure, was in the test. name: for messages.
    """

    images: _Text
    mirror_turn_deg: Degrees = 0.0
    moved: Annotated[dict[str, _Amount], Field(description="a table of unknowns with known changes")] = Field(
        default_factory=dict
    )
    own: Annotated[tuple[_Text, ...], *array_of("an array of names of unknowns")] = ()
    reference: Annotated[_Text | None, Field(description="a preset or the path of a scene file")] = None
    name: Annotated[_Text | None, Field(description="a text")] = None


@dataclass(frozen=True)
class Planned:
    """A measurement before its images are read: its file, its scene, and the further arguments of from_file."""

    path: Path
    scene: Scene
    kind: dict[str, Any]


def planned(
    paths: Sequence[Path], scene: Scene, turns_deg: Sequence[float] = (), *, known: bool = False
) -> list[Planned]:
    """The measurements of files, or of one list of them in TOML.

    turns_deg: of the mirror, one for each file. known: the scene's mirror with its figure is the truth. Raises
    ValueError or SceneError for what cannot be.
    """
    if len(paths) == 1 and paths[0].suffix == ".toml":
        if turns_deg:
            raise ValueError("--mirror-turn: must be left out with a list of measurements: it says mirror_turn_deg")
        return _listed(paths[0], scene, known)
    if turns_deg and len(turns_deg) != len(paths):
        raise ValueError(f"--mirror-turn = {len(turns_deg)} angles: must be one for each of the {len(paths)} files")
    found = []
    for k, path in enumerate(paths):
        turn = math.radians(turns_deg[k]) if turns_deg else 0.0
        name = path.stem if len(paths) == 1 else f"{path.stem} ({k + 1})"
        believed = scene if known else scene.nominal()
        found.append(Planned(path, believed, {"name": name, "turn_rad": turn, "knows_mirror": known}))
    return found


def _listed(path: Path, scene: Scene, known: bool) -> list[Planned]:
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: is not valid TOML: {error}") from None
    source = str(path)
    for key in data:
        if key != "measurement":
            raise problem(source, (key,), f"unknown key; {nearest(key, ['measurement'])}")
    entries = data.get("measurement")
    if not isinstance(entries, list) or not 1 <= len(entries) <= MAX_MEASUREMENTS:
        raise problem(source, ("measurement",), f"must be 1 to {MAX_MEASUREMENTS} tables [[measurement]]")
    return [_entry(entry, k, path, scene, known) for k, entry in enumerate(entries)]


def _entry(table: Any, k: int, path: Path, scene: Scene, known: bool) -> Planned:
    where = ("measurement", f"{k + 1}")
    if not isinstance(table, dict):
        raise problem(str(path), where, "must be a table [[measurement]]", table)
    try:
        entry: Entry = TypeAdapter(Entry).validate_python(table)
    except ValidationError as error:
        raise translate(error, Entry, str(path), where) from None
    believed, knows = (scene if known else scene.nominal()), known
    if entry.reference is not None:
        believed, knows = replace(scene, mirror=_reference(entry.reference, path).mirror), True
    try:
        for name in entry.own:
            parameter(name, scene)
        believed = moved(believed, entry.moved)
    except SceneError:
        raise
    except ValueError as error:
        raise problem(str(path), where, str(error)) from None
    name = entry.name or f"{Path(entry.images).stem} ({k + 1})"
    kind = {"name": name, "turn_rad": math.radians(entry.mirror_turn_deg), "knows_mirror": knows, "own": entry.own}
    return Planned(path.parent / entry.images, believed, kind)


def _reference(name: str, path: Path) -> Scene:
    """The scene of a preset, or of a file beside the list."""
    beside = path.parent / name
    return load_scene(str(beside) if beside.is_file() else name)
