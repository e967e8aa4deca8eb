#!/usr/bin/env python3
"""This program's kernels against the least that their work takes: small kernels of one job each, all in one run.

The job: the preset `sphere`. The kernels of limit/ know this scene alone: forward with random words of Philox or a
lattice, with counting and without, and adjoint with sums instead of a map. Each is built for 8 and for 16 rays side by
side, and the faster counts. Before that its light is compared with ours. Rates are medians of rounds in which all take
their turns, of OpenCL's own times; ratios are within rounds. Our forward sources get whole work-items, as in long runs.
A limit kernel aims at a square, which is simpler: pi / 4 of its rays are of use at most. So there is a second ratio, of
the rays that meet the mirror.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from compare_peers import difference, job, our_image

from irtscots_cl.bench.suite import conditions
from irtscots_cl.execution.device_tracer import MIN_TIMED_RAYS, DeviceTracer
from irtscots_cl.execution.launch_plan import MAX_RAYS_PER_ITEM
from irtscots_cl.opencl.device import Device, DeviceError, select_device
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import compose
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.estimators.sequential import SequentialTask
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.results.transport import Transport
from irtscots_cl.tracing.trace import trace

FOLDER = Path(__file__).parent / "limit"
WIDTHS = (8, 16)
ROUNDS = 9
SECONDS = 0.25  # of a timed launch
CHECKED_RAYS = 2**14  # per source
OUR_RAYS = {"forward": 2**16, "adjoint": 2**13}  # per source, to compare with
WARM_UP_RAYS = 2**22
SIGMAS = 5
CENTRES = 1.2  # root mean square over the pixels, of chance's errors: independent rays have 1, even ones less
LIMITS = {  # name: the files of limit/ in order
    "forward philox": ("words_philox", "forward", "count_hits"),
    "forward lattice": ("words_lattice", "forward", "count_hits"),
    "forward lattice, no accumulation": ("words_lattice", "forward", "count_nothing"),
    "adjoint lattice, moments": ("words_lattice", "adjoint"),
}
OURS = {  # name: (options, accumulation, limit to compare with)
    "forward philox": (TraceOptions("forward", "philox"), None, "forward philox"),
    "forward sobol": (TraceOptions("forward", "sobol"), None, "forward lattice"),
    "forward lattice": (TraceOptions("forward", "lattice"), None, "forward lattice"),
    "forward lattice, no accumulation": (
        TraceOptions("forward", "lattice"), "none", "forward lattice, no accumulation"
    ),
    "adjoint philox": (TraceOptions("adjoint", "philox"), None, "adjoint lattice, moments"),
    "adjoint sobol": (TraceOptions("adjoint", "sobol"), None, "adjoint lattice, moments"),
    "adjoint lattice": (TraceOptions("adjoint", "lattice"), None, "adjoint lattice, moments"),
}  # fmt: skip
NUMBERS = (
    "radius", "rim", "pitch", "screen_x", "screen_z", "screen_cos", "screen_sin", "camera_x", "camera_z", "camera_cos",
    "camera_sin", "aperture", "aperture2", "of_position", "of_slope", "middle", "pixel", "focus", "lines",
)  # fmt: skip
SEED = np.uint32(7)
STEP = 256  # BLOCK of the kernels
LIMIT = np.dtype([*((name, np.float32) for name in NUMBERS), ("side", np.int32)])


def numbers(given: dict) -> np.ndarray:
    """The kernels' structure, from the job of compare_peers."""
    screen, camera, focal, image = given["screen"], given["camera"], given["focal"], given["image"]
    focus = 1 / (1 / focal - 1 / image)
    out = np.zeros((), LIMIT)
    values = {
        "radius": given["radius"], "rim": given["rim2"] ** 0.5, "pitch": given["pitch"], "screen_x": screen[0, 0],
        "screen_z": screen[0, 2], "screen_cos": screen[1, 0], "screen_sin": screen[1, 2], "camera_x": camera[0, 0],
        "camera_z": camera[0, 2], "camera_cos": camera[1, 0], "camera_sin": camera[1, 2],
        "aperture": 2 * given["aperture2"] ** 0.5, "aperture2": given["aperture2"],
        "of_position": -(1 - image / focal) / given["pixel"], "of_slope": -image / given["pixel"],
        "middle": given["pixels"] / 2, "side": given["pixels"], "pixel": given["pixel"] * focus / image,
        "focus": focus, "lines": 1 / given["pitch"],
    }  # fmt: skip
    for name, value in values.items():
        out[name] = value
    return out


