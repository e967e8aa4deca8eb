"""What a mirror's departures from its quadric need on a device: kernel files, structures and their values."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from irtscots_cl.maths.xy_polynomials import ChebyshevSeries, sum_of
from irtscots_cl.maths.zernike.series import PowerRows, RadialSeries, power_rows
from irtscots_cl.opencl.structs import (
    PRECISIONS,
    polynomial_dtype,
    zernike_clenshaw_dtype,
    zernike_power_dtype,
    zernike_term_dtype,
)
from irtscots_cl.optics.aim import screen_corners
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.departure import ZernikeDeparture
from irtscots_cl.optics.height_map import MapDeparture
from irtscots_cl.optics.polynomial import PolynomialDeparture
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.packing.maps import pack_maps

MAX_POWER_LOSS = 100.0  # sums of powers that lose more than two digits leave the deviation to Clenshaw's recurrence
MAX_NEWTON_STEPS = 8  # more than any departure needs that is still a mirror's
NEWTON_SLOPE = {"fp32": 1e-9, "fp64": 1e-13}  # rad, left by the last step; fp32's own rounding is 1e-8
SLIGHT_SLOPE = 1e-6  # 100 steps of a single-precision slope: larger ones are lost by less than 1e-3 on average


@dataclass(frozen=True)
class PackedDepartures:
    """Ready for the kernels.

    choices: family of kernel files -> member; structs: C structures, those that others contain first; constants: tables
    of the source; values: field of the scene's structure -> its value [()]; tables: [n] numbers that do not fit there.
    """

    choices: dict[str, str] = field(default_factory=dict)
    structs: dict[str, np.dtype] = field(default_factory=dict)
    constants: dict[str, tuple[int, ...]] = field(default_factory=dict)
    values: dict[str, np.ndarray] = field(default_factory=dict)
    tables: np.ndarray = field(default_factory=lambda: np.zeros(1))  # a buffer is never empty

    def add(self, choices, structs, constants, values) -> None:
        """Take up one kind of departure."""
        for mine, more in zip(
            (self.choices, self.structs, self.constants, self.values),
            (choices, structs, constants, values),
            strict=True,
        ):
            mine.update(more)


def pack_departures(surface: Surface, real) -> PackedDepartures:
    """The departures of a surface that has some."""
    packed = PackedDepartures(
        {"zernike": "none", "asphere": "none", "polynomial": "none", "map": "none", "approach": "slight"}
    )
    departures = surface.departures
    if surface.design:
        from irtscots_cl.tracing.packing import asphere  # imported late: few designs depart from their conics

        packed.choices["approach"] = "exact"
        departures = asphere.for_device(surface, real)
        for departure in departures:
            if isinstance(departure, asphere.AsphereDeparture):
                packed.add(*asphere.pack_asphere(departure, real))
    for departure in departures:  # at most one of each kind but of polynomials
        if isinstance(departure, ZernikeDeparture):
            packed.add(*_zernike(departure, real))
        elif isinstance(departure, MapDeparture):
            *parts, numbers = pack_maps(departure, real, len(packed.tables))
            packed.add(*parts)
            packed = replace(packed, tables=np.concatenate([packed.tables, numbers], dtype=real))
    polynomials = [departure.series for departure in surface.departures if isinstance(departure, PolynomialDeparture)]
    if polynomials:
        packed.add(*polynomial_parts(sum_of(polynomials), real))
    return packed


def polynomial_parts(series: ChebyshevSeries, real):
    """Choices, structures, constants and values for kernels/mirror/polynomial_chebyshev.cl."""
    rows, columns = series.coefficient.shape
    out = np.zeros((), polynomial_dtype(real, rows, columns))
    out["coefficient"] = series.coefficient
    for axis, centre_mm, half_mm in zip("xy", series.centre_mm, series.half_size_mm, strict=True):
        out[f"centre_{axis}"], out[f"inverse_half_{axis}"] = centre_mm, 1 / half_mm
    count = tuple(int(np.flatnonzero(row).max(initial=-1)) + 1 for row in series.coefficient)
    structs, constants = {"Polynomial": out.dtype}, {"polynomial_count": count}
    return {"polynomial": "chebyshev"}, structs, constants, {"polynomial": out}


def _zernike(departure: ZernikeDeparture, real):
    rows = power_rows(departure.series)
    few = rows.loss <= MAX_POWER_LOSS
    tables, structs, constants = _power(rows, real) if few else _clenshaw(departure.series, real)
    tables["inverse_radius"] = 1 / departure.radius_mm
    choices = {"zernike": "power" if few else "clenshaw"}
    return choices, structs | {"Zernike": tables.dtype}, constants, {"zernike": tables}


def _power(rows: PowerRows, real):
    """Tables [()], structures that they contain, and constants for kernels/mirror/zernike_power.cl."""
    out = np.zeros((), zernike_power_dtype(real, len(rows.coefficient)))
    out["coefficient"] = rows.coefficient
    constants = {f"zernike_{name}": tuple(getattr(rows, name)) for name in ("order", "sine", "count")}
    return out, {}, constants | {"zernike_most": (max(rows.count),)}


def _clenshaw(series: RadialSeries, real):
    """Tables [()], structures that they contain, and constants for kernels/mirror/zernike_clenshaw.cl."""
    out = np.zeros((), zernike_clenshaw_dtype(real, len(series.m), len(series.cosine)))
    for name in ("cosine", "sine", "alpha", "beta"):
        out["term"][name] = getattr(series, name)
    # the next term's gamma; at the end of a series it multiplies zero
    out["term"]["gamma_next"] = np.append(series.gamma[1:], 0.0)
    out["order"], out["count"], out["series_count"] = series.m, series.count, len(series.m)
    return out, {"ZernikeTerm": zernike_term_dtype(real)}, {}


def _spread(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Points (x, y) [n] over a mirror with departures, close enough to find their extremes; many on the rim."""
    points = [departure.spread(surface.aperture_radius_mm) for departure in surface.departures]
    return np.concatenate([x for x, _ in points]), np.concatenate([y for _, y in points])


