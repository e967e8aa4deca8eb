"""What a transfer function means for a test: periods of half response and of Nyquist, what waves show as, doubts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.methods import BEST
from irtscots_cl.measurement.refinement import order_of_model
from irtscots_cl.measurement.transfer_function import Response, TransferFunction, wrapped
from irtscots_cl.measurement.transfer_geometry import TransferGeometry
from irtscots_cl.system.option_error import OptionError

DEFAULT_WAVES = 12
STEPS = 600  # of frequency, up to Nyquist's, in which the period of half response is looked for
GREEN_NM = 550.0  # of the word on diffraction where no wavelength is told
MUCH = 0.01  # change of a response that is worth a word
LARGE_PHASE = 0.3  # rad, of fringes: beyond, the second order reaches 1 %


@dataclass(frozen=True)
class Direction:
    """Periods in mm along a direction: the shortest that the grid shows, and the one of half the height's response,
    None where the response is above half up to the shortest."""

    angle_deg: float
    nyquist_mm: float
    half_mm: float | None


@dataclass(frozen=True)
class TransferSummary:
    """Of one place on the mirror. angle_deg: of the waves from the mirror's +x towards +y. periods_mm: [m].

    response: of the pixel at the place, arrays [1, m]. lowest, highest: [m], the height's response over the mirror.
    seen_period_mm, seen_angle_deg: [m], of the wave that the grid shows. directions: along x, y and the waves.
    ripple_nm: amplitude of the waves. warnings: factors that are not known.
    """

    transfer: TransferFunction = field(repr=False)
    geometry: TransferGeometry = field(repr=False)
    angle_deg: float
    periods_mm: FloatArray
    ripple_nm: float
    response: Response
    lowest: FloatArray
    highest: FloatArray
    seen_period_mm: FloatArray
    seen_angle_deg: FloatArray
    directions: tuple[Direction, ...]
    warnings: tuple[str, ...]


def summarise(
    transfer: TransferFunction,
    periods_mm: FloatArray | None = None,
    angle_deg: float = 0.0,
    place_mm: tuple[float, float] | None = None,
    ripple_nm: float = 1.0,
) -> TransferSummary:
    """periods_mm: default: from a quarter of the mirror to the grid's shortest. place_mm: default: the mirror's centre.

    Raises ValueError for values out of range, a place beside the mirror, or a scene whose pixels are too large.
    """
    _check(transfer, periods_mm, angle_deg, place_mm, ripple_nm)
    geometry = transfer.geometry(transfer.nearest(*(place_mm or (0.0, 0.0))))
    away = math.hypot(geometry.x_mm[0] - (place_mm or (0, 0))[0], geometry.y_mm[0] - (place_mm or (0, 0))[1])
    if place_mm is not None and away > np.linalg.norm(geometry.pixel[0], axis=-1).sum():
        raise OptionError(
            f"--at = {place_mm[0]:g} {place_mm[1]:g}: no pixel sees that place of the mirror as a whole; the nearest "
            f"is at {geometry.x_mm[0]:.4g} {geometry.y_mm[0]:.4g} mm"
        )
    directions = tuple(_direction(transfer, geometry, angle) for angle in (0.0, 90.0, angle_deg))
    if periods_mm is None:
        longest, shortest = transfer.setup.scene.mirror.diameter_mm / 4, directions[2].nyquist_mm
        rounded = [float(f"{p:.3g}") for p in np.geomspace(max(longest, 2 * shortest), 1.02 * shortest, DEFAULT_WAVES)]
        periods_mm = np.array(rounded)
    k = _waves(angle_deg, 1 / np.asarray(periods_mm, np.float64))
    response = transfer.response(geometry, k)
    over = transfer.response(transfer.geometry(transfer.pixels()), k).height
    seen = geometry.waves(wrapped(response.turns))[0]
    size = np.linalg.norm(seen, axis=-1)
    with np.errstate(divide="ignore"):
        seen_period = np.where(size > 1e-9 * np.linalg.norm(k, axis=-1), 2 * np.pi / size, np.inf)
    return TransferSummary(
        transfer, geometry, angle_deg, np.asarray(periods_mm, np.float64), ripple_nm, response,
        np.nanmin(np.vstack([over, response.height]), axis=0), np.nanmax(np.vstack([over, response.height]), axis=0),
        seen_period, np.degrees(np.arctan2(seen[:, 1], seen[:, 0])), directions,
        tuple(_warnings(transfer, geometry, response, ripple_nm)),
    )  # fmt: skip


def _check(
    transfer: TransferFunction,
    periods: FloatArray | None,
    angle: float,
    place: tuple[float, float] | None,
    ripple: float,
) -> None:
    longest = 100 * transfer.setup.scene.mirror.diameter_mm
    for period in [] if periods is None else periods:
        if not 0 < period <= longest:
            raise OptionError(f"--periods: {period:g} mm: must be above 0 and at most {longest:g}, 100 mirrors")
    if not abs(angle) <= 360:
        raise OptionError(f"--direction = {angle:g}: must be from -360 to 360 degrees")
    if not all(map(math.isfinite, place or ())):
        raise OptionError(f"--at = {place}: must be two finite numbers")
    if not 0 < ripple <= 1e6:
        raise OptionError(f"--ripple = {ripple:g}: must be above 0 and at most 1e6 nm")


def _waves(angle_deg: float, frequency_per_mm: FloatArray) -> FloatArray:
    """k [m, 2] in rad/mm."""
    angle = math.radians(angle_deg)
    return np.multiply.outer(2 * np.pi * frequency_per_mm, [math.cos(angle), math.sin(angle)])


def _direction(transfer: TransferFunction, geometry: TransferGeometry, angle_deg: float) -> Direction:
    one = _waves(angle_deg, np.array([1.0 / (2 * np.pi)]))
    nyquist = 2 * float(np.abs(geometry.turns(one)).max())  # the period whose waves turn by pi
    frequency = np.arange(1, STEPS + 1) / STEPS / nyquist
    below = transfer.response(geometry, _waves(angle_deg, frequency * (1 - 1e-9))).height[0] - 0.5
    crossed = np.flatnonzero(below < 0)
    if not crossed.size or not crossed[0]:
        return Direction(angle_deg, nyquist, None)
    after = crossed[0]
    part = below[after - 1] / (below[after - 1] - below[after])
    return Direction(
        angle_deg, nyquist, float(1 / (frequency[after - 1] + part * (frequency[after] - frequency[after - 1])))
    )


def _warnings(
    transfer: TransferFunction, geometry: TransferGeometry, response: Response, ripple_nm: float
) -> list[str]:
    """What the numbers leave out."""
    said, how, scene = [], transfer.how, transfer.setup.scene
    if how.light_curve == BEST:
        said.append(
            f"--measure {BEST} weighs a pixel's light by its noise, which is not known beforehand: footprint and "
            "aperture are those of plain means"
        )
    if how.rounds:
        order = order_of_model(int(np.count_nonzero(transfer.setup.chief_rays.footprint.coverage >= 0.5)))
        said.append(
            f"the model's share (Zernike terms up to radial order {order}) is a mean over the mirror; at a place the "
            "response may lie anywhere between that without a model and 1"
        )
    if how.light_curve == "centroid" and not np.isfinite(geometry.line_gain).all():
        said.append("the light of the pixel has no model: what the sampling by lines does is not known and left out")
    if not scene.is_sequential:
        said.append("elements and scatter of the scene are left out")
    if transfer.wavelength_nm is None:
        lost = 1 - transfer.diffraction(response.turns, GREEN_NM).min()
        if lost > MUCH:
            said.append(
                f"diffraction at the aperture is left out, as in the simulation: at {GREEN_NM:g} nm it would take "
                f"{100 * lost:.0f} % of the shortest wave here (--wavelength-nm)"
            )
    if transfer.fringes is not None:
        said += _fringe_warnings(transfer, geometry, response, ripple_nm)
    if response.aliased.any():
        said.append("waves shorter than the grid shows are seen as longer ones: an alias is no response")
    return said


def _fringe_warnings(
    transfer: TransferFunction, geometry: TransferGeometry, response: Response, ripple_nm: float
) -> list[str]:
    said, screen = [], transfer.setup.scene.screen
    left = float(transfer.modulation(geometry).min())
    if left < 0.1:
        said.append(f"the light of a pixel leaves {100 * left:.2g} % of the fringes: their phase says little")
    steepest = float(np.linalg.norm(response.k_per_mm, axis=-1).max()) * ripple_nm * 1e-6
    size = np.array(screen.pixels) * np.array(screen.pitch_xy_mm)
    moved = np.abs(np.linalg.inv(geometry.slopes[0])).max(-1) * steepest * 2 * np.pi * (transfer.fringes or 0.0) / size
    if moved.max() > LARGE_PHASE:
        said.append(
            f"a ripple of {ripple_nm:g} nm moves the fringes by {moved.max():.2g} rad over its slopes: their contrast "
            "and so its response fall further, which is left out"
        )
    return said
