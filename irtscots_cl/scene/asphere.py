"""Aspheric terms of a mirror's design: the table [mirror.asphere].

Only scenes with this table import this module. The sag of the parent, at r from its axis, is

    z(r) = r^2 / (R (1 + sqrt(1 - (1 + k) r^2 / R^2))) + sum_n a_n r^n
           + u^4 sum_m c_m Qcon_m(u^2) + u^2 (1 - u^2) / sqrt(1 - r^2 / R^2) sum_m b_m Qbfs_m(u^2)

with u = r / normalisation_radius_mm.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Annotated

from pydantic import BeforeValidator, Field, Strict, model_validator

from irtscots_cl.maths.forbes import sum_q_bfs, sum_q_con
from irtscots_cl.scene.validation import OptionalMm, checked, refuse

if TYPE_CHECKING:
    from irtscots_cl.scene.mirror import Mirror

POWERS = (2, 20)  # r itself is a cone, without a normal at the vertex
MAX_Q_TERM = 18  # r^40, the highest radial order of Zernike terms
MAX_COEFFICIENT = 1e6
MAX_SLOPE = 1.0  # of the terms over the mirror: 45 degrees
RINGS = 256  # of the parent, between its axis and the mirror's far edge, where slopes are looked at


def _keyed_by(lowest: int, highest: int, what: str) -> BeforeValidator:
    """Takes a table whose keys are integers, in a file as text."""

    def check(table: object) -> object:
        if not isinstance(table, dict) or not table:
            return table
        found = {}
        for key, value in table.items():
            number = int(key) if isinstance(key, str) and re.fullmatch("0|[1-9][0-9]{0,5}", key) else key
            if isinstance(number, bool) or not isinstance(number, int) or not lowest <= number <= highest:
                refuse((key,), value, f"have {what} from {lowest} to {highest} as its key")
            if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= MAX_COEFFICIENT:
                refuse((key,), value, f"be a finite number within {MAX_COEFFICIENT:g}")
            found[number] = float(value)
        return found

    return BeforeValidator(check)


_Terms = dict[Annotated[int, Strict()], Annotated[float, Strict()]]
_POWERS_TEXT = f"a table {{ power = mm^(1 - power) }} of at least one power of r from {POWERS[0]} to {POWERS[1]}"
_Q_TEXT = f"a table {{ m = micrometres }} of at least one term from 0 to {MAX_Q_TERM}"
Powers = Annotated[_Terms, _keyed_by(*POWERS, "a power"), Field(min_length=1)]
QTerms = Annotated[_Terms, _keyed_by(0, MAX_Q_TERM, "an index m"), Field(min_length=1)]
OptionalPowers = Annotated[Powers | None, Field(description=_POWERS_TEXT)]
OptionalQTerms = Annotated[QTerms | None, Field(description=_Q_TEXT)]


@checked("asphere")
class Asphere:
    """What the design's parent adds to its conic, along its axis.

    coefficients_mm: a_n of r^n [mm^(1-n)], r in mm from the parent's axis; q_con_um, q_bfs_um: coefficients of Forbes's
    terms [um], over normalisation_radius_mm; those of q_bfs are along the normal of the best-fit sphere, which is the
    mirror's radius_mm with conic 0.

    Raises SceneError for a value that is not allowed.
    """

    coefficients_mm: OptionalPowers = None
    q_con_um: OptionalQTerms = None
    q_bfs_um: OptionalQTerms = None
    normalisation_radius_mm: OptionalMm = None

    @model_validator(mode="after")
    def _check(self) -> Asphere:
        if self.coefficients_mm is None and not self.has_q:
            refuse(("coefficients_mm",), self.coefficients_mm, "be given, or q_con_um or q_bfs_um")
        if self.has_q and self.normalisation_radius_mm is None:
            key = "q_con_um" if self.q_con_um else "q_bfs_um"
            refuse((key,), getattr(self, key), "come with normalisation_radius_mm")
        if not self.has_q and self.normalisation_radius_mm is not None:
            must = "be left out without q_con_um or q_bfs_um"
            refuse(("normalisation_radius_mm",), self.normalisation_radius_mm, must)
        return self

    def __hash__(self) -> int:  # dicts have none
        tables = (self.coefficients_mm, self.q_con_um, self.q_bfs_um)
        return hash((self.normalisation_radius_mm, *(frozenset((table or {}).items()) for table in tables)))

    @property
    def has_q(self) -> bool:
        return self.q_con_um is not None or self.q_bfs_um is not None

    @property
    def is_even(self) -> bool:
        """Whether it is a function of r^2 without odd powers."""
        return all(n % 2 == 0 for n in self.coefficients_mm or ())

    @property
    def degree(self) -> int:
        """Of over_square as a polynomial in r, but for the square root of Qbfs terms."""
        q = max([*(self.q_con_um or ()), *(self.q_bfs_um or ())], default=-1)
        return max([n - 2 for n in self.coefficients_mm or ()] + [2 * q + 2])

    def height_mm(self, r_mm: float, radius_mm: float) -> float:
        """What is added to the conic of vertex radius radius_mm at r_mm from the parent's axis [mm]."""
        return self.over_square(r_mm, radius_mm) * r_mm * r_mm

    def over_square(self, r_mm: float, radius_mm: float) -> float:
        """height_mm over r^2 [1/mm]: finite at the axis."""
        total = 0.0
        powers = self.coefficients_mm or {}
        for n in range(max(powers, default=0), 1, -1):
            total = total * r_mm + powers.get(n, 0.0)
        if self.normalisation_radius_mm is not None:
            scale = 1.0 / self.normalisation_radius_mm
            x = (r_mm * scale) ** 2
            q = x * sum_q_con(self.q_con_um or {}, x)
            if self.q_bfs_um is not None:
                q += (1.0 - x) * sum_q_bfs(self.q_bfs_um, x) / math.sqrt(1.0 - (r_mm / radius_mm) ** 2)
            total += 1e-3 * scale * scale * q
        return total

    def slope(self, r_mm: float, radius_mm: float, step_mm: float) -> float:
        """Slope by r of height_mm, by a central difference: for checks."""
        rise = self.height_mm(r_mm + step_mm / 2, radius_mm) - self.height_mm(r_mm - step_mm / 2, radius_mm)
        return rise / step_mm

    def check_on(self, mirror: Mirror) -> None:
        """Refuse, as a checked dataclass does, terms that do not fit the mirror."""
        rim_mm = mirror.off_axis_mm + mirror.diameter_mm / 2
        if self.normalisation_radius_mm is not None and self.normalisation_radius_mm < rim_mm:
            must = f"be at least {rim_mm:.10g}, the distance of the mirror's edge from the parent's axis"
            refuse(("asphere", "normalisation_radius_mm"), self.normalisation_radius_mm, must)
        if self.q_bfs_um is not None:
            if mirror.conic != 0.0:
                refuse(("conic",), mirror.conic, "be 0 with asphere.q_bfs_um, whose terms are of a best-fit sphere")
            if not (self.normalisation_radius_mm or 0.0) < abs(mirror.radius_mm):
                must = "be below radius_mm's magnitude, where the best-fit sphere ends"
                refuse(("asphere", "normalisation_radius_mm"), self.normalisation_radius_mm, must)
        near_mm = max(mirror.off_axis_mm - mirror.diameter_mm / 2, 0.0)
        step_mm = (rim_mm - near_mm) / RINGS
        worst = 0.0
        for k in range(RINGS):
            slope = abs(self.slope(near_mm + (k + 0.5) * step_mm, mirror.radius_mm, step_mm))
            if not slope <= worst:  # NaN, too
                worst = slope
        if not worst <= MAX_SLOPE:
            key = "coefficients_mm" if self.coefficients_mm else "q_con_um" if self.q_con_um else "q_bfs_um"
            must = f"have slopes below {MAX_SLOPE:g} on the mirror, not {worst:.3g}"
            refuse(("asphere", key), getattr(self, key), must)
