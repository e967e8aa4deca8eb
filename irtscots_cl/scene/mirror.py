"""The mirror of a scene: a conic with Zernike deviations."""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, model_validator

from irtscots_cl.scene.validation import (
    Coefficients,
    Conic,
    Fraction,
    MirrorRadiusMm,
    NonNegativeMm,
    PositiveMm,
    bounded,
    checked,
    refuse,
)

MAX_RADIAL_ORDER = 40
MAX_GROWTH = 10_000  # of an annular term from its ring, where it is about 1, to the middle of the hole


_HOLE = bounded(ge=0, lt=1)


def _radial_order(ordering: str, index: int) -> int:
    """Radial order n of a term; fringe group g = (n + |m|) / 2 has 2 g + 1 terms, n from g to 2 g."""
    if ordering == "fringe":
        group = math.isqrt(index - 1)
        return group + (index - 1 - group * group) // 2
    return (math.isqrt(8 * (index - (ordering == "noll")) + 1) - 1) // 2


def _azimuthal_order(ordering: str, index: int) -> int:
    """|m| of a term."""
    n = _radial_order(ordering, index)
    if ordering == "fringe":
        return 2 * math.isqrt(index - 1) - n
    within = index - (ordering == "noll") - n * (n + 1) // 2
    return abs(2 * within - n) if ordering == "osa" else n % 2 + 2 * ((within + 1 - n % 2) // 2)


def _growth(ordering: str, index: int, obscuration: float) -> float:
    """About how much larger an annular term is in the middle of the hole than on its ring, but for rho^m."""
    steps = (_radial_order(ordering, index) - _azimuthal_order(ordering, index)) // 2
    return math.exp(min(steps * math.log((1 + obscuration) / (1 - obscuration)), 700.0)) / 2


@checked("zernike")
class ZernikeTerms:
    """Deviation from the nominal surface, in um, on the disk of `radius_mm` about the mirror's centre.

    obscuration: above 0 for Mahajan's terms of the ring outside that share of the radius (maths/zernike/annular.py).
    """

    radius_mm: PositiveMm
    ordering: Annotated[Literal["noll", "fringe", "osa"], Field(description="one of noll, fringe, osa")]
    coefficients_um: Coefficients
    obscuration: Annotated[float, Strict(), _HOLE] = 0.0

    @model_validator(mode="after")
    def _check(self) -> ZernikeTerms:
        lowest, highest = {"noll": (1, 861), "fringe": (1, 1602), "osa": (0, 860)}[self.ordering]
        for index, value in self.coefficients_um.items():
            if not lowest <= index <= highest or _radial_order(self.ordering, index) > MAX_RADIAL_ORDER:
                must = f"have a {self.ordering} index from {lowest} to {highest}"
                must += f", of radial order at most {MAX_RADIAL_ORDER}"
                refuse(("coefficients_um", index), value, must)
            if self.obscuration and _growth(self.ordering, index, self.obscuration) > MAX_GROWTH:
                must = f"be so small that no term grows {MAX_GROWTH}-fold in the hole, as {index} does"
                refuse(("obscuration",), self.obscuration, must)
        return self

    def __hash__(self) -> int:  # a dict has none
        return hash((self.radius_mm, self.ordering, frozenset(self.coefficients_um.items()), self.obscuration))


@checked("mirror")
class Mirror:
    """A conic of revolution, or an off-axis piece of one, with a round rim and a round central hole, or an outline.

    radius_mm: at the parent's vertex; above 0 concave towards +Z, below 0 convex, inf flat. asphere: a
    scene.asphere.Asphere that the design adds to the conic, or None.
    """

    radius_mm: MirrorRadiusMm
    diameter_mm: PositiveMm
    conic: Conic = 0.0
    off_axis_mm: NonNegativeMm = 0.0
    obscuration_mm: NonNegativeMm = 0.0
    reflectance: Fraction = 1.0
    zernike: Annotated[tuple[ZernikeTerms, ...], Field(description="tables [[mirror.zernike]]")] = ()
    scatter: Annotated[Any, Field(description="a table [mirror.scatter]")] = None
    polynomial: Annotated[tuple[Any, ...], Field(description="tables [[mirror.polynomial]]")] = ()
    asphere: Annotated[Any, Field(description="a table [mirror.asphere]")] = None
    outline: Annotated[Any, Field(description="a table [mirror.outline]")] = None

    @model_validator(mode="after")
    def _check(self) -> Mirror:
        if self.outline is not None and not hasattr(self.outline, "check_within"):
            refuse(("outline",), self.outline, "be an Outline of irtscots_cl.scene.outline")
        if self.scatter is not None and not hasattr(self.scatter, "tis_at"):
            refuse(("scatter",), self.scatter, "be a model of irtscots_cl.scatter")
        if not self.obscuration_mm < self.diameter_mm:
            refuse(("obscuration_mm",), self.obscuration_mm, f"be below diameter_mm ({self.diameter_mm!r})")
        if self.outline is not None:
            self.outline.check_within(self.diameter_mm, self.obscuration_mm)
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
        if self.asphere is not None:
            if not hasattr(self.asphere, "check_on"):
                refuse(("asphere",), self.asphere, "be an Asphere of irtscots_cl.scene.asphere")
            self.asphere.check_on(self)
        for k, terms in enumerate(self.zernike):
            if terms.radius_mm < self.diameter_mm / 2:
                must = f"be at least half of diameter_mm ({self.diameter_mm / 2!r}), to cover the mirror"
                refuse(("zernike", k, "radius_mm"), terms.radius_mm, must)
        if self.polynomial:
            from irtscots_cl.scene.polynomial import check_polynomials  # imported late: few scenes have any

            check_polynomials(self.polynomial, self.diameter_mm / 2)
        return self

    @property
    def is_flat(self) -> bool:
        return math.isinf(self.radius_mm)

    def nominal(self) -> Mirror:
        """The mirror as designed, without its deviations."""
        design = tuple(table for table in self.polynomial if table.part == "design")
        return dataclasses.replace(self, zernike=(), polynomial=design)

    def parent_sag_mm(self, r_mm: float) -> float:
        """Height in mm of the parent above its vertex's plane, at r_mm from its axis; below 0 if it is convex."""
        root = math.sqrt(max(self.radius_mm**2 - (1.0 + self.conic) * r_mm * r_mm, 0.0))
        sag_mm = r_mm * r_mm / (self.radius_mm + math.copysign(root, self.radius_mm))
        return sag_mm if self.asphere is None else sag_mm + float(self.asphere.height_mm(r_mm, self.radius_mm))
