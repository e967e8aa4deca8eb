"""Elements that a test may contain besides mirror, screen and camera: lens surfaces, windows, baffles, more mirrors.

Only the non-sequential tracer sees these elements. An element has its own frame: origin at its vertex, +z
(its front) towards `facing_mm`, which may lie in any direction; x = unit(Y_world x z), or the world's X if the element
faces along Y. Lengths in mm.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, model_validator

from irtscots_cl.scene.validation import (
    Conic,
    Fraction,
    NonNegativeMm,
    OptionalFraction,
    OptionalIndex,
    OptionalMm,
    OptionalSignedMm,
    OptionalSizeMm,
    PointMm,
    SceneName,
    checked,
    refuse,
)

KINDS = ("mirror", "refractor", "lens", "absorber", "detector")
RESERVED = ("screen", "mirror", "lens", "stop", "detector")  # names of the scene's own elements
NEEDS = {"refractor": ("index_front", "index_back"), "lens": ("focal_length_mm",)}
ALLOWS = {
    "mirror": ("reflectance", "scatter"),
    "refractor": ("index_front", "index_back", "reflectance", "coating_index", "scatter"),
    "lens": ("focal_length_mm",),
    "absorber": ("scatter",),
    "detector": (),
}
CHOICES = ("reflectance", "coating_index", "index_front", "index_back", "focal_length_mm", "scatter")


@checked("element")
class Element:
    """A surface and its effect on light.

    radius_mm: radius of curvature at the vertex, positive if the centre lies in front; None for a plane. The aperture
    is a disk (diameter_mm) with a hole (obscuration_mm), or a rectangle (size_mm: width along the element's x, height).
    kind: "mirror" (the front reflects `reflectance`, the back is black), "refractor" (between index_front and
    index_back; reflects by Fresnel's equations, or by the given `reflectance` of a coating, or as a quarter-wave layer
    of coating_index), "lens" (paraxial), "absorber", "detector" (an absorber that measures the light it receives).
    scatter: a scatter model. Mirrors and refractors scatter about the direction of the light that leaves them, an
    absorber about the direction of a mirror reflection.
    important: whether scattered rays are aimed at it.

    Raises SceneError for a value that is not allowed.
    """

    name: SceneName
    kind: Annotated[
        Literal["mirror", "refractor", "lens", "absorber", "detector"], Field(description=f"one of {', '.join(KINDS)}")
    ]
    position_mm: PointMm
    facing_mm: PointMm
    radius_mm: OptionalSignedMm = None
    conic: Conic = 0.0
    off_axis_mm: NonNegativeMm = 0.0
    diameter_mm: OptionalMm = None
    obscuration_mm: NonNegativeMm = 0.0
    size_mm: OptionalSizeMm = None
    reflectance: OptionalFraction = None
    index_front: OptionalIndex = None
    index_back: OptionalIndex = None
    focal_length_mm: OptionalSignedMm = None
    transmittance: Fraction = 1.0
    coating_index: OptionalIndex = None
    scatter: Annotated[Any, Field(description="a table [element.scatter]")] = None
    important: Annotated[bool, Strict(), Field(description="true or false")] = False

    @model_validator(mode="after")
    def _check(self) -> Element:
        if self.name in RESERVED:
            refuse(("name",), self.name, f"be none of {', '.join(RESERVED)}, which the scene has anyway")
        if self.position_mm == self.facing_mm:
            refuse(("facing_mm",), self.facing_mm, "differ from position_mm, for a direction to face")
        if (self.diameter_mm is None) == (self.size_mm is None):
            refuse(("diameter_mm",), self.diameter_mm, "be given, or else size_mm, and not both")
        if self.diameter_mm is not None and not self.obscuration_mm < self.diameter_mm:
            refuse(("obscuration_mm",), self.obscuration_mm, f"be below diameter_mm ({self.diameter_mm!r})")
        if self.size_mm is not None and not self.obscuration_mm < math.hypot(*self.size_mm):
            refuse(("obscuration_mm",), self.obscuration_mm, "be below the diagonal of size_mm")
        self._check_kind()
        self._check_shape()
        return self

    def _check_kind(self) -> None:
        if self.scatter is not None and not hasattr(self.scatter, "tis_at"):
            refuse(("scatter",), self.scatter, "be a model of irtscots_cl.scatter")
        for key in CHOICES:
            value = getattr(self, key)
            if value is None and key in NEEDS.get(self.kind, ()):
                refuse((key,), value, f"be given for kind {self.kind!r}")
            if value is not None and key not in ALLOWS[self.kind]:
                refuse((key,), value, f"be left out for kind {self.kind!r}")
        if self.coating_index is not None and self.index_front is not None and self.index_back is not None:
            least = min(self.index_front, self.index_back)
            if self.reflectance is not None:
                refuse(("coating_index",), self.coating_index, "be left out where reflectance is given, or that")
            if self.coating_index < least:
                refuse(("coating_index",), self.coating_index, f"be at least {least!r}, the lower index beside it")
        if self.kind != "lens" and self.transmittance != 1.0:
            refuse(("transmittance",), self.transmittance, f"be left out for kind {self.kind!r}")
        if self.kind == "lens" and self.radius_mm is not None:
            refuse(("radius_mm",), self.radius_mm, "be left out: a paraxial lens is a plane")

    def _check_shape(self) -> None:
        if self.radius_mm is None:
            for key in ("conic", "off_axis_mm"):
                if getattr(self, key) != 0.0:
                    refuse((key,), getattr(self, key), "be 0 for a plane; radius_mm makes it curved")
            return
        width, height = self.size_mm or (0.0, 0.0)
        rim = self.off_axis_mm + max((self.diameter_mm or 0.0) / 2, (width**2 + height**2) ** 0.5 / 2)
        if (1.0 + self.conic) * rim * rim >= self.radius_mm * self.radius_mm:
            key = "diameter_mm" if self.size_mm is None else "size_mm"
            refuse((key,), getattr(self, key), "end within the conic: its surface does not reach so far out")
