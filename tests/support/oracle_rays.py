"""The device's rays beside the oracle's: the same samples through both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from device_kernels import FOLDER, SmallKernel, launch_of
from oracle import tracer

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.screen_windows import place_windows
from irtscots_cl.optics.setup import Setup
from irtscots_cl.tracing.packing.sources import emitters, receivers
from irtscots_cl.tracing.samplers import sample_words

SOURCES, RAYS = 32, 512
SEED, FIRST_RAY = 7, 5


def centred(word: np.ndarray) -> np.ndarray:
    """What uniform_centred makes of a word, exactly: the odd multiple of 2^-25 in its interval of 2^-24."""
    return ((word.view(np.int32) >> 7) | 1) * 2.0**-25


@dataclass(frozen=True)
class Rays:
    """paths [n, fields] as float64 and marks [n, marks] of the device; oracle: Forward- or AdjointRays."""

    paths: np.ndarray
    marks: np.ndarray
    oracle: object


def _run(device, scene, precision: str, name: str, sources: np.ndarray, chosen: np.ndarray, fields: int, marks: int):
    kernel = SmallKernel(device, FOLDER / f"{name}.cl", precision, scene)
    outputs = [
        np.zeros((len(chosen), RAYS, fields), kernel.real),
        np.zeros((len(chosen), RAYS, marks), np.int32),
    ]
    launch = launch_of(seed_low=SEED, first_ray=FIRST_RAY)
    inputs = [kernel.tables, launch, sources, chosen]
    paths, flags = kernel.run((len(chosen), RAYS // kernel.block), inputs, outputs)
    return paths.astype(float).reshape(-1, fields), flags.reshape(-1, marks)


def _words(sources: np.ndarray) -> np.ndarray:
    """[sources, rays, 4] words of the rays that _run traces."""
    return np.stack([sample_words("philox", SEED, int(s), 0, FIRST_RAY + np.arange(RAYS)) for s in sources])


def forward_rays(device, scene, precision: str) -> Rays:
    """Rays from screen pixels spread over the screen, aimed as the package aims them."""
    sources, _ = emitters(Setup(scene), precision, 1.0, "mirror")
    chosen = np.linspace(0, len(sources) - 1, SOURCES).astype(np.uint32)
    paths, marks = _run(device, scene, precision, "trace_paths_forward", sources, chosen, 11, 3)
    words, pitch = _words(chosen), scene.screen.pitch_mm
    emitter = {name: np.repeat(sources[name][chosen].astype(float), RAYS) for name in sources.dtype.names}
    x = emitter["x"] + pitch * centred(words[..., 0]).ravel()
    y = emitter["y"] + pitch * centred(words[..., 1]).ravel()
    disk_x, disk_y = paths[:, 9], paths[:, 10]
    l = emitter["centre_l"] + emitter["aim_ll"] * disk_x
    m = emitter["centre_m"] + emitter["aim_ml"] * disk_x + emitter["aim_mm"] * disk_y
    return Rays(paths, marks, tracer.trace_forward(scene, np.stack([x, y], -1), np.stack([l, m], -1)))


def adjoint_rays(device, scene, precision: str) -> Rays:
    """Rays from detector pixels spread over the image of the mirror."""
    chief = ChiefRays(scene)
    windows = place_windows(chief, 1)
    sources = receivers(chief, windows.pixels, windows.origins, precision)
    chosen = np.linspace(0, len(sources) - 1, SOURCES).astype(np.uint32)
    paths, marks = _run(device, scene, precision, "trace_paths_adjoint", sources, chosen, 10, 2)
    words, detector = _words(sources["pixel"][chosen]), scene.camera.detector
    row, column = np.divmod(windows.pixels[chosen], detector.pixels[0])
    x = (column - (detector.pixels[0] - 1) / 2)[:, None] + centred(words[..., 0])
    y = (row - (detector.pixels[1] - 1) / 2)[:, None] + centred(words[..., 1])
    image = np.stack([x, y], -1).reshape(-1, 2) * detector.pitch_mm
    aperture = paths[:, 8:10] * scene.camera.aperture_diameter_mm / 2
    return Rays(paths, marks, tracer.trace_adjoint(scene, image, aperture))
