"""Check before a run that a precision is enough for a scene: some rays on the device against float64 on the host.

The effect of rounding depends on the scene: single precision is good to 0.01 urad on the paper's sphere, and useless
if a set-up is small compared with its distance from the vertex of the mirror.
"""

from __future__ import annotations

import numpy as np

from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import parse_scene
from irtscots_cl.tracing.checks.probes import BLOCK, PathProbe, uniform_centred
from irtscots_cl.tracing.packing.sources import receivers
from irtscots_cl.tracing.samplers import DIMENSIONS

PIXELS = 64  # checked, evenly spaced among those that see the mirror
MAX_SLOPE_URAD = 0.1  # rms of a ray: as large as the effect of sampling by lines in the paper's test
_SEED = 5


def rounding_slope_urad(setup: Setup, device: Device, precision: str) -> float:
    """Rms error of single rays' landing points, as the slope error of the mirror with the same effect, in urad.

    Infinite where a ray that the host follows to the screen is lost on the device. Raises DeviceError as a trace does.
    """
    scene, chief = setup.scene, setup.chief_rays
    visible = np.flatnonzero(chief.sees_mirror)
    pixels = visible[np.linspace(0, len(visible) - 1, PIXELS).astype(int)]
    sources = receivers(chief, pixels, np.zeros((PIXELS, 2), int), precision)
    words = np.random.default_rng(_SEED).integers(0, 2**32, (PIXELS * BLOCK, DIMENSIONS), dtype=np.uint32)
    paths = PathProbe(device, scene, precision, "adjoint")(np.repeat(sources, BLOCK), words)
    row, column = np.divmod(np.repeat(pixels, BLOCK), chief.shape[1])
    cursor = uniform_centred(words[:, :2])
    aperture = paths.disk.astype(float) * (scene.camera.aperture_diameter_mm / 2)
    points, *landing = chief.reverse(row + cursor[:, 1], column + cursor[:, 0], *aperture)
    compared = np.isfinite(landing).all(0) & chief.surface.contains(points[:, 0], points[:, 1]) & paths.on_mirror
    if not compared.any():
        return 0.0
    apart = np.hypot(*(paths.landing - landing))[compared]
    distance = np.linalg.norm(chief.screen_frame.position_mm - points[compared], axis=1)
    error = float(np.sqrt(np.mean((apart / (2 * distance)) ** 2)) * 1e6)
    return error if np.isfinite(error) else np.inf


def check_precision_on(device: Device, scene_toml: str, precision: str, source: str) -> None:
    """check_precision_of_scene of a scene as TOML text, for Executor.call, which passes plain values."""
    check_precision_of_scene(parse_scene(scene_toml), device, precision, source)


def check_precision_of_scene(scene: Scene | Setup, device: Device, precision: str, source: str) -> None:
    """Refuse a precision that is too coarse for the scene, with a ValueError that names the remedy.

    source: the scene's file or preset, for the message. Double precision is not checked.
    """
    if precision == "fp64":
        return
    error = rounding_slope_urad(Setup.of(scene), device, precision)
    if error > MAX_SLOPE_URAD:
        enough = "fp64" if device.has_fp64 else "fp64, on a device that has double precision"
        raise ValueError(
            f"--precision = {precision!r}: {source}: rounding would cost {error:.2g} urad rms per ray, more than "
            f"{MAX_SLOPE_URAD}; must be {enough}"
        )
