"""A measured map of heights with its units, and what can be done to it without knowing where it came from.

Row order, of all maps: row 0 has the smallest y, column 0 the smallest x, as in the maps of this package (x to the
right and y up, row 0 is the lowest). The readers bring the rows of their files into this order, the writers theirs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.formats.text_numbers import comment_lines
from irtscots_cl.maths.arrays import FloatArray

SURFACE, WAVEFRONT = "surface", "wavefront"
KINDS = (SURFACE, WAVEFRONT)
WAVEFRONT_FACTOR = 2.0  # a wavefront's error over that of the surface which reflects it once, at normal incidence
UNIT_MM = {"m": 1e3, "cm": 10.0, "in": 25.4, "mm": 1.0, "um": 1e-3, "nm": 1e-6}
UNITS = (*UNIT_MM, "wave")
RESULT_QUANTITIES = ("deviation", "height", "standard-error")
FLIPS = ("x", "y", "xy")
MAX_HEIGHT_MM = 1e6
MAX_PITCH_MM = 1e6
WAVELENGTHS_NM = (1.0, 1e6)
USUAL_WAVELENGTHS_NM = (100.0, 2e4)  # of interferometers, from the ultraviolet to the CO2 laser's 10.6 um


@dataclass(frozen=True)
class CameraPlace:
    """Where a map lies in its camera's frame, in pixels: the frame's size, and the map's first pixel from the frame's
    left and top edge."""

    columns: int
    rows: int
    left: int
    top: int


@dataclass(frozen=True)
class HeightMap:
    """A map of heights.

    heights_mm: [rows, columns], rows as the module says; NaN where there is no valid height. pitch_mm: (x, y) between
    pixels, None for an unknown lateral scale. wavelength_nm: of the measurement, None if unknown. kind: "surface", or
    "wavefront" for the wavefront's error, twice the surface's. centre_mm: (x, y) of the middle of the map. origin: the
    format and file it comes from. warnings: what the file leaves open or what was taken for granted, one line each.
    intensity: [frames, rows, columns], of the same pixels, NaN where the camera's frame has none. camera: the map's
    place in the camera's frame, where the file tells it. comment: what the heights are, in lines of plain text.

    Raises ValueError, with one line, for what no map can be.
    """

    heights_mm: FloatArray
    pitch_mm: tuple[float, float] | None = None
    wavelength_nm: float | None = None
    kind: str = SURFACE
    centre_mm: tuple[float, float] = (0.0, 0.0)
    origin: str = ""
    warnings: tuple[str, ...] = ()
    intensity: NDArray[Any] | None = field(default=None, repr=False)
    camera: CameraPlace | None = None
    comment: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        heights = np.asarray(self.heights_mm, dtype=np.float64)
        object.__setattr__(self, "heights_mm", heights)
        if heights.ndim != 2 or not heights.size:
            raise ValueError(f"heights of shape {list(heights.shape)}: must be [rows, columns]")
        least, most = extremes(heights)
        if not (least >= -MAX_HEIGHT_MM and most <= MAX_HEIGHT_MM):
            raise ValueError(f"heights from {least:g} to {most:g} mm: must be within {MAX_HEIGHT_MM:g} mm, or NaN")
        if self.kind not in KINDS:
            raise ValueError(f"kind = {self.kind!r}: must be {' or '.join(map(repr, KINDS))}")
        if self.pitch_mm is not None:
            for pitch in self.pitch_mm:
                if not 0 < pitch <= MAX_PITCH_MM:
                    raise ValueError(f"pitch of {pitch:g} mm: must be above 0 and at most {MAX_PITCH_MM:g}")
        if self.wavelength_nm is not None and not WAVELENGTHS_NM[0] <= self.wavelength_nm <= WAVELENGTHS_NM[1]:
            least, most = WAVELENGTHS_NM
            raise ValueError(f"wavelength of {self.wavelength_nm:g} nm: must be {least:g} to {most:g}")
        if not all(abs(place) <= 1e9 for place in self.centre_mm):
            raise ValueError(f"centre at {self.centre_mm} mm: must be within 1e9")
        object.__setattr__(self, "comment", comment_lines(self.comment))
        if self.intensity is not None and self.intensity.shape[1:] != heights.shape:
            raise ValueError(f"intensity of shape {list(self.intensity.shape)}: must be [frames, rows, columns]")

    @property
    def valid(self) -> NDArray[np.bool_]:
        """[rows, columns]: where there is a height."""
        return np.isfinite(self.heights_mm)

    def positions_mm(self) -> tuple[FloatArray, FloatArray]:
        """x and y, each [rows, columns]. Raises ValueError where the lateral scale is unknown."""
        if self.pitch_mm is None:
            raise ValueError("the map's lateral scale is unknown; give its pitch in mm (--pitch-mm)")
        rows, columns = self.heights_mm.shape
        x = self.centre_mm[0] + (np.arange(columns) - (columns - 1) / 2) * self.pitch_mm[0]
        y = self.centre_mm[1] + (np.arange(rows) - (rows - 1) / 2) * self.pitch_mm[1]
        grid_x, grid_y = np.meshgrid(x, y)
        return grid_x, grid_y

    def as_kind(self, kind: str) -> HeightMap:
        """The map as a surface or as a wavefront: a wavefront's heights are twice the surface's."""
        if kind not in KINDS:
            raise ValueError(f"kind = {kind!r}: must be {' or '.join(map(repr, KINDS))}")
        if kind == self.kind:
            return self
        factor = WAVEFRONT_FACTOR if kind == WAVEFRONT else 1 / WAVEFRONT_FACTOR
        return replace(self, heights_mm=self.heights_mm * factor, kind=kind, comment=self._said(f"now a {kind}"))

    def negated(self) -> HeightMap:
        """The map with its heights turned over."""
        return replace(self, heights_mm=-self.heights_mm, comment=self._said("heights turned over"))

    def flipped(self, axes: str) -> HeightMap:
        """The map mirrored: "x" turns left and right over, "y" top and bottom, "xy" both (half a turn).

        Its place in the camera's frame is dropped: the frame is not turned over.
        """
        if axes not in FLIPS:
            raise ValueError(f"flip = {axes!r}: must be one of {', '.join(FLIPS)}")
        steps = (-1 if "y" in axes else 1, -1 if "x" in axes else 1)
        centre = (self.centre_mm[0] * steps[1] + 0.0, self.centre_mm[1] * steps[0] + 0.0)  # no -0.0
        turn = replace(self, comment=self._said(f"mirrored: {axes}"))._turned
        return turn(lambda a: a[..., :: steps[0], :: steps[1]], self.pitch_mm, centre)

    def rotated(self) -> HeightMap:
        """The map turned by a quarter, counterclockwise as seen with x to the right and y up."""
        pitch = None if self.pitch_mm is None else self.pitch_mm[::-1]
        # (x, y) goes to (-y, x): the columns of the new map are the old rows, from the last to the first
        turn = replace(self, comment=self._said("turned by a quarter"))._turned
        return turn(lambda a: a.swapaxes(-2, -1)[..., ::-1], pitch, (0.0 - self.centre_mm[1], self.centre_mm[0]))

    def _said(self, done: str) -> tuple[str, ...]:
        """The comment with what was done to the map since; none where there is none."""
        return (*self.comment, done) if self.comment else ()

    def _turned(self, turn: Any, pitch: tuple[float, float] | None, centre: tuple[float, float]) -> HeightMap:
        intensity = None if self.intensity is None else np.ascontiguousarray(turn(self.intensity))
        heights = np.ascontiguousarray(turn(self.heights_mm))
        return replace(
            self, heights_mm=heights, pitch_mm=pitch, centre_mm=centre, intensity=intensity, camera=None
        )  # fmt: skip


@dataclass(frozen=True)
class MapOptions:
    """What a file does not say. None: as the file says.

    unit: of its heights, one of UNITS. pitch_mm: between its pixels, (x, y). wavelength_nm. kind: "surface" or
    "wavefront". A value that the file tells itself, and otherwise, is refused, except the pitch: lateral scales in
    files are often those of another set-up, so the one given here replaces it, with a warning.

    number: which of a file's maps, from 1. array: of an NPZ file, the name of its array; the unit is to be told.
    quantity: of a result of this program: "deviation" (None), "height" or "standard-error".
    """

    unit: str | None = None
    pitch_mm: tuple[float, float] | None = None
    wavelength_nm: float | None = None
    kind: str | None = None
    number: int | None = None
    array: str | None = None
    quantity: str | None = None

    def __post_init__(self) -> None:
        for name, allowed in (("unit", UNITS), ("kind", KINDS), ("quantity", RESULT_QUANTITIES)):
            value = getattr(self, name)
            if value is not None and value not in allowed:
                raise ValueError(f"{name} = {value!r}: must be one of {', '.join(allowed)}")
        for pitch in self.pitch_mm or ():
            if not 0 < pitch <= MAX_PITCH_MM:
                raise ValueError(f"pitch_mm = {pitch:g}: must be above 0 and at most {MAX_PITCH_MM:g}")
        if self.wavelength_nm is not None and not WAVELENGTHS_NM[0] <= self.wavelength_nm <= WAVELENGTHS_NM[1]:
            least, most = WAVELENGTHS_NM
            raise ValueError(f"wavelength_nm = {self.wavelength_nm:g}: must be {least:g} to {most:g}")


@dataclass
class Findings:
    """What a reader finds in a file, completed by what it was told; every doubt becomes a warning."""

    where: str
    told: MapOptions
    warnings: list[str] = field(default_factory=list)
    replaced: str = ""  # what is said of a pitch that another one replaces

    def wavelength_nm(self, found: float | None, needed: bool = False) -> float | None:
        """The wavelength: the file's, or the one told. found: None or 0 for an unknown one."""
        told = self.told.wavelength_nm
        if found is not None and not math.isfinite(found):
            raise ValueError(f"{self.where}: wavelength of {found:g} nm: must be finite")
        if not found or found < 0:
            if told is None and needed:
                raise ValueError(f"{self.where}: tells no wavelength, which its heights need: give --wavelength-nm")
            if told is None:
                self.warnings.append("the file tells no wavelength")
            return told
        if told is not None and abs(told - found) > 1e-6 * found:
            raise ValueError(
                f"{self.where}: wavelength {found:.10g} nm, told {told:.10g}: its heights are made with its own; "
                "leave --wavelength-nm out"
            )
        least, most = USUAL_WAVELENGTHS_NM
        if not least <= found <= most:
            self.warnings.append(f"a wavelength of {found:.6g} nm is unusual, and heights in waves go with it")
        return found

    def pitch_mm(self, found: tuple[float, float] | None) -> tuple[float, float] | None:
        """The pitch: the one told, or the file's. found: None or zeros for an unknown lateral scale."""
        told = self.told.pitch_mm
        if found is not None and not all(math.isfinite(p) for p in found):
            raise ValueError(f"{self.where}: pitch of {found[0]:g} x {found[1]:g} mm: must be finite")
        if found is None or not all(p > 0 for p in found):
            if told is None:
                self.warnings.append("the file tells no lateral scale: give --pitch-mm")
            return told
        if told is not None and any(abs(t - f) > 1e-6 * f for t, f in zip(told, found, strict=True)):
            self.replaced = f"pitch of {told[0]:g} x {told[1]:g} mm as told; the file has {found[0]:g} x {found[1]:g}"
        return told or found

    def unit_mm(self, found: str | None, wavelength_nm: float | None) -> float:
        """mm per unit of the file's heights. found: a name of UNITS, None where the file has none."""
        told = self.told.unit
        unit = found or told
        if unit is None:
            raise ValueError(f"{self.where}: tells no unit of its heights: give --unit, one of {', '.join(UNITS)}")
        if found and told and found != told:
            raise ValueError(f"{self.where}: heights in {found}, told {told}: leave --unit out")
        if unit != "wave":
            return UNIT_MM[unit]
        if wavelength_nm is None:
            raise ValueError(f"{self.where}: heights in waves, and tells no wavelength: give --wavelength-nm")
        return wavelength_nm * 1e-6

    def kind(self, found: str | None) -> str:
        """Surface or wavefront. found: None where the file does not tell it."""
        told = self.told.kind
        if found and told and found != told:
            raise ValueError(f"{self.where}: holds a {found}, told a {told}: leave --holds out")
        if not found and not told:
            self.warnings.append("the file does not tell surface from wavefront: taken as a surface")
        return found or told or SURFACE

    def chosen(self, count: int, what: str) -> int:
        """The number, from 0, of the map to read of `count` in the file. Raises ValueError where none is chosen."""
        number = self.told.number
        if number is None and count != 1:
            raise ValueError(f"{self.where}: {count} {what}: a map is one; give --number, from 1 to {count}")
        number = 1 if number is None else number
        if not 1 <= number <= count:
            raise ValueError(f"{self.where}: --number = {number}: must be 1 to {count}")
        return number - 1

    def heights(self, values: FloatArray) -> FloatArray:
        """Heights without infinite ones. Raises ValueError if none is valid."""
        infinite = int(np.isinf(values).sum())
        if infinite:
            values = np.where(np.isinf(values), np.nan, values)
            self.warnings.append(f"{infinite} infinite heights: taken as invalid")
        if not np.isfinite(values).any():
            raise ValueError(f"{self.where}: none of its {values.size} heights is valid")
        return values

    def build(self, values: FloatArray, origin: str, unit_mm: float = 1.0, **others: Any) -> HeightMap:
        """The map of values in a unit. Raises ValueError, with the file's name, for what no map can be."""
        x, y = others.get("centre_mm", (0.0, 0.0))
        if self.replaced:
            self.warnings.append(self.replaced + (f", and its centre stays at {x:g}, {y:g} mm" if x or y else ""))
        with np.errstate(all="ignore"):  # what overflows is infinite, and no height
            heights_mm = values * unit_mm
        try:
            return HeightMap(
                self.heights(heights_mm), origin=f"{origin}: {self.where}", warnings=tuple(self.warnings), **others
            )
        except ValueError as error:
            said = str(error)
            raise ValueError(said if said.startswith(f"{self.where}: ") else f"{self.where}: {said}") from None


