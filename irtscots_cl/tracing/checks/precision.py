"""Check before a run that a precision is enough for a scene: some rays on the device against float64 on the host.

What counts is the height error. Rounding that differs from ray to ray averages out over a pixel's rays; rounding that
all rays of a pixel share, and that runs smoothly over the mirror, adds up in the integration of the slopes: on a large
mirror a few nrad are nanometres, on a small one they are nothing. So the rays' errors are averaged over each pixel,
turned into slopes and integrated to a height map.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.program import BLOCK
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import parse_scene
from irtscots_cl.system.option_error import OptionError
from irtscots_cl.tracing.checks.probes import PathProbe, uniform_centred
from irtscots_cl.tracing.defaults import RAYS_PER_PIXEL
from irtscots_cl.tracing.packing.sources import receivers
from irtscots_cl.tracing.samplers import DIMENSIONS

ACROSS = 24  # pixels that are looked at, along the detector's longer side at most
LEAST_RAYS = 16  # that a pixel's mean takes
DRAWS = 8  # of noise maps
SMALL_NM = 1.0  # rounding that is never refused or warned of before a run
WORSE = 3.0  # times the ray noise: more rounding than that is refused
SUSPECT_NM = 15.0  # of `rounding_scale_nm`, which is 10 to 50 times the error: below it no ray is looked at
_SEED = 5


class RoundingWarning(UserWarning):
    """Single precision costs a trace nanometres of height."""


@dataclass(frozen=True)
class Rounding:
    """Rounding errors of a device's rays. ray_urad: rms of single rays' slopes. height_nm: rms of the height map,
    piston and tilt removed, that the means over the pixels add up to; noise_nm: the part of this map, taken off in
    squares, that comes from the small number of rays. All infinite where a ray that the host follows is lost."""

    ray_urad: float
    height_nm: float
    noise_nm: float


_found: WeakKeyDictionary[Setup, dict[tuple[Device, str], Rounding]] = WeakKeyDictionary()


def rounding_error(scene: Scene | Setup, device: Device, precision: str) -> Rounding:
    """What rounding does to a scene's adjoint rays on a device: measured once for a Setup.

    Raises DeviceError as a trace does.
    """
    setup = Setup.of(scene)
    known = _found.setdefault(setup, {})
    if (device, precision) not in known:
        known[device, precision] = _rounding(setup, device, precision)
    return known[device, precision]


def _rounding(setup: Setup, device: Device, precision: str) -> Rounding:
    scene, chief = setup.scene, setup.chief_rays
    mask, numbers = _chosen(chief)
    count = len(numbers)
    if not count:
        return Rounding(0.0, 0.0, 0.0)
    sources = receivers(chief, numbers, np.zeros((count, 2), int), precision)
    words = np.random.default_rng(_SEED).integers(0, 2**32, (count * BLOCK, DIMENSIONS), dtype=np.uint32)
    paths = PathProbe(device, scene, precision, "adjoint")(np.repeat(sources, BLOCK), words)
    row, column = np.divmod(np.repeat(numbers, BLOCK), chief.shape[1])
    cursor = uniform_centred(words[:, :2])
    aperture = paths.disk.astype(float) * (scene.camera.aperture_diameter_mm / 2)
    points, *landing = chief.reverse(row + cursor[:, 1], column + cursor[:, 0], *aperture)
    compared = np.isfinite(landing).all(0) & chief.surface.contains(points[:, 0], points[:, 1]) & paths.on_mirror
    if not compared.any():
        return Rounding(0.0, 0.0, 0.0)
    slopes = _slopes(chief, points, paths.landing) - _slopes(chief, points, np.stack(landing))  # [2, rays]
    if not np.isfinite(slopes[:, compared]).all():
        return Rounding(np.inf, np.inf, np.inf)
    ray = float(np.sqrt(np.mean(np.sum(slopes[:, compared] ** 2, 0))) * 1e6)
    return Rounding(ray, *_height_nm(mask, points, slopes, compared.reshape(count, BLOCK)))


def _chosen(chief: ChiefRays) -> tuple[np.ndarray, np.ndarray]:
    """Every few pixels that see at least half of their footprint on the mirror: mask [rows, columns] of the coarser
    grid, and their flat numbers."""
    step = -(-max(chief.shape) // ACROSS)
    rows, columns = (np.arange(size % step // 2, size, step) for size in chief.shape)
    mask = chief.footprint.coverage[np.ix_(rows, columns)] >= 0.5
    return mask, (rows[:, None] * chief.shape[1] + columns)[mask]


def _slopes(chief: ChiefRays, points: np.ndarray, landing: np.ndarray) -> np.ndarray:
    """Slopes [2, n] of the mirror that sends light from the camera's aperture by way of points [n, 3] to landing
    [2, n]: the normal halves the angle."""
    ways = (chief.screen_model.to_world(*landing.astype(float)) - points, chief.camera_frame.position_mm - points)
    half = sum(way / np.linalg.norm(way, axis=-1, keepdims=True) for way in ways)
    return -half[:, :2].T / half[:, 2]


def _height_nm(mask: np.ndarray, points, slopes, compared) -> tuple[float, float]:
    """Rms height of the pixels' mean slopes [2, pixels * BLOCK], and the part that a few rays' noise makes, in nm."""
    rays = compared.sum(1)
    kept = rays >= LEAST_RAYS
    used = mask.copy()
    used[mask] = kept
    if np.sum(used) < 4:
        return 0.0, 0.0
    weight = compared[kept] / rays[kept, None]
    at = [np.sum(weight * points[:, k].reshape(compared.shape)[kept], 1) for k in range(2)]
    steep = np.where(compared, slopes.reshape(2, *compared.shape), 0.0)[:, kept]
    mean = np.sum(weight * steep, -1)
    error = np.sqrt(np.sum(weight * (steep - mean[..., None]) ** 2, -1) / (rays[kept] - 1))

    def on_grid(values):
        grid = np.full((*values.shape[:-1], *used.shape), np.nan)
        grid[..., used] = values
        return grid

    x, y = on_grid(at[0]), on_grid(at[1])

    def heights_nm(maps):
        found = integrate_slopes(x, y, maps[0], maps[1], used).reshape(-1, *used.shape)
        return np.sqrt(np.mean([rms(remove_terms(x, y, h, used, "piston_tilt"), used) ** 2 for h in found])) * 1e6

    random = np.random.default_rng(_SEED).standard_normal((2, DRAWS, len(rays[kept])))
    total, noise = heights_nm(on_grid(mean)), heights_nm(on_grid(random * error[:, None]))
    return float(np.sqrt(max(total**2 - noise**2, 0.0))), float(noise)


def ray_noise_nm(setup: Setup, rays_per_pixel: int, independent: bool = True) -> float:
    """Rms height in nm, piston and tilt removed, that rays scatter by, from the scene's lengths alone.

    A centroid's standard error is the light's standard deviation over the root of the number of independent rays; of
    low-discrepancy points and of smoothed rays, over the number to the power 0.7 (docs/accuracy.md).
    """
    rays_per_pixel = rays_per_pixel if independent else rays_per_pixel**1.4
    chief = setup.chief_rays
    foot = chief.footprint
    mask = foot.coverage >= 0.5
    if mask.sum() < 4:
        return 0.0
    x, y = np.where(mask, foot.x_mm, np.nan), np.where(mask, foot.y_mm, np.nan)
    points = np.stack([x, y, chief.surface.sag(x, y)], -1)
    distance = np.linalg.norm(points - chief.screen_frame.position_mm, axis=-1)
    random, slopes = np.random.default_rng(_SEED), []
    for k in range(2):
        half, *boxes = chief.light_shape(k)
        variance = half**2 / 4 + sum(box**2 for box in boxes) / 12
        error = np.sqrt(variance / rays_per_pixel) / (2 * distance)
        slopes.append(np.where(mask, np.nan_to_num(error), 0.0) * random.standard_normal((DRAWS, *mask.shape)))
    heights = integrate_slopes(x, y, *slopes, mask)
    return float(np.sqrt(np.mean([rms(remove_terms(x, y, h, mask, "piston_tilt"), mask) ** 2 for h in heights])) * 1e6)


def rounding_scale_nm(setup: Setup) -> float:
    """Size in nm of the height error that single precision could make, from lengths alone: some ten times too large.

    A coordinate of L mm is rounded by L 2^-24, which over the distance d to the screen looks like a slope; a quarter of
    the mirror's radius times a slope is the height of a smooth error.
    """
    scene = setup.scene
    points = [np.array(p) for p in (scene.screen.position_mm, scene.camera.position_mm, scene.camera.look_at_mm)]
    largest = max(*(np.abs(p).max() for p in points), scene.mirror.diameter_mm / 2)
    nearest = min(np.linalg.norm(points[0] - points[2]), np.linalg.norm(points[1] - points[2])) or 1.0
    return float(2.0**-24 * largest / nearest * scene.mirror.diameter_mm / 8 * 1e6)


def rounding_on(device: Device, scene_toml: str, precision: str) -> Rounding:
    """rounding_error of a scene as TOML text, for places that are called with plain values (Executor.call)."""
    return rounding_error(parse_scene(scene_toml), device, precision)


def warn_of_rounding(setup: Setup, call, precision: str) -> None:
    """Warn, by RoundingWarning, of a trace in single precision that loses more than SMALL_NM by it.

    call: Executor.call of the place where the trace will run. Rays are looked at only where lengths say that it could
    matter.
    """
    if precision != "fp32" or rounding_scale_nm(setup) < SUSPECT_NM:
        return
    found = call(rounding_on, setup.scene.to_toml(), precision)
    if found.height_nm > SMALL_NM:
        warnings.warn(rounding_text(setup.scene.name, found), RoundingWarning, stacklevel=3)


def rounding_text(source: str, found: Rounding) -> str:
    """One line about rounding in single precision."""
    if not np.isfinite(found.height_nm):
        return f"precision fp32: {source}: rays are lost by overflow; fp64 keeps them"
    return (
        f"precision fp32: {source}: rounding adds {found.height_nm:.2g} nm rms to the height "
        f"({found.ray_urad:.2g} urad to a ray); fp64 does not"
    )


def check_precision_on(
    device: Device, scene_toml: str, precision: str, source: str, rays_per_pixel: int, independent: bool
) -> None:
    """check_precision_of_scene of a scene as TOML text, for places that are called with plain values."""
    check_precision_of_scene(parse_scene(scene_toml), device, precision, source, rays_per_pixel, independent)


def check_precision_of_scene(
    scene: Scene | Setup,
    device: Device,
    precision: str,
    source: str,
    rays_per_pixel: int = RAYS_PER_PIXEL,
    independent: bool = True,
) -> None:
    """Refuse a precision that is too coarse for the scene, with a ValueError that says what would do.

    Too coarse: rounding adds more than SMALL_NM and more than WORSE times the ray noise of so many rays to the height.
    source: the scene's file or preset, for the message. independent: see ray_noise_nm. Double precision is taken as it
    is.
    """
    if precision == "fp64":
        return
    setup = Setup.of(scene)
    found = rounding_error(setup, device, precision)
    if found.height_nm <= SMALL_NM:
        return
    limit = max(SMALL_NM, WORSE * ray_noise_nm(setup, rays_per_pixel, independent))
    if found.height_nm > limit:
        enough = "fp64" if device.has_fp64 else "fp64, on a device that has double precision"
        raise OptionError(
            f"--precision = {precision!r}: {source}: rounding would add {found.height_nm:.2g} nm rms to the height, "
            f"more than {limit:.2g} nm ({WORSE:g} times the ray noise, at least {SMALL_NM:g} nm); must be {enough}"
        )
