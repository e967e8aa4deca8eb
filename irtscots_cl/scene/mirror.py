"""The mirror of a scene: a conic with deviations, Zernike terms and measured maps."""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from irtscots_cl.scene.validation import (
    Coefficients,
    Conic,
    Fraction,
    MirrorRadiusMm,
    NonNegativeMm,
    PositiveMm,
    checked,
    refuse,
)

MAX_RADIAL_ORDER = 40


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
    """A conic of revolution, or an off-axis piece of one, with a round rim and a round central hole.

    radius_mm: at the parent's vertex; above 0 concave towards +Z, below 0 convex, inf flat.
    """

    radius_mm: MirrorRadiusMm
    diameter_mm: PositiveMm
    conic: Conic = 0.0
    off_axis_mm: NonNegativeMm = 0.0
    obscuration_mm: NonNegativeMm = 0.0
    reflectance: Fraction = 1.0
    zernike: Annotated[tuple[ZernikeTerms, ...], Field(description="tables [[mirror.zernike]]")] = ()
    map: Annotated[tuple[Any, ...], Field(description="tables [[mirror.map]]")] = ()
    scatter: Annotated[Any, Field(description="a table [mirror.scatter]")] = None

    @model_validator(mode="after")
    def _check(self) -> Mirror:
        if self.scatter is not None and not hasattr(self.scatter, "tis_at"):
            refuse(("scatter",), self.scatter, "be a model of irtscots_cl.scatter")
        if not self.obscuration_mm < self.diameter_mm:
            refuse(("obscuration_mm",), self.obscuration_mm, f"be below diameter_mm ({self.diameter_mm!r})")
        if self.is_flat:
            for key in ("conic", "off_axis_mm"):
                if getattr(self, key) != 0.0:
                    refuse((key,), getattr(self, key), "be 0 for a flat mirror; a finite radius_mm makes it curved")
        rim_mm, curvature = self.off_axis_mm + self.diameter_mm / 2, 1.0 + self.conic
        if curvature > 0 and curvature * rim_mm * rim_mm >= self.radius_mm * self.radius_mm:
            reach_mm = abs(self.radius_mm) / math.sqrt(curvature)
            if reach_mm <= self.off_axis_mm:
                refuse(("off_axis_mm",), self.off_axis_mm, f"be below {reach_mm:.10g}, where the conic ends")
            limit_mm = 2 * (reach_mm - self.off_axis_mm)
            refuse(("diameter_mm",), self.diameter_mm, f"be below {limit_mm:.10g}, where the conic ends")
        for k, entry in enumerate(self.map):
            if not hasattr(entry, "outside"):
                refuse(("map", k), entry, "be a MirrorMap of irtscots_cl.scene.height_map")
        for k, terms in enumerate(self.zernike):
            if terms.radius_mm < self.diameter_mm / 2:
                must = f"be at least half of diameter_mm ({self.diameter_mm / 2!r}), to cover the mirror"
                refuse(("zernike", k, "radius_mm"), terms.radius_mm, must)
            if terms.radius_mm != self.zernike[0].radius_mm:
                must = f"be the first table's ({self.zernike[0].radius_mm!r}): all terms share one disk"
                refuse(("zernike", k, "radius_mm"), terms.radius_mm, must)
        return self

    @property
    def is_flat(self) -> bool:
        return math.isinf(self.radius_mm)

    def nominal(self) -> Mirror:
        """The mirror as designed, without its deviations."""
        return dataclasses.replace(self, zernike=(), map=())

    def parent_sag_mm(self, r_mm: float) -> float:
        """Height in mm of the parent above its vertex's plane, at r_mm from its axis; below 0 if it is convex."""
        root = math.sqrt(max(self.radius_mm**2 - (1.0 + self.conic) * r_mm * r_mm, 0.0))
        return r_mm * r_mm / (self.radius_mm + math.copysign(root, self.radius_mm))