def extremes(heights: FloatArray) -> tuple[float, float]:
    """Least and largest valid height; 0 and 0 where none is."""
    valid = heights[~np.isnan(heights)]
    return (float(valid.min()), float(valid.max())) if valid.size else (0.0, 0.0)


def unit_named(text: str) -> str | None:
    """The name in UNITS of a unit as files write it; None for one that is not known."""
    plain = text.strip().lower().replace("\u00b5", "u").replace("\u03bc", "u")
    names = {
        "m": "m", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "cm": "cm", "centimeters": "cm",
        "in": "in", "inch": "in", "inches": "in", "mm": "mm", "millimeters": "mm", "millimetres": "mm",
        "um": "um", "micron": "um", "microns": "um", "micrometers": "um", "micrometres": "um",
        "nm": "nm", "nanometers": "nm", "nanometres": "nm", "nanometer": "nm", "millimeter": "mm",
        "micrometer": "um", "wave": "wave", "waves": "wave", "wv": "wave",
    }  # fmt: skip
    return names.get(plain)


def square_pitch(where: str, height_map: HeightMap, what: str) -> float | None:
    """The pitch of a map with square pixels; None for an unknown one. Raises ValueError, for a format that has one
    number, where the pixels are not square."""
    if height_map.pitch_mm is None:
        return None
    x, y = height_map.pitch_mm
    if abs(x - y) > 1e-9 * max(x, y):
        raise ValueError(f"{where}: pixels of {x:g} x {y:g} mm: {what} has one pitch for both; use another format")
    return x
