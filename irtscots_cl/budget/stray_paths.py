"""Error sources: ghosts and scattered light as `irtscots paths` traced them, times a factor.

Light of a pixel that is r times its direct light, with its centroid at s, moves the centroid c of the direct light by
D = r (s - c) / (1 + r). A factor f on that light makes f r of r, so that D becomes f (1 + r) D / (1 + f r), whatever
the shape of its light curve: of a centroid of all lines exactly. A centroid of a window of lines has less of light that
comes from beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import distance_transform_edt

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.procedure import Procedure
from irtscots_cl.budget.sensitivity import NM
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.imaging.stray_files import FILE, MAKE, StrayMaps, read_stray_maps
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import problem

MOST_WITHOUT = 0.1  # of the design's pixels, that have no value in a file


@dataclass(frozen=True)
class StrayPaths:
    """value: factor on the light of one kind of paths."""

    light: str
    name: str
    text: str
    unit: str = "times"
    usual: float = 1.0
    kind: Kind = Kind.CONSTANT

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places."""
        change, of_direct = _chosen(design, self.light)
        return scaled(change[0], of_direct, value)


SOURCES = {
    source.name: source
    for source in (
        StrayPaths("ghost", "stray.ghosts", "factor on the ghosts of the file of stray light"),
        StrayPaths("scatter", "stray.scatter", "factor on the scattered light of the file of stray light"),
    )
}


def scaled(change_mm: FloatArray, of_direct: FloatArray, factor: float) -> FloatArray:
    """Changes [..., n] by a factor on the light that makes change_mm and is of_direct [n] of the direct light."""
    found: FloatArray = factor * (1 + of_direct) / (1 + factor * of_direct) * change_mm
    return found


def stray_source(name: str, scene: Scene, stray: Mapping[str, StrayMaps] | None) -> StrayPaths:
    """The source of a name of SOURCES. stray: maps of a budget's file, by kind; None without one.

    Raises SceneError where there is no file, or none of that light in it.
    """
    key, source = ("budget", "sources", name), SOURCES[name]
    if stray is None:
        raise problem(scene.name, key, f"needs budget.stray_light: the file {FILE} that `{MAKE}` writes")
    if source.light not in stray:
        has = " and ".join(stray) or "neither ghosts nor scattered light"
        raise problem(scene.name, key, f"must be left out: the file of budget.stray_light has {has} alone")
    return source


def known_stray(stray: Mapping[str, StrayMaps]) -> dict[str, StrayPaths]:
    """Sources by name of the kinds of light that a budget's file has."""
    return {name: source for name, source in SOURCES.items() if source.light in stray}


def with_stray(design: MeasuredDesign, budget: Budget) -> MeasuredDesign:
    """A design with the maps of its budget's file.

    Raises SceneError for a file that is none of this scene's light or has values for too few pixels, or for fringes.
    """
    scene, key, path = design.setup.scene, ("budget", "stray_light"), str(budget.stray_light)
    if budget.fringes is not None:
        text = "must be left out with budget.periods: its maps are of centroids of single lines, not of phases"
        raise problem(scene.name, key, text)
    try:
        found = replace(design, stray=read_stray_maps(Path(path), scene))
    except ValueError as error:
        raise problem(scene.name, key, str(error)) from None
    for kind in found.stray or ():
        count = without_value(found, kind)
        if count > MOST_WITHOUT * design.count:
            text = f"{path}: {kind}: {count} of the design's {design.count} pixels have no value; at most a tenth may"
            raise problem(scene.name, key, f"{text}: rays are too few, or this light makes light curves unusable")
    return found


def without_value(design: MeasuredDesign, kind: str) -> int:
    """How many of the design's pixels have no value in the file: they get that of the nearest one that has."""
    return int(np.count_nonzero(_none(_of_file(design, kind))[design.seen.mask]))


@dataclass(frozen=True)
class RayNoise:
    """Error of a source's height map by the rays of its file. nm: rms [4], terms removed as LEFT_AFTER; NaN where the
    file has one replicate alone. own_nm: [4] of the map itself. without_value: of so many of the design's pixels."""

    name: str
    nm: FloatArray
    own_nm: FloatArray
    without_value: int
    pixels: int


def ray_noise(procedure: Procedure, source: StrayPaths, factor: float) -> RayNoise:
    """By the jackknife: the heights of the maps with one replicate of the rays left out in turn, as the procedure
    leaves them."""
    design = procedure.design
    change, ratio = _chosen(design, source.light)
    heights = procedure.of_parameter(source, design.response.heights_mm(scaled(change, ratio, factor)))
    own, left_out, count = heights[:1], heights[1:], len(heights) - 1
    squares = design.response.left(left_out - left_out.mean(0)) ** 2
    nm = NM * np.sqrt((count - 1) / count * squares.sum(0)) if count > 1 else np.full(squares.shape[1], np.nan)
    own_nm = NM * design.response.left(own)[0]
    return RayNoise(source.name, nm, own_nm, without_value(design, source.light), design.count)


def _of_file(design: MeasuredDesign, kind: str) -> FloatArray:
    """[1 + replicates, 3, rows, columns] changes and share of the direct light, on the design's grid of pixels."""
    assert design.stray is not None
    maps, seen = design.stray[kind], design.seen
    at = np.ix_(seen.row.astype(int), seen.column.astype(int))
    share = np.broadcast_to(maps.of_direct[at], (len(maps.change_mm), 1, *seen.mask.shape))
    return np.concatenate([maps.change_mm[..., at[0], at[1]], share], 1)


def _none(values: FloatArray) -> BoolArray:
    """Pixels [rows, columns] without a value."""
    found: BoolArray = np.isnan(values).any((0, 1))
    return found


def _chosen(design: MeasuredDesign, kind: str) -> tuple[FloatArray, FloatArray]:
    """Changes [1 + replicates, 2, n] and share of the direct light [n] of the design's pixels, all with a value."""

    def filled() -> FloatArray:
        values, mask = _of_file(design, kind), design.seen.mask
        none = ~mask | _none(values)
        row, column = distance_transform_edt(none, return_distances=False, return_indices=True)
        found: FloatArray = values[..., row, column][..., mask]
        return found

    found = design.once(f"stray {kind}", filled)
    return found[:, :2], found[0, 2]
