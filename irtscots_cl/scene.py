"""What a test consists of: mirror, screen and camera as frozen, checked dataclasses, and their TOML form.

Lengths are in mm, radiance in W/(mm^2 sr). The world is the mirror's frame: origin at its vertex (off-axis:
at the point of the surface at the segment's centre), +Z along the surface normal there towards screen and
camera, +X away from the parent's axis. A device looks from `position_mm` at `look_at_mm`; its x axis is
unit(Y_world x z).

Every refusal, of a file or of a constructor's argument, is a `SceneError` of one line; see checked.py.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import re
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError, model_validator

from irtscots_cl.checked import (
    Coefficients,
    Conic,
    Fraction,
    NonNegativeMm,
    OffsetMm,
    OptionalMm,
    PixelGrid,
    PointMm,
    PositiveMm,
    Radiance,
    SceneError,
    SceneName,
    checked,
    nearest,
    problem,
    refuse,
    shown_word,
    translate,
)
from irtscots_cl.element import MIN_SINE_TO_Y, Element

__all__ = ["Camera", "Detector", "Element", "Mirror", "Scene", "SceneError", "Screen", "ZernikeTerms"]

MAX_SCREEN_PIXELS = 2**26
MAX_DETECTOR_PIXELS = 2**24
MAX_RADIAL_ORDER = 40
MAX_ELEMENTS = 16  # beside the scene's own: all events of an element fit six bits of a path
MAX_VIEW_RAD = math.radians(89.0)
ZERNIKE_KEYS = {"noll_um": "noll", "fringe_um": "fringe", "osa_um": "osa"}


def _radial_order(ordering: str, index: int) -> int:
    """Radial order n of a term; fringe group g = (n + |m|) / 2 has 2 g + 1 terms, n from g to 2 g."""
    if ordering == "fringe":
        group = math.isqrt(index - 1)
        return group + (index - 1 - group * group) // 2
    return (math.isqrt(8 * (index - (ordering == "noll")) + 1) - 1) // 2


@checked("zernike")
class ZernikeTerms:
    """Deviation from the nominal surface, in um, on the disk of `radius_mm` about the mirror's centre."""

    radius_mm: PositiveMm
    ordering: Annotated[Literal["noll", "fringe", "osa"], Field(description="one of noll, fringe, osa")]
    coefficients_um: Coefficients

    @model_validator(mode="after")
    def _check(self) -> ZernikeTerms:
        lowest, highest = {"noll": (1, 861), "fringe": (1, 1602), "osa": (0, 860)}[self.ordering]
        for index, value in self.coefficients_um.items():
            if not lowest <= index <= highest or _radial_order(self.ordering, index) > MAX_RADIAL_ORDER:
                must = f"have a {self.ordering} index from {lowest} to {highest}"
                must += f", of radial order at most {MAX_RADIAL_ORDER}"
                refuse(("coefficients_um", index), value, must)
        return self

    def __hash__(self) -> int:  # a dict has none
        return hash((self.radius_mm, self.ordering, frozenset(self.coefficients_um.items())))


