"""Tests of a few pixels, simulated with a camera's noise and measured by the normal chain: what a choice predicts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from scenes import coarse

from irtscots_cl.imaging.fringes import FringeScan, FringeSet, FringeStack
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.fringe_light import place_mm, places_of_light
from irtscots_cl.measurement.pattern_design.camera import DesignCamera
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.measurement.screen_coordinates import screen_coordinates
from irtscots_cl.measurement.screen_places import ScreenPlaces, surface_from_places
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.screen_shape import ScanLines
from irtscots_cl.tracing.estimators.analytic import trace_analytic

CAMERA = DesignCamera(electrons=9000.0, read_noise_e=2.5, step_e=2.44)
NM = 1e6


@cache
def setup_of(name: str, pixels: int) -> Setup:
    return Setup(coarse(name, pixels).nominal())


@cache
def wide_sphere(pixels: int = 41) -> Setup:
    """The sphere with a screen of 20 x 20 mm in fine pixels: room for many periods."""
    scene = coarse("sphere", pixels).nominal()
    return Setup(replace(scene, screen=replace(scene.screen, pixels=(401, 401), pitch_mm=0.05)))


def fringe_images(setup: Setup, periods, steps: int, gamma: float = 1.0) -> FringeStack:
    """Clean images in shares of the brightest white pixel."""
    sets = tuple(FringeSet.equal(axis, periods, steps) for axis in "xy")
    stack = trace_analytic(setup).images(FringeScan(setup.scene, sets, gamma=gamma))
    return replace(stack, frames=stack.frames / stack.white.max(), white=stack.white / stack.white.max())


def recorded(electrons: np.ndarray, camera: DesignCamera, random: np.random.Generator, times: int = 1) -> np.ndarray:
    """Mean of so many frames, in electrons, with all noise of the camera."""
    total = np.zeros(electrons.shape)
    for _ in range(times):
        noisy = random.poisson(electrons) + camera.read_noise_e * random.standard_normal(electrons.shape)
        total += np.rint(noisy / camera.step_e) * camera.step_e if camera.step_e else noisy
    return total / times


def fringe_height(setup: Setup, stack: FringeStack, frames: np.ndarray, mask: np.ndarray):
    """The surface by the normal chain."""
    found, _ = places_of_light(screen_coordinates(replace(stack, frames=frames), mask=mask), setup)
    error = np.where(mask, 1e-3, np.nan)
    places = ScreenPlaces(*(place_mm(found.axes[axis], setup) for axis in "xy"), error, error)
    return surface_from_places(places, setup, method="cubic", pixel_average=False)


def scatter_nm(measure, clean, seeds: int) -> tuple[float, float]:
    """Rms height error in nm of measure(random) against the clean surface, and its relative standard error."""
    squares = []
    for seed in range(seeds):
        found = measure(np.random.default_rng(seed))
        error = remove_terms(
            found.x_mm, found.y_mm, found.deviation_mm - clean.deviation_mm, found.height_mask, "piston_tilt"
        )
        squares.append(rms(error, found.height_mask) ** 2)
    mean = float(np.mean(squares))
    return mean**0.5 * NM, float(np.std(squares, ddof=1)) / seeds**0.5 / mean / 2


def fringe_scatter_nm(setup, mask, periods, steps, times, seeds, camera=CAMERA) -> tuple[float, float]:
    stack = fringe_images(setup, periods, steps)
    electrons = np.asarray(stack.frames) * camera.electrons
    clean = fringe_height(setup, stack, electrons, mask)

    def measure(random):
        return fringe_height(setup, stack, recorded(electrons, camera, random, times), mask)

    return scatter_nm(measure, clean, seeds)


def line_scatter_nm(setup, mask, width, step, longer, seeds, camera=CAMERA) -> tuple[float, float]:
    """Of a line scan once, exposed `longer` than a white screen that brings the camera's electrons."""
    lines = ScanLines(step_px=step, width_px=width)
    scene = replace(setup.scene, screen=replace(setup.scene.screen, lines=lines))
    setup = Setup(scene)
    traced = trace_analytic(setup)
    stack = traced.images(LineScan(scene))
    white = fringe_images(setup, (0.9,), 3)
    brightest = trace_analytic(setup).images(FringeScan(scene, white.sets)).white.max()

    def of(scan: Scan, random=None) -> Scan:
        images = np.stack([scan.image(k) for k in range(len(scan.positions_mm))]) * (
            longer * camera.electrons / brightest
        )
        if random is not None:
            images = recorded(images, camera, random)
        return Scan.from_images(scan.axis, scan.positions_mm, images, scan.line_width)

    def measure(random=None):
        noisy = ImageStack(of(stack.x, random), of(stack.y, random)).masked(mask)
        return reconstruct(noisy, setup, light_curve="likelihood", method="cubic", pixel_average=False)

    return scatter_nm(measure, measure(), seeds)
