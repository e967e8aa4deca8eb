"""Set-ups to calibrate, and places on the screen that their pixels would see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import h5py
import numpy as np
from scenes import coarse
from scipy.ndimage import binary_erosion

from irtscots_cl.calibration.bundle_adjustment import Adjustment, Problem, adjust
from irtscots_cl.calibration.jacobian import design_centroids
from irtscots_cl.calibration.known import distances_of, named_unknowns, priors_of
from irtscots_cl.calibration.measured import Measurement, from_maps
from irtscots_cl.calibration.parameters import moved
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.calibration_known import Calibration, Knowledge
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene

NOISE_MM = 1e-3


def paraboloid(pixels: int = 31) -> Scene:
    """An f/2 paraboloid near its centre of curvature, on few detector pixels."""
    scene = coarse("sphere", pixels)
    mirror = Mirror(radius_mm=scene.mirror.radius_mm, diameter_mm=scene.mirror.diameter_mm, conic=-1.0)
    screen = replace(scene.screen, pixels=(121, 121), pitch_mm=0.2)
    return replace(scene, name="paraboloid", mirror=mirror, screen=screen)


def inner_pixels(scene: Scene, margin: int = 2) -> np.ndarray:
    """Pixels [rows, columns] wholly on the mirror, some way from its edge."""
    whole = Setup(scene).chief_rays.footprint.coverage > 0.999
    return binary_erosion(whole, np.ones((2 * margin + 1, 2 * margin + 1)))


def measured(scene: Scene, true: Mapping[str, float], seed: int = 0, noise: float = NOISE_MM, **kind) -> Measurement:
    """What a set-up with other values of the unknowns gives, with white noise on every place."""
    inside = inner_pixels(scene)
    places = design_centroids(moved(scene, true), scene).reshape(2, *inside.shape)
    places = places + noise * np.random.default_rng(seed).standard_normal(places.shape)
    u, v = np.where(inside, places, np.nan)
    return from_maps(scene, u, v, noise, noise, **kind)


def fitted(measurements, unknowns: str, scene: Scene | None = None, **how) -> Adjustment:
    """The fit of some unknowns by their default priors and the scene's."""
    measurements = [measurements] if isinstance(measurements, Measurement) else measurements
    scene = scene or measurements[0].scene
    names = named_unknowns(unknowns, scene)
    own = {name for m in measurements for name in m.own} - set(names)
    priors = priors_of([*names, *own], scene, **how)
    return adjust(Problem.of(measurements, names, priors, distances_of(scene)))


def knowing(scene: Scene, **known: float | tuple[float, float]) -> Scene:
    """The scene with [calibration.known]: a sigma, or (mm, sigma) of a distance; __ stands for a dot, _to_ for to."""
    table = {}
    for key, value in known.items():
        name = key.replace("__", ".").replace("_to_", " to ")
        table[name] = Knowledge(sigma=value) if isinstance(value, float) else Knowledge(mm=value[0], sigma=value[1])
    return replace(scene, calibration=Calibration(known=table))


def write_places(path, **changed) -> None:
    """A file of places on the screen, of 25 x 25 pixels, with other datasets in their place; None leaves one out."""
    content = {f"screen/{axis}_mm": np.full((25, 25), 0.1) for axis in "xy"}
    content |= {f"screen/{axis}_standard_error_mm": np.full((25, 25), 1e-3) for axis in "xy"}
    with h5py.File(path, "w") as file:
        for name, value in (content | {k.replace("__", "/"): v for k, v in changed.items()}).items():
            if value is not None:
                file[name] = value