@checked("mirror")
class Mirror:
    """A concave conic of revolution or an off-axis piece of one, its rim and its central hole round."""

    radius_mm: PositiveMm
    diameter_mm: PositiveMm
    conic: Conic = 0.0
    off_axis_mm: NonNegativeMm = 0.0
    obscuration_mm: NonNegativeMm = 0.0
    reflectance: Fraction = 1.0
    zernike: Annotated[tuple[ZernikeTerms, ...], Field(description="tables [[mirror.zernike]]")] = ()
    scatter: Annotated[Any, Field(description="a table [mirror.scatter]")] = None

    @model_validator(mode="after")
    def _check(self) -> Mirror:
        if self.scatter is not None and not hasattr(self.scatter, "tis_at"):
            refuse(("scatter",), self.scatter, "be a model of irtscots_cl.scatter")
        if not self.obscuration_mm < self.diameter_mm:
            refuse(("obscuration_mm",), self.obscuration_mm, f"be below diameter_mm ({self.diameter_mm!r})")
        rim_mm, curvature = self.off_axis_mm + self.diameter_mm / 2, 1.0 + self.conic
        if curvature > 0 and curvature * rim_mm * rim_mm >= self.radius_mm * self.radius_mm:
            reach_mm = self.radius_mm / math.sqrt(curvature)
            if reach_mm <= self.off_axis_mm:
                refuse(("off_axis_mm",), self.off_axis_mm, f"be below {reach_mm:.10g}, where the conic ends")
            limit_mm = 2 * (reach_mm - self.off_axis_mm)
            refuse(("diameter_mm",), self.diameter_mm, f"be below {limit_mm:.10g}, where the conic ends")
        for k, terms in enumerate(self.zernike):
            if terms.radius_mm < self.diameter_mm / 2:
                must = f"be at least half of diameter_mm ({self.diameter_mm / 2!r}), to cover the mirror"
                refuse(("zernike", k, "radius_mm"), terms.radius_mm, must)
            if terms.radius_mm != self.zernike[0].radius_mm:
                must = f"be the first table's ({self.zernike[0].radius_mm!r}): all terms share one disk"
                refuse(("zernike", k, "radius_mm"), terms.radius_mm, must)
        return self


def _check_direction(device: Screen | Camera) -> None:
    """A device's frame needs a direction to look in, and one that is not the world's Y."""
    x, y, z = (a - b for a, b in zip(device.position_mm, device.look_at_mm, strict=True))
    if x == y == z == 0.0:
        refuse(("position_mm",), device.position_mm, "differ from look_at_mm, for a direction to look in")
    if math.hypot(x, z) <= MIN_SINE_TO_Y * math.hypot(x, y, z):
        refuse(("position_mm",), device.position_mm, "not lie along Y from look_at_mm: no x axis")


def _check_pixels(pixels: tuple[int, int], most: int) -> None:
    if pixels[0] * pixels[1] > most:
        refuse(("pixels",), pixels, f"be at most {most} pixels in all")


@checked("screen")
class Screen:
    """A Lambertian screen; `centre_offset_mm` moves its grid of square pixels in the screen's own x, y."""

    position_mm: PointMm
    pixels: PixelGrid
    pitch_mm: PositiveMm
    look_at_mm: PointMm = (0.0, 0.0, 0.0)
    radiance: Radiance = 1.0
    emission: Annotated[Literal["lambertian"], Field(description="'lambertian'")] = "lambertian"
    centre_offset_mm: OffsetMm = (0.0, 0.0)

    @model_validator(mode="after")
    def _check(self) -> Screen:
        _check_pixels(self.pixels, MAX_SCREEN_PIXELS)
        _check_direction(self)
        return self


@checked("detector")
class Detector:
    """A grid of square pixels behind the lens."""

    pixels: PixelGrid
    pitch_mm: PositiveMm

    @model_validator(mode="after")
    def _check(self) -> Detector:
        _check_pixels(self.pixels, MAX_DETECTOR_PIXELS)
        return self


@checked("camera")
class Camera:
    """An aperture at `position_mm` with a paraxial lens in it, and the detector where `focus_mm` is imaged sharply.

    lens = "elements": no lens in the aperture, the scene's elements take its place; focal_length_mm is then theirs, for
    the calibration. detector_distance_mm: from the aperture to the detector, if not where a paraxial lens images.
    """

    position_mm: PointMm
    aperture_diameter_mm: PositiveMm
    focal_length_mm: PositiveMm
    detector: Annotated[Detector, Field(description="a table [camera.detector]")]
    look_at_mm: PointMm = (0.0, 0.0, 0.0)
    focus_distance_mm: OptionalMm = None
    transmittance: Fraction = 1.0
    lens: Annotated[Literal["paraxial", "elements"], Field(description="paraxial or elements")] = "paraxial"
    detector_distance_mm: OptionalMm = None

    @property
    def focus_mm(self) -> float:
        """Distance in front of the lens that is in focus."""
        return self.focus_distance_mm or math.dist(self.position_mm, self.look_at_mm)

    @property
    def image_distance_mm(self) -> float:
        """From a paraxial lens to the sharp image: 1 / (1 / focal_length_mm - 1 / focus_mm)."""
        return self.focal_length_mm / (1.0 - self.focal_length_mm / self.focus_mm)

    @model_validator(mode="after")
    def _check(self) -> Camera:
        _check_direction(self)
        if not self.focal_length_mm / self.focus_mm < 1.0:
            if self.focus_distance_mm is not None:
                must = f"be above focal_length_mm ({self.focal_length_mm!r})"
                refuse(("focus_distance_mm",), self.focus_distance_mm, must)
            must = f"be below {self.focus_mm:.10g}, the distance to look_at_mm, which is in focus"
            refuse(("focal_length_mm",), self.focal_length_mm, must)
        return self