class LimitKernel:
    """A limit kernel on a device, for all sources of rays at the places [sources, 2], mm, on the screen or in focus."""

    def __init__(self, device: Device, name: str, width: int, given: dict, places: np.ndarray):
        kernel = LIMITS[name][1]
        *first, entry = (FOLDER / f"{part}.cl" for part in LIMITS[name])
        source = compose(entry, {}, {"Limit": LIMIT}, "fp32", width, first=tuple(first))
        self.width, self.numbers = width, numbers(given)
        self.work = Workspace(device, source, f"limit_{kernel}")
        bins = 3 if kernel == "adjoint" else int(self.numbers["side"]) ** 2
        self.shape, self.places = (len(places), bins), self.work.upload(places.astype(np.float32))
        self.sums = self.work.empty(4 * len(places) * bins)
        self.throughput(len(places))  # some drivers compile at the first launch

    def throughput(self, rays: int) -> float:
        """Rays per second of one launch of at least that many rays."""
        of_source = STEP * -(-rays // (STEP * self.shape[0]))
        self.work.clear(self.sums)
        seconds = self.work.launch(
            (self.shape[0], 1), [self.numbers, SEED, np.uint32(of_source), self.places, self.sums]
        )
        return of_source * self.shape[0] / seconds

    def counted(self, rays: int) -> np.ndarray:
        """The kernel's sums [sources, bins] of that many rays of each source."""
        self.throughput(rays * self.shape[0])
        return self.work.download(self.sums, np.empty(self.shape, np.int32))


def places_of(given: dict, ours: Transport) -> dict[str, np.ndarray]:
    """Where the sources are, by estimator: the screen's pixels, and the detector pixels that see the mirror."""
    focus = float(numbers(given)["focus"])
    rows, columns = np.divmod(ours.windows.pixels, given["pixels"])
    middle = (given["pixels"] - 1) / 2
    pixels = np.stack([columns - middle, rows - middle], -1) * given["pixel"] * focus / given["image"]
    return {"forward": given["sources"][:, :2], "adjoint": pixels}


def fault(kernel: LimitKernel, estimator: str, given: dict, ours: Transport) -> str | None:
    """How a limit kernel's light differs from ours, or None if chance explains it."""
    found = kernel.counted(CHECKED_RAYS)
    rays = CHECKED_RAYS * len(found)
    on_mirror = 1 - ours.ledger["missed_mirror"] / ours.rays_total
    if estimator == "forward":  # a disk's share of its square, where ours aims at an ellipse around the disk
        image = found.sum(0, dtype=np.int64).reshape(given["pixels"], -1)
        return difference(image, round(rays * np.pi / 4 / on_mirror), our_image(ours), ours.rays_total)
    share = found[:, 0].sum() / (rays * np.pi / 4)
    sigma = np.sqrt(on_mirror * (1 - on_mirror) * (1 / rays + 1 / ours.rays_total))
    if abs(share - on_mirror) > SIGMAS * sigma:
        return f"{share:.5f} of its rays meet the mirror, ours {on_mirror:.5f} +- {sigma:.5f}"
    for axis in (0, 1):
        light = ours.counts.sum(0).sum(1 + axis, dtype=np.float64)  # [pixels, lines]
        lines = ours.windows.origins[:, axis, None] + np.arange(light.shape[1])
        lines = lines - (ours.scene.screen.pixels[axis] - 1) / 2
        both = (light.sum(1) > 0) & (found[:, 0] > 0)
        light, lines, sums = light[both], lines[both], found[both]
        centre = (light * lines).sum(1) / light.sum(1)
        spread2 = (light * lines**2).sum(1) / light.sum(1) - centre**2 + 1 / 12
        errors = (sums[:, 1 + axis] / sums[:, 0] - centre) / np.sqrt(spread2 * (1 / sums[:, 0] + 1 / ours.rays.sum()))
        if (rms := np.sqrt(np.mean(errors**2))) > CENTRES:
            return (
                f"the screen's lines that it lights differ from ours by {rms:.2f} of chance's errors along {'xy'[axis]}"
            )
    return None


def checked_limits(device: Device, given: dict) -> tuple[dict[str, list[LimitKernel]], dict[str, float]]:
    """The limit kernels by name, of each width, and by estimator the share of our rays that meets the mirror over that
    of theirs. SystemExit if one does other work than ours."""
    scene, found = load_scene("sphere"), {}
    ours = {estimator: trace(scene, device=device, estimator=estimator, rays_per_pixel=rays, replicates=1)
            for estimator, rays in OUR_RAYS.items()}  # fmt: skip
    places = places_of(given, ours["forward"])
    for name in LIMITS:
        estimator = name.split()[0]
        found[name] = [LimitKernel(device, name, width, given, places[estimator]) for width in WIDTHS]
        for kernel in found[name]:
            if "nothing" not in LIMITS[name][-1] and (wrong := fault(kernel, estimator, given, ours[estimator])):
                raise SystemExit(f"limit {name}, {kernel.width} rays side by side: not the same work: {wrong}")
    met = {estimator: 1 - run.ledger["missed_mirror"] / run.rays_total for estimator, run in ours.items()}
    # of an adjoint limit kernel's rays pi / 4 pass the aperture, and of these as many meet the mirror as of ours
    return found, {"forward": met["forward"] / (np.pi / 4), "adjoint": 4 / np.pi}


class OurTracer(DeviceTracer):
    """A tracer whose forward sources get whole work-items."""

    def throughput(self, rays: int) -> float:
        whole = self.task.options.estimator == "forward"
        return super().throughput(rays, MAX_RAYS_PER_ITEM if whole else MIN_TIMED_RAYS)


def our_tracers(device: Device) -> dict[str, DeviceTracer]:
    setup = Setup(load_scene("sphere"))
    return {name: OurTracer(SequentialTask(setup, options, accumulate=accumulate), device)
            for name, (options, accumulate, _) in OURS.items()}  # fmt: skip


def time_all(timed: dict[str, LimitKernel | DeviceTracer], rounds: int) -> dict[str, list[float]]:
    """Rays per second by name, of rounds in which all take their turns."""
    rays = {name: int(one.throughput(WARM_UP_RAYS) * SECONDS) for name, one in timed.items()}
    rates: dict[str, list[float]] = {name: [] for name in timed}
    for _ in range(rounds):
        for name, one in timed.items():
            rates[name].append(one.throughput(rays[name]))
    return rates


def table(
    limits: dict[str, list[LimitKernel]], rates: dict[str, list[float]], of_use: dict[str, float]
) -> dict[str, dict]:
    """Rows by name: rates, and of ours the ratio to the limit, of medians' faster width, within each round.

    of_use: see checked_limits.
    """
    rows, fastest = {}, {}
    for name, kernels in limits.items():
        of_width = {kernel.width: rates[_label(name, kernel)] for kernel in kernels}
        width = max(of_width, key=lambda w: float(np.median(of_width[w])))
        fastest[name] = np.array(of_width[width])
        rows[f"limit {name}"] = _row(of_width[width]) | {
            "side_by_side": width, "of_each_width": {w: float(np.median(r)) for w, r in of_width.items()}
        }  # fmt: skip
    for name, (_, _, limit) in OURS.items():
        ratios = np.array(rates[name]) / fastest[limit]
        rows[name] = _row(rates[name]) | {"limit": limit, "of_limit": float(np.median(ratios)),
                                          "of_limit_on_mirror": float(np.median(ratios)) * of_use[name.split()[0]],
                                          "of_limit_lowest": float(ratios.min()),
                                          "of_limit_highest": float(ratios.max())}  # fmt: skip
    return rows


def _row(rates: list[float]) -> dict[str, float]:
    return {"rays_per_second": float(np.median(rates)), "lowest": min(rates), "highest": max(rates)}


def _label(name: str, kernel: LimitKernel) -> str:
    return f"limit {name}, {kernel.width} side by side"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device")
    parser.add_argument("--rounds", type=int, default=ROUNDS, metavar="N", help=f"of all in turn (default {ROUNDS})")
    options = parser.parse_args()
    try:
        device = select_device(options.device)
        (limits, of_use), tracers = checked_limits(device, job()), our_tracers(device)
    except DeviceError as error:
        print(f"compare_limit.py: {error}", file=sys.stderr)
        sys.exit(2)
    timed = {_label(name, kernel): kernel for name, kernels in limits.items() for kernel in kernels} | tracers
    rows = table(limits, time_all(timed, options.rounds), of_use)
    for name, row in rows.items():
        of_limit = "limit" in row and (
            f"{row['of_limit']:7.3f} ({row['of_limit_lowest']:.3f} to {row['of_limit_highest']:.3f}) "
            f"of {row['limit']}; on the mirror {row['of_limit_on_mirror']:.3f}"
        )
        print(f"{name:40} {row['rays_per_second'] / 1e6:7.1f} M rays/s {of_limit or ''}")
    print(json.dumps(conditions(device) | {"rounds": options.rounds, "rows": rows}))


if __name__ == "__main__":
    main()
