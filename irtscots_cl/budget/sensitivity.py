"""One source at a time: the height map per unit of its value, and up to which value it grows in proportion.

Of a parameter the map is signed; its derivative is exact. Of a constant it is that of its value, over the value. Of a
process it is random: what is stated is the rms over maps and draws, with its standard error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.budget.geometry import Geometry, geometry_derivatives
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.procedure import Procedure
from irtscots_cl.budget.source import Draw, Kind, Source, lit_changes
from irtscots_cl.calibration.height_response import LEFT_AFTER
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.row_products import dots_of_rows
from irtscots_cl.scene.validation import SceneError

DRAWS = 32  # of a process: its rms to 12 %
MANY_DRAWS = 512  # of one whose intervals are wanted: standard deviations to 3 %
DIFFERENCE = 1e-3  # of the usual value, for derivatives by differences
NONLINEAR = 0.01  # share of the height, piston and tilt removed, out of proportion to the value, where linearity ends
NOTHING_MM = 1e-10  # rms height: a source that does nothing but rounding
SMALLER = 7  # values that are tried, each a tenth of the one before, until every pixel sees light
NM = 1e6


@dataclass(frozen=True)
class Sensitivity:
    """Of one source, per unit of its value.

    height_mm: [n] of a parameter or a constant; [draws, n] of a process. left_nm: [4] rms with
    height_response.LEFT_AFTER removed. zernike_nm: [terms] of NOLLS; of a process their rms. error: relative standard
    error of these; 0 where nothing is random. linear_to: value from which more than NONLINEAR of the height, piston
    and tilt removed, is not in proportion; inf for constants and processes, which are taken at their own size.
    """

    source: Source
    height_mm: FloatArray = field(repr=False)
    left_nm: FloatArray
    zernike_nm: FloatArray = field(repr=False)
    error: float
    linear_to: float


def sensitivities(
    design: MeasuredDesign,
    sources: Sequence[Source],
    draws: int = DRAWS,
    procedure: Procedure | None = None,
    sizes: Mapping[str, float] | None = None,
) -> list[Sensitivity]:
    """Of all sources, from closed-form derivatives of the places where there are any. draws: of each process.

    procedure: what is made of the height maps; nothing by default. sizes: by name, values at which constants and
    processes are taken; the usual ones by default.
    """
    procedure, sizes = procedure or Procedure(design), sizes or {}
    parameters = [source for source in sources if source.kind is Kind.PARAMETER]
    found = {one.source.name: one for one in _of_parameters(procedure, parameters)}
    for source in sources:
        value = sizes.get(source.name, source.usual)
        if source.kind is Kind.CONSTANT:
            found[source.name] = _of_constant(procedure, source, value)
        elif source.kind.is_random:
            found[source.name] = _of_process(procedure, source, value, draws)
    return [found[source.name] for source in sources]


def _of_parameters(procedure: Procedure, sources: Sequence[Source]) -> list[Sensitivity]:
    if not sources:
        return []
    design, draw = procedure.design, Draw(0, 0)  # parameters take no random numbers
    names = [source.name for source in sources if isinstance(source, Geometry)]
    exact = dict(zip(names, geometry_derivatives(design, names), strict=True)) if names else {}
    places, both, reached = [], [], []
    for source in sources:
        small = DIFFERENCE * source.usual
        if (derivative := exact.get(source.name)) is None:
            up, down = (source.changes_mm(design, sign * small, draw) for sign in (1, -1))
            derivative = (up - down) / (2 * small)
        places.append(derivative)
        value, up_down = _seen(design, source)
        both += up_down
        reached.append(value)
    heights = design.response.heights_mm(np.stack(places))
    of_both = design.heights_mm(np.stack(both)).reshape(len(sources), 2, -1)
    heights, of_both = (
        np.stack([procedure.of_parameter(source, one) for source, one in zip(sources, maps, strict=True)])
        for maps in (heights, of_both)
    )
    left = design.response.left(heights) * NM
    terms = zernike_coefficients(design, heights) * NM
    level, both_level = (design.response.without(maps, LEFT_AFTER[0]) for maps in (heights, of_both))
    return [
        Sensitivity(source, heights[k], left[k], terms[k], 0.0, _linear_to(reached[k], level[k], both_level[k]))
        for k, source in enumerate(sources)
    ]


def _seen(design: MeasuredDesign, source: Source) -> tuple[float, list[FloatArray]]:
    """A value, the usual one or smaller, at plus and minus which every pixel sees light, and the changes [2, n] there.

    Raises SceneError or ValueError if there is none.
    """
    for k in range(SMALLER):
        value = source.usual / 10**k
        try:
            changes = [source.changes_mm(design, sign * value, Draw(0, 0)) for sign in (1, -1)]
        except SceneError:
            if k == SMALLER - 1:
                raise
            continue
        if np.isfinite(changes).all():
            return value, changes
    raise ValueError(f"source {source.name}: pixels see no light of the screen at {value:g} {source.unit}")


def _linear_to(usual: float, height_mm: FloatArray, up_down_mm: FloatArray) -> float:
    """From heights [2, n] at plus and minus a value, the usual one if nothing hinders.

    The even part grows with its square, the odd's excess with its cube.
    """
    size = float(np.sqrt(np.mean(height_mm**2))) * usual
    even = float(np.sqrt(np.mean((up_down_mm[0] + up_down_mm[1]) ** 2))) / 2
    odd = float(np.sqrt(np.mean(((up_down_mm[0] - up_down_mm[1]) / 2 - height_mm * usual) ** 2)))
    if max(size, even, odd) < NOTHING_MM:
        return np.inf
    limits = (NONLINEAR * size / max(even, NOTHING_MM), np.sqrt(NONLINEAR * size / max(odd, NOTHING_MM)))
    return float(usual * min(limits))


def _of_constant(procedure: Procedure, source: Source, value: float) -> Sensitivity:
    design = procedure.design
    whole = design.response.heights_mm(lit_changes(source, design, value, Draw(0, 0))[0][None])
    heights = procedure.of_parameter(source, whole) / value
    left, terms = design.response.left(heights) * NM, zernike_coefficients(design, heights) * NM
    return Sensitivity(source, heights[0], left[0], terms[0], 0.0, np.inf)


def _of_process(procedure: Procedure, source: Source, value: float, draws: int) -> Sensitivity:
    design = procedure.design
    heights = np.concatenate([
        design.response.heights_mm(
            np.stack([
                lit_changes(source, design, value, Draw(0, k))[0] for k in range(first, min(first + DRAWS, draws))
            ])
        )
        / value
        for first in range(0, draws, DRAWS)
    ])  # fmt: skip
    heights = procedure.of_draws(source, heights)
    squares = design.response.left(heights) ** 2
    left = np.sqrt(squares.mean(0))
    mean = float(squares[:, 0].mean())
    error = float(squares[:, 0].std(ddof=1) / np.sqrt(draws) / mean / 2) if mean > 0 else 0.0
    terms = np.sqrt(np.mean(zernike_coefficients(design, heights) ** 2, axis=0))
    return Sensitivity(source, heights, left * NM, terms * NM, error, np.inf)


def zernike_coefficients(design: MeasuredDesign, heights: FloatArray) -> FloatArray:
    """Coefficients [..., terms] of NOLLS, fitted together, of heights [..., n], in their unit."""
    return dots_of_rows(heights, design.zernike_fit)
