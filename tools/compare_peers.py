#!/usr/bin/env python3
"""The same job in other tools, in one run: rays launched per second, as ratios to this program's forward estimator.

The job: the preset `sphere`. Rays leave all screen pixels, uniform over the pixel and over the aim's ellipse in
direction cosines (Lambertian), are reflected by the sphere and counted by detector pixel if they pass the aperture.
A peer whose fraction of detected rays differs from ours by more than its Poisson error, or whose image does, gets no
row. NumPy is always there; Numba, Dr.Jit, Mitsuba 3 and batoid where they are installed: pip install '.[peers]'.
"""

from __future__ import annotations

import importlib
import json
import sys
import time
from collections.abc import Callable
from importlib.metadata import version

import numpy as np
from scipy.stats import chi2

from irtscots_cl.bench.suite import conditions, peak_memory_mib
from irtscots_cl.execution.device_tracer import DeviceTracer
from irtscots_cl.opencl.device import Device, select_device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.estimators.sequential import SequentialTask
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.packing.sources import emitters
from irtscots_cl.tracing.results.transport import Transport
from irtscots_cl.tracing.trace import trace

ROUNDS = 5
CHECKED_RAYS = 4096  # per screen pixel: to compile, and to compare with ours
RAYS = 409_600  # per screen pixel, ours of a round
SIGMAS = 5  # of a fraction's difference from ours: a correct peer fails with a chance of 6e-7
BLOCK = 5  # detector pixels along each side of the squares whose counts are compared: 130 of the checked rays in each
PEERS = {  # name: (module of peers/, its function, rays per screen pixel of a round)
    "NumPy float64": ("numpy_peer", "peer", 20_480),
    **{
        f"Numba {words} {real}": ("numba_peer", f"{words}_{real}", 409_600)
        for real in ("float32", "float64")
        for words in ("hash", "philox", "lattice")
    },
    "Dr.Jit LLVM float32": ("drjit_peer", "peer", 204_800),
    "Mitsuba 3 ray casting": ("mitsuba_peer", "peer", 40_960),
    "batoid, NumPy emission": ("batoid_peer", "peer", 20_480),
}
Peer = Callable[[int, int, dict], np.ndarray]


def job() -> dict:
    """The scene's numbers, from this program's own description but traced by nobody here."""
    scene = load_scene("sphere")
    setup = Setup(scene)
    chief = setup.chief_rays
    sources, _ = emitters(setup, "fp64", 1.0, "mirror")
    return {
        "radius": scene.mirror.radius_mm,
        "rim2": (scene.mirror.diameter_mm / 2) ** 2,
        "pitch": scene.screen.pitch_mm,
        "sources": np.array([list(source) for source in sources]),  # x, y, centre l, m, aim ll, ml, mm
        "screen": np.vstack([chief.screen_frame.position_mm, chief.screen_frame.axes]),
        "camera": np.vstack([chief.camera_frame.position_mm, chief.camera_frame.axes]),
        "aperture2": (scene.camera.aperture_diameter_mm / 2) ** 2,
        "focal": scene.camera.focal_length_mm,
        "image": scene.camera.image_distance_mm,
        "pixel": scene.camera.detector.pitch_mm,
        "pixels": scene.camera.detector.pixels[0],
    }


def our_image(transport: Transport) -> np.ndarray:
    """Our counts [pixels, pixels]."""
    columns, rows = transport.scene.camera.detector.pixels
    image = np.zeros(rows * columns, np.int64)
    image[transport.windows.pixels] = transport.hits()
    return image.reshape(rows, columns)


def difference(image: np.ndarray, rays: int, ours: np.ndarray, our_rays: int) -> str | None:
    """How a peer's counts [pixels, pixels] of that many rays differ from ours, or None if chance explains it.

    Two tests, each failing a correct peer with a chance of 6e-7: the fraction of detected rays against Poisson errors,
    and a chi-square of two samples over blocks of BLOCK x BLOCK pixels, which a turned or shifted image does not pass.
    """
    fraction, expected = image.sum() / rays, ours.sum() / our_rays
    sigma = np.sqrt(expected * (1 / rays + 1 / our_rays))
    if abs(fraction - expected) > SIGMAS * sigma:
        return f"detects {fraction:.5f} of its rays, ours {expected:.5f} +- {sigma:.5f}"
    theirs, own = _blocks(image), _blocks(ours)
    filled = theirs + own > 0
    scale = np.sqrt(own.sum() / theirs.sum())
    square = np.sum((theirs * scale - own / scale)[filled] ** 2 / (theirs + own)[filled])
    chance = chi2.sf(square, filled.sum() - 1)
    return None if chance > 6e-7 else f"its image is not ours: chi-square {square:.0f} over {filled.sum()} blocks"


def _blocks(image: np.ndarray) -> np.ndarray:
    """Counts [blocks] of BLOCK x BLOCK pixels."""
    n = len(image) // BLOCK
    return image.reshape(n, BLOCK, n, BLOCK).sum((1, 3)).ravel().astype(float)


