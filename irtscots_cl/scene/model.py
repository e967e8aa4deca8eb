"""A test: mirror, screen and camera as frozen, checked dataclasses, and their TOML form.

Lengths are in mm, radiance in W/(mm^2 sr). The world is the mirror's frame: origin at its vertex (off-axis:
at the point of the surface at the segment's centre), +Z along the surface normal there towards screen and
camera, +X away from the parent's axis. A device looks from `position_mm` at `look_at_mm`; its x axis is
unit(Y_world x z), or the world's X if it looks along Y.

An invalid file or constructor argument raises a `SceneError` of one line; see scene/validation.py.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import re
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError, model_validator

from irtscots_cl.scene.element import Element
from irtscots_cl.scene.instrument import MAX_VIEW_RAD, Camera, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.toml import toml_table
from irtscots_cl.scene.validation import SceneName, checked, nearest, problem, refuse, shown_word, translate
from irtscots_cl.system.shown import html_table, one_line

VIEW_RINGS, VIEW_ANGLES = 4, 32  # of the mirror, where it is looked for in a device's view
MAX_ELEMENTS = 16  # besides the scene's own: all events of an element fit six bits of a path
OPTIONAL_TABLES = {  # keys of tables that few scenes have, by the path of the table that holds them
    ("mirror",): ("asphere", "map", "outline", "polynomial"),
    ("screen",): ("response", "shape", "cover_glass", "lines"),
    ("camera",): ("intrinsics",),
    ("camera", "detector"): ("noise",),
    (): ("calibration", "budget"),
}
ZERNIKE_KEYS = {"noll_um": "noll", "fringe_um": "fringe", "osa_um": "osa"}


@checked("scene")
class Scene:
    """One test: the mirror, the screen, the camera and further elements.

    calibration: a calibration_known.Calibration, or None where nothing is said of how well the geometry is known.
    budget: an error_sources.Budget, or None where no errors are expected.
    """

    name: SceneName
    mirror: Annotated[Mirror, Field(description="a table [mirror]")]
    screen: Annotated[Screen, Field(description="a table [screen]")]
    camera: Annotated[Camera, Field(description="a table [camera]")]
    element: Annotated[tuple[Element, ...], Field(description="tables [[element]]")] = ()
    calibration: Annotated[Any, Field(description="a table [calibration.known]")] = None
    budget: Annotated[Any, Field(description="a table [budget]")] = None

    __repr__ = one_line
    _repr_html_ = html_table

    def summary(self) -> dict[str, str]:
        """Mirror, screen and camera in few words; to_toml() has all of them."""
        mirror, screen, camera = self.mirror, self.screen, self.camera
        columns, rows = camera.detector.pixels
        said = {
            "name": self.name,
            "mirror": f"{mirror.diameter_mm:g} mm, radius {mirror.radius_mm:g} mm, conic {mirror.conic:g}",
            "screen": f"{screen.pixels[0]} x {screen.pixels[1]} pixels at {_place(screen.position_mm)} mm",
            "camera": f"{columns} x {rows} pixels at {_place(camera.position_mm)} mm",
        }
        return said | ({"elements": ", ".join(element.name for element in self.element)} if self.element else {})

    @model_validator(mode="after")
    def _check(self) -> Scene:
        if self.calibration is not None and not hasattr(self.calibration, "known"):
            refuse(("calibration",), self.calibration, "be a Calibration of irtscots_cl.scene.calibration_known")
        if self.budget is not None and not hasattr(self.budget, "sources"):
            refuse(("budget",), self.budget, "be a Budget of irtscots_cl.scene.error_sources")
        names = [element.name for element in self.element]
        for k, name in enumerate(names):
            if name in names[:k]:
                refuse(("element", k, "name"), name, "be different from the names of the elements before it")
        if len(names) > MAX_ELEMENTS:
            refuse(("element",), len(names), f"be at most {MAX_ELEMENTS} tables [[element]]")
        for key, device in (("screen", self.screen), ("camera", self.camera)):
            x, y, z = device.position_mm
            # Over a concave mirror a device must be above the surface, and outside it above the rim. A segment gets
            # the sag of its parent's middle. A device that sees the whole mirror is far above both. Of a convex
            # mirror the vertex is the highest point: all light from above its plane falls downwards.
            sag_mm = max(0.0, self.mirror.parent_sag_mm(min(math.hypot(x, y), self.mirror.diameter_mm / 2)))
            if not z > sag_mm:
                must = f"lie in front of the mirror: z above {sag_mm:.10g}"
                refuse((key, "position_mm"), device.position_mm, must)
            if not _sees_mirror(device, self.mirror):
                must = "look from position_mm within 89 degrees of some point of the mirror"
                refuse((key, "look_at_mm"), device.look_at_mm, must)
        return self

    @classmethod
    def from_dict(cls, data: dict[str, Any], source: str = "scene") -> Scene:
        """The scene of a parsed TOML file. Raises SceneError; its message names `source` as the file."""
        mirror = data.get("mirror") if isinstance(data, dict) else None
        if isinstance(mirror, dict) and isinstance(mirror.get("zernike"), list):
            entries = enumerate(mirror["zernike"])
            terms = [_zernike_from_toml(entry, source, ("mirror", "zernike", k)) for k, entry in entries]
            mirror = {**mirror, "zernike": terms}
        mirror = _with_scatter(mirror, source, ("mirror",))
        data = {**data, "mirror": mirror} if isinstance(mirror, dict) else data
        if isinstance(data, dict) and isinstance(data.get("element"), list):
            elements = [_with_scatter(entry, source, ("element", k)) for k, entry in enumerate(data["element"])]
            data = {**data, "element": elements}
        if isinstance(data, dict) and _has_optional_tables(data):
            from irtscots_cl.scene.optional_tables import checked_tables  # imported late: few scenes have any

            data = checked_tables(data, source)
        scene: Scene = _validated(cls, data, source)
        return scene

    @property
    def is_sequential(self) -> bool:
        """Whether light goes only from the screen to the mirror to a paraxial camera."""
        return not self.element and self.camera.lens == "paraxial" and self.mirror.scatter is None

    @property
    def has_noise_tables(self) -> bool:
        """Whether the scene says what a real camera or screen does to its images."""
        return self.camera.detector.noise is not None or self.screen.response is not None

    def nominal(self) -> Scene:
        """The same test of the mirror as designed, without its deviations."""
        return dataclasses.replace(self, mirror=self.mirror.nominal())

    def to_toml(self) -> str:
        """TOML text that loads back to an equal scene."""
        return toml_table((), self).lstrip("\n")


def _sees_mirror(device: Screen | Camera, mirror: Mirror) -> bool:
    """Whether some point of the mirror, of a grid of them, is within MAX_VIEW_RAD of the device's direction."""
    look = [b - a for a, b in zip(device.position_mm, device.look_at_mm, strict=True)]
    length = math.hypot(*look)
    for k in range(1 + VIEW_RINGS * VIEW_ANGLES):  # the vertex first: it is enough for nearly all devices
        ring, angle = (k + VIEW_ANGLES - 1) // VIEW_ANGLES, k * (2 * math.pi / VIEW_ANGLES)
        r = mirror.diameter_mm / 2 * ring / VIEW_RINGS
        point = (r * math.cos(angle), r * math.sin(angle), mirror.parent_sag_mm(r))
        away = [b - a for a, b in zip(device.position_mm, point, strict=True)]
        # divided before they are multiplied: lengths reach 1e12, and small ones must not vanish
        if sum(u / math.hypot(*away) * v / length for u, v in zip(away, look, strict=True)) > math.cos(MAX_VIEW_RAD):
            return True
    return False


