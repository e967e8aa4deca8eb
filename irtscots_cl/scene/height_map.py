"""A measured map of the mirror's deviation from its design: the tables [[mirror.map]].

Only scenes with such a table import this module. The file is read when the surface is first needed.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, Strict, model_validator

from irtscots_cl.scene.validation import Degrees, OffsetMm, PitchMm, bounded, checked, problem, refuse

if TYPE_CHECKING:
    from irtscots_cl.formats.height_map import HeightMap as HeightMap

PIECE_BYTES = 2**20
# What the readers say of the command line's options, by the keys of a table that say the same.
KEYS_OF_OPTIONS = {
    "--unit": "unit", "--pitch-mm": "pitch_mm", "--wavelength-nm": "wavelength_nm", "--holds": "holds",
    # a table has no key for these
    "give --number": "write one to a file by irtscots convert --number",
    "give --array": "write one to a file by irtscots convert --array",
}  # fmt: skip

_FACTOR = "a finite number within 1e6 on either side of 0"
_SCALE = bounded(ge=1e-6, le=1e6)
_WAVELENGTH = bounded(ge=1, le=1e6)
_PITCH_TEXT = "a finite number above 0, or an array [x, y] of two of them"


class HeldMap:
    """A HeightMap in memory, of a scene made in Python: compared and written by the digest of its content."""

    def __init__(self, height_map: HeightMap):
        self.height_map = height_map
        self._digest = ""

    def digest(self) -> str:
        if not self._digest:
            found, held = hashlib.blake2b(digest_size=16), self.height_map
            found.update(f"{held.heights_mm.shape} {held.pitch_mm} {held.kind} {held.centre_mm}".encode())
            found.update(held.heights_mm.tobytes())
            self._digest = found.hexdigest()
        return self._digest

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, HeldMap) and self.digest() == other.digest())

    def __hash__(self) -> int:
        return hash(self.digest())

    def toml_text(self) -> str:
        """What stands in a scene's TOML text; it names the map, and cannot be read back."""
        return f"in memory, {self.digest()}"


def _held(value: object) -> object:
    """Heights as a HeldMap; anything else as it is, to be refused."""
    if value is None or isinstance(value, (HeldMap, str)):
        return value
    from irtscots_cl.formats.height_map import HeightMap  # imported late: NumPy; whoever has such a map has imported it

    return HeldMap(value) if isinstance(value, HeightMap) else value


@checked("map")
class MirrorMap:
    """A map of heights along z that is added to the mirror's design.

    file: of any format that formats.maps.open_map reads; or heights: a formats.height_map.HeightMap, for scenes made in
    Python. The map is read in the mirror's x and y (x to the right, y up, seen from +Z), then turned over (flip),
    enlarged (scale), turned by rotation_deg anticlockwise, and moved, so that its middle is at centre_mm; without
    centre_mm, the middle that the map itself tells takes part in flip, scale and rotation. factor: on the heights.
    unit, pitch_mm, wavelength_nm, holds: what the file does not say (formats.height_map.MapOptions). outside: what is
    there where the map has no height: "refuse" more than an edge that can be extrapolated, "nearest" valid height, or
    "zero".

    Raises SceneError for a value that is not allowed.
    """

    file: Annotated[
        Annotated[str, Strict(), Field(min_length=1, max_length=4096)] | None, Field(description="the path of a map")
    ] = None
    heights: Annotated[Any, BeforeValidator(_held), Field(description="a HeightMap, in Python")] = None
    centre_mm: Annotated[OffsetMm | None, Field(description="[x, y], two finite numbers")] = None
    rotation_deg: Degrees = 0.0
    flip: Annotated[Literal["x", "y", "xy"] | None, Field(description="one of x, y, xy")] = None
    scale: Annotated[float, Strict(), _SCALE] = 1.0
    factor: Annotated[float, Strict(), Field(ge=-1e6, le=1e6, allow_inf_nan=False, description=_FACTOR)] = 1.0
    outside: Annotated[Literal["refuse", "nearest", "zero"], Field(description="one of refuse, nearest, zero")] = (
        "refuse"
    )
    unit: Annotated[
        Literal["m", "cm", "in", "mm", "um", "nm", "wave"] | None,
        Field(description="one of m, cm, in, mm, um, nm, wave"),
    ] = None
    pitch_mm: Annotated[PitchMm | None, Field(description=_PITCH_TEXT)] = None
    wavelength_nm: Annotated[
        Annotated[float, Strict(), _WAVELENGTH] | None, Field(description=_WAVELENGTH.description)
    ] = None
    holds: Annotated[Literal["surface", "wavefront"] | None, Field(description="surface or wavefront")] = None

    @model_validator(mode="after")
    def _check(self) -> MirrorMap:
        if self.heights is not None and not isinstance(self.heights, HeldMap):
            refuse(("heights",), self.heights, "be a HeightMap of irtscots_cl.formats.height_map, or `file` a path")
        if (self.file is None) == (self.heights is None):
            refuse(("file",), self.file, "be the path of a map, or heights one in Python, and not both")
        if abs(self.factor) < 1e-6:
            refuse(("factor",), self.factor, f"be {_FACTOR}; a map without effect can be left out")
        if self.pitch_mm is not None and self.scale != 1.0:
            refuse(("scale",), self.scale, "be left out where pitch_mm gives the lateral scale")
        for key in ("unit", "pitch_mm", "wavelength_nm", "holds"):
            if self.heights is not None and getattr(self, key) is not None:
                refuse((key,), getattr(self, key), "be left out: a HeightMap says it itself")
        return self

    def stamp(self) -> tuple[int, int] | None:
        """What changes with the file; None where there is none to ask."""
        try:
            found = os.stat(self.file) if self.file is not None else None
        except (OSError, ValueError):
            return None
        return None if found is None else (found.st_mtime_ns, found.st_size)

    def digest(self, number: int) -> str:
        """Of the map's content, which a path does not tell. number: of the table. Raises SceneError for no file."""
        if self.file is None:
            return str(self.heights.digest())
        found = hashlib.blake2b(digest_size=16)
        try:
            with open(self.file, "rb") as file:
                while piece := file.read(PIECE_BYTES):
                    found.update(piece)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "no file can have this name"
            raise problem(self.file, ("mirror", "map", number, "file"), f"not a readable file: {reason}") from None
        return found.hexdigest()

    def read(self, number: int) -> HeightMap:
        """The map as a surface in its own frame, with its pitch. number: of the table, for messages.

        Raises SceneError, with one line, for a file that cannot be read, or that leaves open what it must tell.
        """
        from irtscots_cl.formats.height_map import SURFACE, MapOptions
        from irtscots_cl.formats.maps import open_map

        key = ("mirror", "map", number, "file" if self.file is not None else "heights")
        if self.file is None:
            found: HeightMap = self.heights.height_map
        else:
            pitch = (self.pitch_mm, self.pitch_mm) if isinstance(self.pitch_mm, float) else self.pitch_mm
            try:
                found = open_map(Path(self.file), MapOptions(self.unit, pitch, self.wavelength_nm, self.holds))
            except ValueError as error:
                raise problem(self.file, key, _in_keys(str(error).removeprefix(f"{Path(self.file)}: "))) from None
        if found.pitch_mm is None:
            must = "tells no lateral scale: must have a pitch_mm beside it" if self.file else "has no pitch_mm"
            raise problem(self.file or "scene", key, must)
        return found.as_kind(SURFACE)


def _in_keys(text: str) -> str:
    """A reader's message with the keys of the table in the place of the command line's options."""
    for option, key in KEYS_OF_OPTIONS.items():
        text = text.replace(option, key)
    return text
