"""Error source: a map of heights that the mirror has in the test and not otherwise, known only roughly.

Such as what its support or its weight prints through. The map is a table [[mirror.map]] of the scene; it stays with the
mount when the mirror is turned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.calibration.jacobian import design_centroids
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.model import Scene


@dataclass(frozen=True)
class MountedMap:
    """value: factor on the heights of a table. number: of the table, from 1."""

    number: int
    table: MirrorMap = field(repr=False)
    unit: str = "times"
    usual: float = 1.0
    kind: Kind = Kind.PARAMETER

    @property
    def name(self) -> str:
        return f"map.{self.number}"

    @property
    def text(self) -> str:
        return f"factor on the heights of the scene's [[mirror.map]] number {self.number}, which stay with the mount"

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places, in proportion to those at 1."""
        return value * design.once(self.name, lambda: self._changes_at_1(design))

    def _changes_at_1(self, design: MeasuredDesign) -> FloatArray:
        there = mapped(design.setup.scene, [self.table])
        return design_centroids(there, design.setup, design.seen.pixels) - design.places_mm


def mapped(scene: Scene, tables: Sequence[MirrorMap]) -> Scene:
    """A scene with these maps on its mirror, and no others."""
    return replace(scene, mirror=replace(scene.mirror, map=tuple(tables)))


def known_maps(maps: Sequence[MirrorMap]) -> dict[str, MountedMap]:
    """Of all tables, by name."""
    found = [MountedMap(k + 1, table) for k, table in enumerate(maps)]
    return {one.name: one for one in found}