def usable_peers(given: dict, ours: Transport) -> dict[str, tuple[Peer, int]]:
    """Peers that are installed, run here and do the same work, compiled; a line is printed for each, and the others."""
    found = {}
    for name, (module, function, of_pixel) in PEERS.items():
        try:
            peer = getattr(importlib.import_module(f"peers.{module}"), function)
            image = peer(CHECKED_RAYS, 7, given)
        except ImportError as error:
            print(f"{name}: not installed ({error}): no row; pip install '.[peers]'")
            continue
        except Exception as error:  # of another package's backend, such as a missing libLLVM
            print(f"{name}: does not run here ({str(error).splitlines()[0]}): no row")
            continue
        rays = CHECKED_RAYS * len(given["sources"])
        wrong = difference(image, rays, our_image(ours), ours.rays_total)
        print(f"{name}: " + (f"not the same work: no row; {wrong}" if wrong else f"same work, {image.sum()} of {rays}"))
        if not wrong:
            found[name] = (peer, of_pixel)
    return found


def our_tracers(device: Device) -> dict[str, DeviceTracer]:
    """Our forward estimator by sampler, and in double precision where the device has it."""
    options = {f"irtscots-cl {sampler}": TraceOptions("forward", sampler) for sampler in ("philox", "sobol", "lattice")}
    if device.has_fp64:
        options |= {f"irtscots-cl {s} fp64": TraceOptions("forward", s, "fp64") for s in ("philox", "lattice")}
    setup = Setup(load_scene("sphere"))
    return {name: DeviceTracer(SequentialTask(setup, option), device) for name, option in options.items()}


def time_all(
    tracers: dict[str, DeviceTracer], peers: dict[str, tuple[Peer, int]], given: dict
) -> dict[str, list[float]]:
    """Rays per second by name, of ROUNDS rounds in which all take their turns. Kernel time of ours, wall of peers."""
    sources = len(given["sources"])
    rates: dict[str, list[float]] = {name: [] for name in (*tracers, *peers)}
    for tracer in tracers.values():
        tracer.throughput(CHECKED_RAYS * sources)  # warm-up, as the peers had theirs
    for seed in range(ROUNDS):
        for name, tracer in tracers.items():
            rates[name].append(tracer.throughput(RAYS * sources))
        for name, (peer, of_pixel) in peers.items():
            started = time.perf_counter()
            peer(of_pixel, seed, given)
            rates[name].append(of_pixel * sources / (time.perf_counter() - started))
    return rates


def against_numba(rates: dict[str, list[float]]) -> dict[str, float]:
    """Our rate over Numba's, median of the rounds' ratios: with the same random numbers, and each with its fastest."""
    found = {}
    for real, ending in (("float32", ""), ("float64", " fp64")):
        ours = {s: f"irtscots-cl {s}{ending}" for s in ("philox", "sobol", "lattice")}
        theirs = {words: f"Numba {words} {real}" for words in ("philox", "lattice", "hash")}
        ours, theirs = ({k: np.array(rates[n]) for k, n in of.items() if n in rates} for of in (ours, theirs))
        for words in ours.keys() & theirs.keys():
            found[f"{words} {real}"] = float(np.median(ours[words] / theirs[words]))
        if ours and theirs:
            best = (max(of.values(), key=np.median) for of in (ours, theirs))
            found[f"each its best {real}"] = float(np.median(np.divide(*best)))
    return dict(sorted(found.items()))


def main() -> None:
    device, given = select_device(), job()
    facts = conditions(device)
    ours = trace(load_scene("sphere"), device=device, estimator="forward", rays_per_pixel=RAYS, replicates=1)
    peers = usable_peers(given, ours)
    rates = time_all(our_tracers(device), peers, given)
    base = np.array(rates["irtscots-cl philox"])  # ratios within a round: the machine's speed changes between them
    rows = {
        name: {"rays_per_second": float(np.median(r)), "lowest": min(r), "highest": max(r),
               "of_ours_with_philox": float(np.median(np.array(r) / base))} for name, r in rates.items()
    }  # fmt: skip
    for name, row in rows.items():
        print(f"{name:24} {row['rays_per_second'] / 1e6:8.1f} M rays/s   {row['of_ours_with_philox']:.3f}")
    for name, ratio in (numba := against_numba(rates)).items():
        print(f"ours over Numba, {name:22} {ratio:.2f}")
    warm = {"rounds": ROUNDS, "warm_up_rays_per_pixel": CHECKED_RAYS, "peak_memory_mib": peak_memory_mib()}
    facts["versions"] |= {
        name: version(name) for name in ("numba", "drjit", "mitsuba", "batoid") if name in sys.modules
    }
    print(json.dumps(facts | warm | {"rows": rows, "over_numba": numba}))


if __name__ == "__main__":
    main()
