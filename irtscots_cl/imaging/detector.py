"""What a real detector records: electrons, their noise, and the digital numbers (DN) that are stored.

The order of the effects: light of the frame -> electrons by the pixel's response -> shot noise of light and dark
current together -> read noise -> full well -> gain and offset -> rounding to the bits -> mean of the averaged frames ->
dark frames subtracted. The terms are those of EMVA Standard 1288 (release 4.0, section 2).

No random number depends on another one or on the order of work: see maths/counter_random.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.maps import read_map
from irtscots_cl.imaging.screen_response import frame_factors
from irtscots_cl.imaging.streams import EVERYWHERE, Stream, place_of
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.counter_random import normal, uniform
from irtscots_cl.maths.poisson import poisson_quantile
from irtscots_cl.scene.detector_noise import MAX_BITS, DetectorNoise
from irtscots_cl.scene.screen_response import ScreenResponse
from irtscots_cl.system.memory import check_memory

PLANCK_TIMES_LIGHT_SPEED = 6.62607015e-34 * 299792458.0  # J m, exact by the definition of the SI
BYTES_PER_VALUE = 32  # of recorded images: memory while they are checked and measured


@dataclass(frozen=True)
class PixelProperties:
    """What stays the same in every frame, [n]. response: electrons over those of the nominal pixel; dark_e: mean
    number of electrons of a frame without light."""

    response: FloatArray
    dark_e: FloatArray


def pixel_properties(noise: DetectorNoise, shape: tuple[int, int]) -> PixelProperties:
    """The pixels [rows * columns] of a detector of that shape. Raises ValueError for a map that cannot be used."""
    count = shape[0] * shape[1]
    response, dark_e = np.ones(count), np.full(count, noise.dark_current_e_per_s * (noise.exposure_s or 0.0))
    if noise.quantum_efficiency_map is not None:
        key = "camera.detector.noise.quantum_efficiency_map"
        response = read_map(noise.quantum_efficiency_map, key, shape).ravel()
    if noise.prnu:
        response = response * np.maximum(1.0 + noise.prnu * normal(noise.seed, Stream.PRNU, EVERYWHERE, count), 0.0)
    if noise.dead_pixel_share:
        response[uniform(noise.seed, Stream.DEAD_PIXEL, EVERYWHERE, count) < noise.dead_pixel_share] = 0.0
    if noise.hot_pixel_share:
        hot = uniform(noise.seed, Stream.HOT_PIXEL, EVERYWHERE, count) < noise.hot_pixel_share
        dark_e[hot] += noise.hot_pixel_e
    return PixelProperties(response, dark_e)


def electrons_per_w(noise: DetectorNoise, peak_w: float) -> float:
    """Electrons in one frame of a nominal pixel for one W on it.

    peak_w: flux of the brightest sample of all frames, for electrons_at_peak; ValueError if it is 0. Otherwise
    exposure x quantum efficiency x wavelength / (h c).
    """
    if noise.electrons_at_peak is not None:
        if not peak_w > 0:
            raise ValueError("camera.detector.noise.electrons_at_peak: no frame has any light; there must be some")
        return noise.electrons_at_peak / peak_w
    if noise.exposure_s is None or noise.quantum_efficiency is None or noise.wavelength_nm is None:
        return 0.0  # a table whose effects are all off states no exposure
    wavelength_m = noise.wavelength_nm * 1e-9
    return noise.exposure_s * noise.quantum_efficiency * wavelength_m / PLANCK_TIMES_LIGHT_SPEED


def saturation_dn(noise: DetectorNoise) -> float:
    """The largest value of a sample, by the bits or the full well; infinite without either."""
    most = math.inf if noise.full_well_e is None else noise.full_well_e / noise.gain_e_per_dn + noise.offset_dn
    if noise.bits is not None:
        most = min(math.floor(most + 0.5) if math.isfinite(most) else most, 2**noise.bits - 1)
    return most * _step(noise)


def _step(noise: DetectorNoise) -> int:
    """Difference of neighbouring numbers: left-justified ones leave the lower of 16 bits 0."""
    return 2 ** (MAX_BITS - noise.bits) if noise.bits is not None and noise.justification == "left" else 1


def mean_of_frames(
    noise: DetectorNoise,
    pixels: PixelProperties,
    light_e: FloatArray,
    factors: FloatArray,
    scan: str,
    line: int,
    exposure: int = 0,
) -> tuple[FloatArray, BoolArray]:
    """The mean [n] in DN of frames of one scene, and whether a pixel was saturated in any of them.

    light_e: [n] mean electrons of nominal pixels at brightness 1. factors: [frames] brightness of each. scan, line,
    exposure: which random numbers are taken. Samples that were saturated get the largest value.
    """
    frames = len(factors)
    if not noise.is_nonlinear:  # the sum of the frames has the same distribution as one frame of all their light
        mean_e = light_e * pixels.response * factors.sum() + pixels.dark_e * frames
        electrons = _electrons(noise, mean_e, frames, place_of(scan, line, exposure))
        return electrons / (frames * noise.gain_e_per_dn) + noise.offset_dn, np.zeros(len(light_e), bool)
    most, total, saturated = saturation_dn(noise), np.zeros(len(light_e)), np.zeros(len(light_e), bool)
    for frame, factor in enumerate(factors):
        mean_e = light_e * pixels.response * factor + pixels.dark_e
        values = _digital(noise, _electrons(noise, mean_e, 1, place_of(scan, line, exposure, frame)))
        saturated |= values >= most
        total += values
    return np.where(saturated, most, total / frames), saturated


def _electrons(noise: DetectorNoise, mean_e: FloatArray, frames: int, place: tuple[int, int]) -> FloatArray:
    """Electrons [n] of so many frames together, with shot and read noise."""
    electrons, count = mean_e, len(mean_e)
    if noise.shot_noise:
        electrons = poisson_quantile(uniform(noise.seed, Stream.SHOT, place, count), mean_e)
    if noise.read_noise_e:
        read_e = noise.read_noise_e * math.sqrt(frames)
        electrons = electrons + read_e * normal(noise.seed, Stream.READ, place, count)
    return electrons


def _digital(noise: DetectorNoise, electrons: FloatArray) -> FloatArray:
    """The values of one frame in DN: limited by the full well, rounded to the bits."""
    if noise.full_well_e is not None:
        electrons = np.minimum(electrons, noise.full_well_e)
    values = electrons / noise.gain_e_per_dn + noise.offset_dn
    if noise.bits is None:
        return values
    return np.clip(np.floor(values + 0.5), 0.0, 2.0**noise.bits - 1.0) * _step(noise)


def dark_image(noise: DetectorNoise, pixels: PixelProperties) -> FloatArray:
    """The mean [n] in DN of the dark frames, which is subtracted; 0 without any."""
    if not noise.dark_frames:
        return np.zeros(len(pixels.dark_e))
    no_light = np.zeros(len(pixels.dark_e))
    return mean_of_frames(noise, pixels, no_light, np.zeros(noise.dark_frames), "dark", 0)[0]


def peak_w(stack: ImageStack) -> float:
    """Flux of the brightest sample of both scans, of the mean over the replicates."""
    return max(float(np.max(scan.mean_w(), initial=0.0)) for scan in (stack.x, stack.y))


def check_recording_memory(noise: DetectorNoise, lines: int, pixels: tuple[int, int]) -> None:
    """Refuse, with a ValueError, more exposures of all lines and pixels than the memory holds."""
    values = noise.exposures * lines * pixels[0] * pixels[1]
    what = f"camera.detector.noise.exposures = {noise.exposures}: images of {values} values"
    check_memory(what, values * BYTES_PER_VALUE)


def check_exposures(noise: DetectorNoise, replicates: int) -> None:
    """Refuse, with a ValueError, more exposures than there are replicates to give each its own rays."""
    if 1 < replicates < noise.exposures:
        raise ValueError(
            f"camera.detector.noise.exposures = {noise.exposures}: must be at most --replicates = {replicates}, so "
            "that each exposure has rays of its own and the error bars their noise"
        )


def expose(stack: ImageStack, noise: DetectorNoise, response: ScreenResponse | None = None) -> ImageStack:
    """The images in DN that a detector records of a stack in W; all lines of every pixel, since noise is everywhere.

    The new replicates are the exposures. Each takes its share of the stack's replicates, so that error bars hold both
    the noise of the rays and that of the detector; all take a single replicate alike. response: frame factors of the
    screen. Raises ValueError for maps that cannot be used, fewer replicates than exposures (but not one), a stack
    without light, or one that does not fit the memory.
    """
    shape, lines = stack.x.shape, len(stack.x.positions_mm) + len(stack.y.positions_mm)
    check_recording_memory(noise, lines, shape)
    check_exposures(noise, len(stack.x.weights))
    pixels = pixel_properties(noise, shape)
    level = 1.0 if response is None else response.level
    per_w = electrons_per_w(noise, peak_w(stack) * level)
    dark = dark_image(noise, pixels)
    return ImageStack(*(_exposed(scan, noise, response, pixels, per_w, dark) for scan in (stack.x, stack.y)))


def _exposed(
    scan: Scan,
    noise: DetectorNoise,
    response: ScreenResponse | None,
    pixels: PixelProperties,
    per_w: float,
    dark: FloatArray,
) -> Scan:
    curves_w, weights = _shares(scan, noise.exposures)
    lines = len(scan.positions_mm)
    images = np.empty((noise.exposures, lines, len(dark)))
    for line in range(lines):
        for exposure, curve_w in enumerate(curves_w):
            light_e = np.maximum(scan.image(line, curve_w).ravel(), 0.0) * per_w
            factors = frame_factors(response, scan.axis, line, lines, exposure, noise.frames_averaged)
            values, saturated = mean_of_frames(noise, pixels, light_e, factors, scan.axis, line, exposure)
            # a saturated sample stays at the limit, where it can be found
            images[exposure, line] = np.where(saturated, values, values - dark)
    recorded = Scan.from_images(
        scan.axis, scan.positions_mm, images.reshape(*images.shape[:2], *scan.shape), scan.line_width
    )
    return replace(recorded, weights=weights, saturation_w=saturation_dn(noise), unit="DN")


def _shares(scan: Scan, exposures: int) -> tuple[list[FloatArray], FloatArray]:
    """The light curves [n, window] of each exposure and their weights: shares of the replicates, or the only one."""
    if len(scan.weights) == 1:
        return [scan.flux_w[0]] * exposures, np.ones(exposures)
    shares = np.array_split(np.arange(len(scan.weights)), exposures)
    parts = [replace(scan, flux_w=scan.flux_w[share], weights=scan.weights[share]) for share in shares]
    return [part.mean_w() for part in parts], np.array([part.weights.sum() for part in parts])