@checked("scene")
class Scene:
    """One test: what is measured and with what."""

    name: SceneName
    mirror: Annotated[Mirror, Field(description="a table [mirror]")]
    screen: Annotated[Screen, Field(description="a table [screen]")]
    camera: Annotated[Camera, Field(description="a table [camera]")]
    element: Annotated[tuple[Element, ...], Field(description="tables [[element]]")] = ()

    @model_validator(mode="after")
    def _check(self) -> Scene:
        names = [element.name for element in self.element]
        for k, name in enumerate(names):
            if name in names[:k]:
                refuse(("element", k, "name"), name, "be different from the names of the elements before it")
        if len(names) > MAX_ELEMENTS:
            refuse(("element",), len(names), f"be at most {MAX_ELEMENTS} tables [[element]]")
        for key, device in (("screen", self.screen), ("camera", self.camera)):
            x, y, z = device.position_mm
            # Over the mirror a device stands above the surface, beside it above the rim. A segment gets the
            # sag of its parent's middle: near enough, a device that sees the whole mirror is far above both.
            radius, r = self.mirror.radius_mm, min(math.hypot(x, y), self.mirror.diameter_mm / 2)
            root = math.sqrt(max(radius * radius - (1.0 + self.mirror.conic) * r * r, 0.0))
            sag_mm = r * r / (radius + root)
            if not z > sag_mm:
                must = f"lie in front of the mirror: z above {sag_mm:.10g}"
                refuse((key, "position_mm"), device.position_mm, must)
            away = math.hypot(x, y, z)
            look = [b - a for a, b in zip(device.position_mm, device.look_at_mm, strict=True)]
            cosine = -sum(u / away * v / math.hypot(*look) for u, v in zip((x, y, z), look, strict=True))
            if not cosine > math.cos(MAX_VIEW_RAD):
                must = "look from position_mm within 89 degrees of the mirror's vertex"
                refuse((key, "look_at_mm"), device.look_at_mm, must)
        return self

    @classmethod
    def from_dict(cls, data: dict[str, Any], source: str = "scene") -> Scene:
        """The scene of a parsed TOML file; raises SceneError, in which `source` stands for the file."""
        mirror = data.get("mirror") if isinstance(data, dict) else None
        entries = mirror.get("zernike") if isinstance(mirror, dict) else None
        if isinstance(entries, list):
            terms = [_zernike_from_toml(e, source, ("mirror", "zernike", k)) for k, e in enumerate(entries)]
            mirror = {**mirror, "zernike": terms}
        mirror = _with_scatter(mirror, source, ("mirror",))
        data = {**data, "mirror": mirror} if isinstance(mirror, dict) else data
        if isinstance(data, dict) and isinstance(data.get("element"), list):
            elements = [_with_scatter(entry, source, ("element", k)) for k, entry in enumerate(data["element"])]
            data = {**data, "element": elements}
        return _validated(cls, data, source)

    @property
    def is_sequential(self) -> bool:
        """Whether its light goes from screen to mirror to a paraxial camera and nowhere else."""
        return not self.element and self.camera.lens == "paraxial" and self.mirror.scatter is None

    def nominal(self) -> Scene:
        """The same test of the mirror as designed: without its deviation."""
        return dataclasses.replace(self, mirror=dataclasses.replace(self.mirror, zernike=()))

    def to_toml(self) -> str:
        """TOML text that loads back to an equal scene."""
        return _toml_table((), self).lstrip("\n")