def _has_optional_tables(data: dict[str, Any]) -> bool:
    """Whether the data of a file have a table of optional_tables.KINDS."""
    for path, keys in OPTIONAL_TABLES.items():
        table: object = data
        for step in path:
            table = table.get(step) if isinstance(table, dict) else None
        if isinstance(table, dict) and any(key in table for key in keys):
            return True
    return False


# --- the TOML form ------------------------------------------------------------------------------------------
_adapter = functools.cache(TypeAdapter)


def _validated(kind: Any, data: object, source: str, prefix: tuple[Any, ...] = (), rename: str = "") -> Any:
    try:
        return _adapter(kind).validate_python(data)
    except ValidationError as error:
        raise translate(error, kind, source, prefix, rename) from None


def _with_scatter(table: object, source: str, steps: tuple[Any, ...]) -> object:
    """The table, with its scatter table replaced by a scatter model if there is one."""
    if not isinstance(table, dict) or "scatter" not in table:
        return table
    from irtscots_cl.scene.scatter.toml import scatter_from_table  # imported late: few scenes need NumPy

    return {**table, "scatter": scatter_from_table(table["scatter"], source, (*steps, "scatter"))}


def _zernike_from_toml(entry: object, source: str, prefix: tuple[Any, ...]) -> ZernikeTerms:
    """`{ radius_mm = 532.0, noll_um = { 6 = 0.3266 } }`: the key gives the ordering."""
    if not isinstance(entry, dict):
        raise problem(source, prefix, "must be a table [[mirror.zernike]]", entry)
    others = ("radius_mm", "obscuration")
    allowed = [*others, *ZERNIKE_KEYS]
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
    fields = {name: entry[name] for name in others if name in entry}
    fields |= {"ordering": ZERNIKE_KEYS[key], "coefficients_um": terms}
    checked_terms: ZernikeTerms = _validated(ZernikeTerms, fields, source, prefix, rename=key)
    return checked_terms


def _place(position_mm: tuple[float, float, float]) -> str:
    return f"({', '.join(f'{value:g}' for value in position_mm)})"