def is_slight(surface: Surface, precision: str) -> bool:
    """Whether single precision would lose the departures' slopes in the sum with the quadric's."""
    if not surface.departures or precision != "fp32":
        return False
    return max(np.abs(slope).max() for slope in surface.departure_at(*_spread(surface))[1:]) < SLIGHT_SLOPE


def newton_steps(chief: ChiefRays, slope: float, real=np.float64) -> int:
    """Steps from the quadric to the surface that leave at most that slope error [rad], found by trial.

    The kernel takes the departures' slopes before its last move, so k steps have the slopes of k - 1 moves.
    """
    surface = chief.surface
    x, y = _spread(surface)
    points = np.stack([x, y, surface.quadric.meet(x, y, 0.0, 0.0)], -1)
    left = np.zeros(MAX_NEWTON_STEPS - 1)
    places = [chief.camera_frame.position_mm, chief.screen_frame.position_mm]
    start = None
    if surface.design:  # large departures: the most oblique light needs the most steps
        from irtscots_cl.tracing.packing.asphere import guess  # imported late: few designs have departures

        places.extend(screen_corners(chief))
        start = guess(surface, real)
    for place in places:
        met = [surface.meet(points, points - place, moves, start)[0] for moves in range(MAX_NEWTON_STEPS)]
        slopes = [np.stack(surface.departure_at(at[:, 0], at[:, 1])[1:]) for at in met]
        left = np.maximum(left, [np.nanmax(np.abs(found - slopes[-1])) for found in slopes[:-1]])
    enough = np.flatnonzero(left <= slope)
    if surface.design and not len(enough):
        must = f"lie near enough to its conic for rays to reach it in {MAX_NEWTON_STEPS} steps from there"
        raise SceneError(f"scene {chief.scene.name}: mirror: must {must}")
    return int(enough[0]) + 1 if len(enough) else MAX_NEWTON_STEPS


def mirror_values(chief: ChiefRays) -> dict[str, float]:
    """Fields of the mirror's structure -> their values."""
    return {"departure_radius2": _departure_radius2(chief)}


def mirror_constants(chief: ChiefRays, precision: str) -> dict[str, tuple[int, ...]]:
    """Constants of the source: the kernels' steps to the surface, so that their loop unrolls."""
    return {"newton_steps": (newton_steps(chief, NEWTON_SLOPE[precision], PRECISIONS[precision]),)}


def _departure_radius2(chief: ChiefRays) -> float:
    """Square of the radius beyond which no line that meets the quadric meets the mirror."""
    beside = 1.04 * chief.surface.departure_radius_mm**2
    if not chief.surface.design:
        return beside
    from irtscots_cl.tracing.packing.asphere import quadric_radius_mm  # imported late: few designs have departures

    return max(beside, quadric_radius_mm(chief) ** 2)
