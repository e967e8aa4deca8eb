"""What a mirror's aspheric terms need on a device: kernel files, structures and their values.

Terms about the mirror's own axis are a polynomial there. Off the axis, the departure is a smooth function of x and y
without a closed form; with the mirror's Zernike deviation it becomes one Zernike series over the mirror.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev
from scipy.special import eval_jacobi

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.zernike.polynomials import normalisation
from irtscots_cl.maths.zernike.series import radial_series
from irtscots_cl.opencl.structs import ABOUT, asphere_dtype
from irtscots_cl.optics.aim import mirror_rings, screen_corners
from irtscots_cl.optics.asphere import AsphereDeparture, SegmentDeparture
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.departure import Departure, ZernikeDeparture, polar_points
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.validation import SceneError

MAX_POWER_LOSS = 100.0  # of sums of powers over their largest value: two digits
SMALL_SLOPE = {4: 1e-8, 8: 1e-12}  # bytes of a real -> error [rad] from which the loss counts
ORDERS = (12, 20, 28, 36, 40)  # radial, of fitted series
FIT_HEIGHT_MM = 1e-9
FIT_SLOPE = 1e-11  # rad
LEAST_MM = 1e-14  # of a coefficient: smaller ones are rounding
CHECK_RADII = 201
CHECK_ANGLES = 41  # of the points between those of the fit
BEYOND_RIM = 1.005  # radius of the quadric's disk that light for the mirror meets, over that found for some of it


def for_device(surface: Surface, real) -> tuple[Departure, ...]:
    """A surface's departures, the aspheric ones of a kind that kernels know.

    Raises SceneError for aspheric terms that a Zernike series of the highest order does not follow.
    """
    mine = [d for d in surface.design if isinstance(d, AsphereDeparture | SegmentDeparture)]
    if not any(isinstance(d, SegmentDeparture) or _loses(d, real) for d in mine):
        return surface.departures
    mine.extend(d for d in surface.departures if isinstance(d, ZernikeDeparture))  # kernels take one series
    others = tuple(d for d in surface.departures if d not in mine)
    return (_as_zernike(mine, surface.aperture_radius_mm), *others)


def pack_asphere(departure: AsphereDeparture, real):
    """Choices, structures, constants and values for kernels/mirror/asphere_even.cl or asphere_odd.cl."""
    powers = chebyshev.cheb2poly(departure.profile.series)
    pairs = np.append(powers, np.zeros(len(powers) % 2)).reshape(-1, 2)[::-1]
    out = np.zeros((), asphere_dtype(real, len(pairs)))
    out["inverse_radius"], out["coefficient"] = 1 / departure.profile.scale_mm, pairs
    out["about"] = _about(departure)
    return {"asphere": "even" if departure.profile.even else "odd"}, {"Asphere": out.dtype}, {}, {"asphere": out}


def _about(departure: AsphereDeparture) -> FloatArray:
    """Coefficients [ABOUT] of powers of s, highest first, whose sum times s is nearly the height over the mirror."""
    radius = np.linspace(0, departure.radius_mm, CHECK_RADII)
    powers = ((radius / departure.profile.scale_mm) ** 2)[:, None] ** np.arange(ABOUT, 0, -1)
    found: FloatArray = np.linalg.lstsq(powers, departure.at(radius, 0 * radius)[0], rcond=None)[0]
    return found


def guess(surface: Surface, real) -> Callable[[FloatArray, FloatArray], FloatArray] | None:
    """The height from which kernels/mirror/approach_exact.cl sets out; None for 0."""
    for departure in for_device(surface, real):
        if isinstance(departure, AsphereDeparture):
            about, scale = np.append(_about(departure), 0.0), departure.profile.scale_mm
            return lambda x, y: np.polyval(about, (x * x + y * y) / scale**2)
    return None


def _loses(departure: AsphereDeparture, real) -> bool:
    """Whether sums of powers would lose too many digits of a departure's slopes."""
    profile = departure.profile
    powers = np.abs(chebyshev.cheb2poly(profile.series))
    rounding = np.finfo(real).eps * float(((2 + 4 * np.arange(len(powers))) * powers).sum()) / profile.scale_mm
    if rounding <= SMALL_SLOPE[np.dtype(real).itemsize]:
        return False
    radius = np.linspace(0, departure.radius_mm, CHECK_RADII)
    return rounding > MAX_POWER_LOSS * np.finfo(real).eps * float(np.abs(profile.at(radius, 0 * radius)[1]).max())


