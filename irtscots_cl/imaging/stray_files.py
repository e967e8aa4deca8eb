"""stray-light.h5: what ghosts and scattered light do to each pixel of the detector, as `irtscots paths --out` says.

A kind of light has a group of its name, "ghost" or "scatter", with maps as the scene's `camera.detector.orientation`
says. The file holds the scene that was traced: it tells nothing of another one.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from irtscots_cl.formats.hdf5 import GroupReader, is_hdf5, opened, write_dataset
from irtscots_cl.imaging.orientation import stored, stored_shape, upright
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.statistics import jackknife_error
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import parse_scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.system.atomic_files import replacing

FILE = "stray-light.h5"
CONTENT = "stray light of irtscots paths, version 1"  # the file's attribute `content`
KINDS = ("ghost", "scatter")
MAKE = "irtscots paths SCENE --out DIR"  # the command that makes one
MOST_REPLICATES = 10**4


@dataclass(frozen=True)
class StrayMaps:
    """Light of one kind on the upright grid [rows, columns]; NaN where a pixel has no value.

    change_mm: [1 + replicates, 2, rows, columns] by how much it changes the place (u, v) that a pixel's light comes
    from, the centroid of all lines; then the same with one replicate of the rays left out in turn. of_direct: flux over
    that of the direct light, of_direct_error its standard error. height_nm, height_error_nm: what it adds to the
    measured height, piston and tilt removed, with its standard error. facts: numbers of the whole, by name.
    """

    change_mm: FloatArray = field(repr=False)
    of_direct: FloatArray = field(repr=False)
    of_direct_error: FloatArray = field(repr=False)
    height_nm: FloatArray = field(repr=False)
    height_error_nm: FloatArray = field(repr=False)
    facts: dict[str, float] = field(default_factory=dict)


def write_stray_maps(path: Path, maps: Mapping[str, StrayMaps], scene: Scene, attributes: Mapping[str, Any]) -> None:
    """Write the maps of each kind of KINDS that there is. attributes: of the file, beside scene and orientation."""
    orientation = scene.camera.detector.orientation
    own = {"content": CONTENT, "scene": scene.to_toml(), "orientation": orientation}
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs.update({**attributes, **own})
        for kind, found in maps.items():
            for name, values, unit in _datasets(found):
                write_dataset(file, f"{kind}/{name}", stored(values, orientation), unit)
            file[kind].attrs.update(found.facts)


def _datasets(maps: StrayMaps) -> Iterator[tuple[str, FloatArray, str]]:
    """Name, values and unit of each dataset."""
    for axis, change in zip("xy", maps.change_mm.swapaxes(0, 1), strict=True):
        yield f"change/{axis}_mm", change[0], "mm"
        yield f"change/{axis}_standard_error_mm", jackknife_error(change), "mm"
        yield f"change/{axis}_left_out_mm", change[1:], "mm"
    yield "of_direct", maps.of_direct, "1"
    yield "of_direct_standard_error", maps.of_direct_error, "1"
    yield "height_nm", maps.height_nm, "nm"
    yield "height_standard_error_nm", maps.height_error_nm, "nm"


def read_stray_maps(path: Path, scene: Scene) -> dict[str, StrayMaps]:
    """The maps of a file, by kind. scene: whose light they must be of.

    Raises ValueError, with one line that names the file, for one that is no such file, is broken, or is of another
    scene: deviations of the mirror, noise, the screen's response and radiance, and the tables [calibration] and
    [budget] may differ.
    """
    wrong = f"{path}: holds no maps of stray light; must be a {FILE} of `{MAKE}`"
    if path.is_file() and not is_hdf5(path):
        raise ValueError(wrong)
    with opened(path) as file:
        if file.attrs.get("content") != CONTENT:
            raise ValueError(wrong)
        try:
            traced = parse_scene(str(file.attrs.get("scene", "")), f"{path}: scene")
        except SceneError as error:
            raise ValueError(str(error)) from None
        if differs := _first_difference(traced, scene):
            key, theirs, ours = differs
            raise ValueError(
                f"{path}: is of a scene with {key} = {_shown(theirs)}, here it is {_shown(ours)}; make it again for "
                f"this scene: `{MAKE}`"
            )
        orientation = traced.camera.detector.orientation
        shape = stored_shape(scene.camera.detector.pixels[::-1], orientation)
        kinds = [kind for kind in KINDS if kind in file]
        return {kind: _maps(GroupReader(file, path, kind), shape, orientation) for kind in kinds}


def _maps(group: GroupReader, shape: tuple[int, int], orientation: str) -> StrayMaps:
    def read(name: str, *first: int) -> FloatArray:
        data = group.dataset(name)
        if data.shape != (*first, *shape) or data.dtype.kind != "f":
            found = f"of shape {list(data.shape or ())} and type {data.dtype}"
            raise group.problem(name, f"{found}; must be numbers {[*first, *shape]}")
        values: FloatArray = upright(np.asarray(data[()], float), orientation)
        if np.isinf(values).any():
            raise group.problem(name, "holds an infinite value")
        return values

    count = (group.dataset("change/x_left_out_mm").shape or (0,))[0]
    if not 1 <= count <= MOST_REPLICATES:
        raise group.problem("change/x_left_out_mm", f"of {count} replicates; must be of 1 to {MOST_REPLICATES}")
    change = [
        np.concatenate([read(f"change/{axis}_mm")[None], read(f"change/{axis}_left_out_mm", count)]) for axis in "xy"
    ]
    share, share_error = read("of_direct"), read("of_direct_standard_error")
    height, height_error = read("height_nm"), read("height_standard_error_nm")
    return StrayMaps(np.stack(change, 1), share, share_error, height, height_error)


def _first_difference(one: Scene, other: Scene) -> tuple[str, Any, Any] | None:
    """The first key in which the light of two scenes differs, with both values; None where there is no value."""
    flat = [dict(_flat(tomllib.loads(_light_of(scene).to_toml()))) for scene in (one, other)]
    for key in {**flat[0], **flat[1]}:
        values = tuple(table.get(key) for table in flat)
        if values[0] != values[1]:
            return key, values[0], values[1]
    return None


def _light_of(scene: Scene) -> Scene:
    """A scene without what leaves the shares of its light, and the places that it comes from, as they are."""
    detector = replace(scene.camera.detector, noise=None, orientation="upright")
    screen, camera = replace(scene.screen, response=None, radiance=1.0), replace(scene.camera, detector=detector)
    return replace(scene.nominal(), name="scene", screen=screen, camera=camera, calibration=None, budget=None)


def _flat(table: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """(key path, value) of all plain values of nested tables and arrays of tables."""
    if isinstance(table, dict):
        for key, value in table.items():
            yield from _flat(value, f"{path}.{key}" if path else key)
    elif isinstance(table, list) and any(isinstance(entry, dict) for entry in table):
        for k, entry in enumerate(table):
            yield from _flat(entry, f"{path}[{k}]")
    else:
        yield path, table


def _shown(value: Any) -> str:
    return "none" if value is None else str(value)[:60]