# --- the TOML form ------------------------------------------------------------------------------------------


_adapter = functools.cache(TypeAdapter)


def _validated(kind: Any, data: object, source: str, prefix: tuple[Any, ...] = (), rename: str = "") -> Any:
    try:
        return _adapter(kind).validate_python(data)
    except ValidationError as error:
        raise translate(error, kind, source, prefix, rename) from None


def _with_scatter(table: object, source: str, steps: tuple[Any, ...]) -> object:
    """The table with its scatter, if it has any, as a model."""
    if not isinstance(table, dict) or "scatter" not in table:
        return table
    from irtscots_cl.scatter import scatter_from_table  # few scenes wait for NumPy

    return {**table, "scatter": scatter_from_table(table["scatter"], source, (*steps, "scatter"))}


def _zernike_from_toml(entry: object, source: str, prefix: tuple[Any, ...]) -> ZernikeTerms:
    """`{ radius_mm = 532.0, noll_um = { 6 = 0.3266 } }`: the key tells the ordering."""
    if not isinstance(entry, dict):
        raise problem(source, prefix, "must be a table [[mirror.zernike]]", entry)
    allowed = ["radius_mm", *ZERNIKE_KEYS]
    for key in entry:
        if key not in allowed:
            raise problem(source, (*prefix, key), f"unknown key; {nearest(shown_word(key), allowed)}")
    keys = [key for key in entry if key in ZERNIKE_KEYS]
    if len(keys) != 1:
        raise problem(source, prefix, f"needs exactly one of {', '.join(ZERNIKE_KEYS)}")
    key, terms = keys[0], entry[keys[0]]
    if isinstance(terms, dict):
        for index, value in terms.items():
            if not (isinstance(index, str) and re.fullmatch("0|[1-9][0-9]{0,5}", index)):
                raise problem(source, (*prefix, key, index), "must have an integer index as its key", value)
        terms = {int(index): value for index, value in terms.items()}
    fields = {"radius_mm": entry["radius_mm"]} if "radius_mm" in entry else {}
    fields |= {"ordering": ZERNIKE_KEYS[key], "coefficients_um": terms}
    return _validated(ZernikeTerms, fields, source, prefix, rename=key)


def _toml_value(value: Any) -> str:
    if isinstance(value, str):
        plain = (c if " " <= c <= "~" and c not in '"\\' else f"\\U{ord(c):08X}" for c in value)
        return '"' + "".join(plain) + '"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml_value(v)}" for key, v in value.items()) + " }"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    return repr(value)


def _toml_table(path: tuple[str, ...], part: Any) -> str:
    """The fields of `part`, its plain values before its tables as TOML wants them."""
    values, tables = "", ""
    for field in dataclasses.fields(part):
        value, inner = getattr(part, field.name), (*path, field.name)
        if dataclasses.is_dataclass(value) and field.name != "scatter":
            tables += f"\n[{'.'.join(inner)}]\n" + _toml_table(inner, value)
        elif field.name == "scatter" and value is not None:
            tables += f'\n[{".".join(inner)}]\nmodel = "{type(value).__name__.lower()}"\n' + _toml_table(inner, value)
        elif field.name == "element":
            for element in value:
                tables += "\n[[element]]\n" + _toml_table(("element",), element)
        elif field.name == "zernike":
            for terms in value:
                key = f"{terms.ordering}_um"
                tables += f"\n[[{'.'.join(inner)}]]\nradius_mm = {_toml_value(terms.radius_mm)}\n"
                tables += f"{key} = {_toml_value(terms.coefficients_um)}\n"
        elif value is not None:
            values += f"{field.name} = {_toml_value(value)}\n"
    return values + tables