def _as_zernike(departures: list[Departure], radius_mm: float) -> ZernikeDeparture:
    """The sum of departures as one Zernike series over a mirror."""
    rings = polar_points(radius_mm, CHECK_ANGLES)
    right = _sum(departures, *rings)
    for order in ORDERS:
        found = ZernikeDeparture(radial_series(_project(departures, radius_mm, order)), radius_mm)
        left = [np.abs(a - b).max() for a, b in zip(found.at(*rings), right, strict=True)]
        if left[0] <= FIT_HEIGHT_MM and max(left[1:]) <= FIT_SLOPE:
            return found
    must = f"be followed to {FIT_HEIGHT_MM:g} mm and {FIT_SLOPE:g} rad by Zernike terms of radial order {ORDERS[-1]}"
    why = "off the axis, or where powers of r cancel in single precision"
    raise SceneError(f"mirror.asphere: must {must} {why}; they leave {left[0]:.2g} mm, {max(left[1:]):.2g} rad")


def _sum(departures: list[Departure], x_mm: FloatArray, y_mm: FloatArray) -> list[FloatArray]:
    """Height [mm] and slopes of the sum of departures."""
    return [np.sum(each, axis=0) for each in zip(*(d.at(x_mm, y_mm) for d in departures), strict=True)]


def _project(departures: list[Departure], radius_mm: float, order: int) -> dict[tuple[int, int], float]:
    """Coefficients [mm] of Noll-normalised terms (n, m) up to a radial order, by quadrature over the disk."""
    nodes, weights = np.polynomial.legendre.leggauss(order + 8)
    count = 2 * order + 16
    rho, angle = np.sqrt((nodes + 1) / 2), np.arange(count) * (2 * math.pi / count)
    x, y = radius_mm * np.outer(rho, np.cos(angle)), radius_mm * np.outer(rho, np.sin(angle))
    waves = np.fft.rfft(_sum(departures, x, y)[0], axis=1) / count
    found = {}
    for m in range(order + 1):
        for k in range((order - m) // 2 + 1):
            radial = weights / 2 * normalisation(m + 2 * k, m) * rho**m * eval_jacobi(k, 0, m, nodes)
            for signed, wave in ((m, waves[:, m].real), (-m, -waves[:, m].imag))[: 1 + (m > 0)]:
                value = float(radial @ wave)
                if abs(value) > LEAST_MM:
                    found[m + 2 * k, signed] = value
    return found


def quadric_radius_mm(chief: ChiefRays) -> float:
    """Radius within which light for the mirror meets its quadric, which lies before or behind it.

    Raises SceneError where some light misses the quadric.
    """
    surface, rim = chief.surface, mirror_rings(chief.surface, 1)[0]
    sources = np.concatenate([chief.camera_frame.position_mm[None], screen_corners(chief)])
    along = rim[None] - sources[:, None]
    p, q = along[..., 0] / along[..., 2], along[..., 1] / along[..., 2]
    x0, y0 = rim[:, 0] - p * rim[:, 2], rim[:, 1] - q * rim[:, 2]
    z = surface.quadric.meet(x0, y0, p, q)
    if np.isnan(z).any():
        must = "have its rim where light for it also meets the conic alone, from which rays are followed"
        raise SceneError(f"scene {chief.scene.name}: mirror: must {must}")
    return BEYOND_RIM * float(np.hypot(x0 + p * z, y0 + q * z).max())
