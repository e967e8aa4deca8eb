"""Polynomials in x and y above a mirror's conic: the tables [[mirror.polynomial]].

Only scenes with such a table import this module.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from irtscots_cl.scene.validation import OffsetMm, PositiveMm, array_of, checked, refuse

MAX_POWER = 30  # along each axis
MAX_SIZE_MM = 100_000  # of the sum of the terms' magnitudes: rounding, 1e-16 of it, stays below 0.02 nm
_Power = Annotated[int, Strict(), Field(ge=0, le=MAX_POWER)]
_Value = Annotated[float, Strict(), Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
_TERMS = f"an array of [i, j, value]: whole numbers from 0 to {MAX_POWER}, and a finite number within 1e6"
HalfSizeMm = Annotated[
    Annotated[tuple[PositiveMm, PositiveMm], *array_of("")] | None,
    Field(description="[x, y], two lengths from 1e-12 to 1e+12"),
]
Terms = Annotated[tuple[tuple[_Power, _Power, _Value], ...], *array_of(_TERMS)]


@checked("polynomial")
class Polynomial:
    """A height along z: the sum of value B_i(u) B_j(v) over the terms (i, j, value).

    basis: T_n of Chebyshev, P_n of Legendre, or powers. u, v: (x, y - centre_mm) over half_size_mm. coefficients_um: of
    these; coefficients_mm: of powers of mm, without half_size_mm, in mm^(1 - i - j). part: "deviation" of the mirror as
    made, or "design".

    Raises SceneError for a value that is not allowed.
    """

    basis: Annotated[Literal["chebyshev", "legendre", "monomial"],
                     Field(description="one of chebyshev, legendre, monomial")]  # fmt: skip
    half_size_mm: HalfSizeMm = None
    centre_mm: OffsetMm = (0.0, 0.0)
    coefficients_um: Terms = ()
    coefficients_mm: Terms = ()
    part: Annotated[Literal["deviation", "design"], Field(description="one of deviation, design")] = "deviation"

    @model_validator(mode="after")
    def _check(self) -> Polynomial:
        key = "coefficients_um" if self.coefficients_um else "coefficients_mm"
        if bool(self.coefficients_um) == bool(self.coefficients_mm):
            must = "be given, or coefficients_mm of a monomial basis, and not both"
            refuse(("coefficients_um",), self.coefficients_um, must)
        if self.coefficients_mm and self.basis != "monomial":
            refuse(("coefficients_mm",), self.coefficients_mm, "be coefficients_um: only monomials have powers of mm")
        if self.coefficients_um and self.half_size_mm is None:
            refuse(("half_size_mm",), None, "be given with coefficients_um")
        if self.coefficients_mm and self.half_size_mm is not None:
            refuse(("half_size_mm",), self.half_size_mm, "be left out with coefficients_mm")
        powers = [(i, j) for i, j, _ in getattr(self, key)]
        twice = next((pair for k, pair in enumerate(powers) if pair in powers[:k]), None)
        if twice is not None:
            refuse((key,), list(twice), "have every pair of powers once")
        return self

    def rectangle_mm(self, rim_mm: float) -> tuple[float, float]:
        """Halves of the sides of the rectangle about centre_mm that the terms are summed over."""
        x, y = self.centre_mm
        return self.half_size_mm or (rim_mm + abs(x), rim_mm + abs(y))

    def terms_mm(self, rim_mm: float) -> list[tuple[int, int, float]]:
        """Terms (i, j, mm) of u and v that run from -1 to 1 over that rectangle. Raises OverflowError."""
        if self.coefficients_um:
            return [(i, j, value * 1e-3) for i, j, value in self.coefficients_um]
        half_x, half_y = self.rectangle_mm(rim_mm)
        return [(i, j, value * half_x**i * half_y**j) for i, j, value in self.coefficients_mm]


def check_polynomials(tables: tuple[Polynomial, ...], rim_mm: float) -> None:
    """Raise the error that a checked dataclass turns into a SceneError, if a table is not right for a mirror's rim."""
    for k, table in enumerate(tables):
        if not isinstance(table, Polynomial):
            refuse(("polynomial", k), table, "be a Polynomial of irtscots_cl.scene.polynomial")
        half = table.rectangle_mm(rim_mm)
        least = tuple(rim_mm + abs(middle) for middle in table.centre_mm)
        if half[0] < least[0] or half[1] < least[1]:
            refuse(("polynomial", k, "half_size_mm"), half, f"be at least {list(least)}, to cover the mirror")
        try:
            size_mm = math.fsum(abs(value) for _, _, value in table.terms_mm(rim_mm))
        except OverflowError:
            size_mm = math.inf
        if size_mm > MAX_SIZE_MM:
            key = "coefficients_um" if table.coefficients_um else "coefficients_mm"
            must = f"have terms whose magnitudes add up to at most {MAX_SIZE_MM} mm on the mirror"
            refuse(("polynomial", k, key), f"{size_mm:.3g} mm", must)
