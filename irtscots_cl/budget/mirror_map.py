"""Error source: a map of heights that the mirror has in the test and not otherwise, known only roughly.

Such as what its support or its weight prints through. The map is a table [[mirror.map]] of the scene; it stays with the
mount when the mirror is turned.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.calibration.jacobian import design_centroids
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.model import Scene

_NAME = re.compile(r"map\.([1-9][0-9]{0,2})")


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
        if self.name not in design.derivatives:
            there = mapped(design.setup.scene, [self.table])
            design.derivatives[self.name] = design_centroids(there, design.setup, design.seen.pixels) - design.places_mm
        return value * design.derivatives[self.name]


def mapped(scene: Scene, tables: Sequence[MirrorMap]) -> Scene:
    """A scene with these maps on its mirror, and no others."""
    return replace(scene, mirror=replace(scene.mirror, map=tuple(tables)))


def mounted_map(name: str, maps: Sequence[MirrorMap]) -> MountedMap | None:
    """The source of a name such as map.1, of these tables; None for another name, or where there is no such table."""
    found = _NAME.fullmatch(name)
    number = int(found[1]) if found else 0
    return MountedMap(number, maps[number - 1]) if 0 < number <= len(maps) else None


def known_maps(maps: Sequence[MirrorMap]) -> dict[str, MountedMap]:
    """Of all tables, by name."""
    found = [MountedMap(k + 1, table) for k, table in enumerate(maps)]
    return {one.name: one for one in found}
