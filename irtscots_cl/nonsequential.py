"""The non-sequential estimator: light goes from element to element in any order, and is kept by its path."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from irtscots_cl.aiming import emitters
from irtscots_cl.calibration import calibrate, check_visible
from irtscots_cl.device import Device, select_device
from irtscots_cl.execution import Workspace
from irtscots_cl.interface import PATH, PRECISIONS
from irtscots_cl.launches import Pace, launch_structure, plan_launches, share_rays
from irtscots_cl.options import BRANCHES, NONSEQUENTIAL, TraceOptions
from irtscots_cl.packing import pack
from irtscots_cl.partpacking import pack_elements, pack_scatter, path_job
from irtscots_cl.parts import Part, check_media, parts_of
from irtscots_cl.paths import KINDS, MAX_EVENTS, PathFlux, PathLight, StayingFlux, events_of, kind_of, name_of
from irtscots_cl.program import Source, check_precision, compose
from irtscots_cl.runner import run_rays
from irtscots_cl.scene import Scene, SceneError
from irtscots_cl.sequence import NO_FOCUS, path_focus

# As in kernels/finish.cl: then one per element, absorbed. "parted" are no end, but rays beside those launched.
ENDS = ("detected", "escaped", "bounce limit", "failed", "parted")
KEPT_PATHS = 64  # the most powerful ones and, last, all others
PILOT_RAYS = 2**22  # that look for paths
PILOT = 2**20  # their replicate, which no run has
FOUND_SIZE = 2**20  # detected rays that a pilot can tell of
SCALE_BITS = 22  # of a path's largest weight in the pilot; leaves 2^9 for larger ones
MAX_IMAGE_BYTES = 2**31
LEAST_CHANCE = 0.1  # of either branch at an interface
STAYING_ONE = 2.0**20  # as in kernels/finish.cl
MAX_RAYS_PER_ITEM = 2**16
FIRST_LAUNCH_RAYS = 2**20  # before a launch has been timed


def trace_paths(
    scene: Scene,
    *,
    device: Device | None = None,
    sampler: str = "philox",
    precision: str = "fp32",
    rays_per_pixel: int = 2**16,
    replicates: int = 8,
    seed: int = 1,
    overfill: float = 1.0,
    bounce_limit: int = MAX_EVENTS,
    least_chance: float = LEAST_CHANCE,
    branches: str = "roulette",
    aimed_scatter: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> PathLight:
    """Trace rays_per_pixel rays per screen pixel, aimed at the mirror, from element to element to their ends.

    bounce_limit: events after which a ray is given up (and counted). least_chance: with which a ray is reflected or
    refracted at an interface however small that share of its light is; its weight makes up for it. branches: "roulette"
    follows one of them, "both" both, as long as the weaker one weighs a thousandth of a ray and not too many rays wait
    to be followed. aimed_scatter: scattered rays are also aimed at the camera (parts.targets_of); without, only what
    finds it by chance counts. The rest as in tracer.trace. Raises as that does.
    """
    options = TraceOptions(NONSEQUENTIAL, sampler, precision, seed, overfill=overfill)
    if not 1 <= bounce_limit <= MAX_EVENTS:
        raise ValueError(f"--bounce-limit = {bounce_limit}: must be 1 to {MAX_EVENTS}")
    if not 0 <= least_chance <= 0.5:
        raise ValueError(f"--least-chance = {least_chance}: must be 0 to 0.5")
    if branches not in BRANCHES:
        raise ValueError(f"--branches = {branches!r}: must be one of {', '.join(BRANCHES)}")
    rays = share_rays(rays_per_pixel, replicates)
    device = device if device is not None else select_device()
    started = time.perf_counter()
    tracer = PathTracer(scene, device, options, bounce_limit, least_chance, branches, aimed_scatter)
    kept = tracer.find()
    if not kept.codes:
        raise SceneError(
            f"scene {scene.name}: detector: no path from the screen reaches it; must be reached by one of "
            f"{max(PILOT_RAYS // tracer.streams, 16) * tracer.streams} rays that look for paths"
        )
    built = time.perf_counter()
    images, sums = tracer.run(rays, kept, progress)
    traced = time.perf_counter()
    seconds = {"build": built - started, "trace": traced - built, "kernels": tracer.kernel_seconds}
    ends = tracer.ends(sums, int(rays.sum()) * tracer.streams)
    images_w = images * (tracer.unit_w / kept.of_kind)[None, :, None, None] / rays[:, None, None, None]
    return PathLight(scene, options, device.describe(), tracer.fluxes(sums, kept, rays), tracer.staying(sums, rays),
                     tracer.launched_w, images_w, rays, ends, _ledger(ends), seconds)  # fmt: skip


@dataclass(frozen=True)
class Kept:
    """Paths that are kept apart, by code, with their largest weight in the pilot run; by power, the largest first."""

    codes: tuple[int, ...]
    weights: tuple[float, ...]

    @property
    def of_kind(self) -> np.ndarray:
        """What weights are multiplied by to be whole numbers, in the images of each of KINDS."""
        kinds = [kind_of(code) for code in self.codes]
        largest = [max((w for w, k in zip(self.weights, kinds, strict=True) if k == kind), default=1.0)
                   for kind in range(len(KINDS))]  # fmt: skip
        return np.array([_scale(weight) for weight in largest])

    def table(self) -> np.ndarray:
        """The kernels' Path structures: these paths', then one for all others, which count as ghosts."""
        table, of_kind = np.zeros(len(self.codes) + 1, PATH), self.of_kind
        for entry, code, weight in zip(table, self.codes, self.weights, strict=False):
            kind = kind_of(code)
            entry["low"], entry["high"] = code & 0xFFFFFFFF, code >> 32
            entry["scale"], entry["class_scale"], entry["kind"] = _scale(weight), of_kind[kind], kind
        table["scale"][-1], table["kind"][-1], table["class_scale"][-1] = 2.0**SCALE_BITS, 1, of_kind[1]
        return table


class PathTracer:
    """The kernel and buffers of one scene on one device.

    source: what was built. streams: screen pixels. unit_w: flux [W] of weight 1 in a run of one ray per screen pixel,
    launched_w: of all rays.
    kernel_seconds: of `run` so far. A runner.Job. Raises DeviceError if the device cannot build or hold it.
    """

    def __init__(
        self,
        scene: Scene,
        device: Device,
        options: TraceOptions,
        bounce_limit: int = MAX_EVENTS,
        least_chance: float = LEAST_CHANCE,
        branches: str = "roulette",
        aimed_scatter: bool = True,
    ):
        check_precision(device, options.precision)
        calibration = calibrate(scene)
        check_visible(calibration, f"scene {scene.name}")
        self.scene, self.options, self.parts, self.pace = scene, options, parts_of(scene), Pace()
        self.max_rays_per_item, self.first_launch_rays = MAX_RAYS_PER_ITEM, FIRST_LAUNCH_RAYS
        check_media(scene, self.parts)
        real, packed = PRECISIONS[options.precision], pack(calibration, options.precision)
        elements = pack_elements(scene, self.parts, real, least_chance)
        sources, area = emitters(calibration, options.precision, options.overfill, options.aim)
        self.streams, self._job = len(sources), path_job(scene, self.parts, real, bounce_limit, sources)
        scatter, structs = pack_scatter(scene, self.parts, real, aimed_scatter)
        structs |= {"Element": elements.dtype, "Path": PATH, "PathJob": self._job.dtype}
        self.source = _compose(packed, self.parts, structs, options, branches, device)
        gain = scene.screen.radiance * scene.screen.pitch_mm**2
        self.unit_w, self.launched_w = gain * float(area.max()), gain * float(area.sum())
        self._image_shape = (len(KINDS), sum(scene.screen.pixels), int(np.prod(scene.camera.detector.pixels)))
        self._sums_shape = (len(ENDS) + 2 * len(self.parts) + 2 + 2 * KEPT_PATHS,)
        size = 8 * int(np.prod(self._image_shape))
        if size > MAX_IMAGE_BYTES:
            raise ValueError(f"scene {scene.name}: images of {self._image_shape[1]} lines with {self._image_shape[2]} "
                             f"pixels take {size} bytes; must be at most {MAX_IMAGE_BYTES}")  # fmt: skip
        self._workspace = work = Workspace(device, self.source, "trace_paths")
        self._before = [work.upload(array) for array in (packed.scene, sources, elements, scatter)]
        self._sums, self._images = work.empty(8 * self._sums_shape[0]), work.empty(size)
        self._found = work.empty(4 * (1 + 3 * FOUND_SIZE))

    def find(self) -> Kept:
        """The paths that reach the detector in a pilot run."""
        found = np.zeros(1 + 3 * FOUND_SIZE, np.uint32)
        self._workspace.clear(self._found)
        self.clear()
        self._keep(Kept((), ()), FOUND_SIZE)
        rays = max(PILOT_RAYS // self.streams, 16)
        for part in plan_launches(self.streams, rays, lambda: self.first_launch_rays, self.max_rays_per_item):
            self.launch(PILOT, part)
        self._workspace.download(self._found, found)
        low, high, bits = found[1:].reshape(-1, 3)[: min(int(found[0]), FOUND_SIZE)].T
        weights = bits.copy().view(np.float32).astype(float)
        codes, index = np.unique(high.astype(np.uint64) << np.uint64(32) | low.astype(np.uint64), return_inverse=True)
        largest, power = np.zeros(len(codes)), np.bincount(index, weights, len(codes))
        np.maximum.at(largest, index, weights)
        best = [k for k in np.argsort(-power, kind="stable")[: KEPT_PATHS - 1] if largest[k] > 0]
        return Kept(tuple(int(codes[k]) for k in best), tuple(float(largest[k]) for k in best))

    def run(self, rays: np.ndarray, kept: Kept, progress=None) -> tuple[np.ndarray, np.ndarray]:
        """Images [replicates, kinds, lines, pixels] and sums [replicates, ends + elements + 2 paths]: whole numbers."""
        self._keep(kept, 0)
        return run_rays(self, rays, progress)

    def clear(self) -> None:
        for buffer in (self._images, self._sums):
            self._workspace.clear(buffer)

    def sums(self) -> tuple[np.ndarray, np.ndarray]:
        """Images and sums, without their replicates, of the launches since the last clear."""
        work = self._workspace
        return (work.download(self._images, np.empty(self._image_shape, np.uint64)),
                work.download(self._sums, np.empty(self._sums_shape, np.uint64)))  # fmt: skip

    def throughput(self, rays: int) -> float:
        """Rays per second of one launch of about that many rays, from its kernel's time; paths are not told apart."""
        of_stream = max(rays // self.streams, 1)
        self._keep(Kept((), ()), 0)
        self.clear()
        self.pace.kernel_seconds = 0.0
        self.launch(0, (0, self.streams, 0, of_stream))
        return of_stream * self.streams / self.kernel_seconds

    def ends(self, sums: np.ndarray, launched: int) -> dict[str, int]:
        """Rays of all replicates by where they ended; they add up to those launched and those that parted from others.

        AssertionError if not: a bug.
        """
        names = (*ENDS, *(f"absorbed by {part.name}" for part in self.parts))
        found = dict(zip(names, (int(n) for n in sums.sum(0)[: len(names)]), strict=True))
        parted = found.pop("parted")
        ended = sum(found.values())
        assert ended == launched + parted, f"{launched + parted} rays launched and parted, {ended} accounted for"
        return {"launched": launched, "parted": parted} | found

    def fluxes(self, sums: np.ndarray, kept: Kept, rays: np.ndarray) -> tuple[PathFlux, ...]:
        """Flux of every path, by power, and last of all others."""
        paths = sums[:, -2 * KEPT_PATHS :].reshape(len(rays), KEPT_PATHS, 2)
        names = tuple(part.name for part in self.parts)
        labels = [(name_of(code, names), KINDS[kind_of(code)]) for code in kept.codes] + [("other", "other")]
        sharp = [*(path_focus(self.parts, events_of(code)) for code in kept.codes), NO_FOCUS]
        found = []
        for p, (label, entry) in enumerate(zip(labels, kept.table(), strict=True)):
            flux = self._watts(paths[:, p, 1] / float(entry["scale"]), rays)
            found.append(PathFlux(*label, *flux, int(paths[:, p, 0].sum()), *sharp[p]))
        return (*sorted(found[:-1], key=lambda path: -path.flux_w), found[-1])

    def staying(self, sums: np.ndarray, rays: np.ndarray) -> tuple[StayingFlux, ...]:
        """Light that does not reach the detector, by where it stays: absorbed by elements, escaped, given up."""
        names = (*(f"absorbed by {part.name}" for part in self.parts), "escaped", "bounce limit")
        first = len(ENDS) + len(self.parts)
        weights = sums[:, first : first + len(names)] / STAYING_ONE
        return tuple(StayingFlux(name, *self._watts(each, rays)) for name, each in zip(names, weights.T, strict=True))

    def _watts(self, weights: np.ndarray, rays: np.ndarray) -> tuple[float, float]:
        """Flux of weights [replicates] in W and its standard error."""
        each = weights * self.unit_w / rays
        error = float(np.std(each, ddof=1) / np.sqrt(len(rays))) if len(rays) > 1 else float("nan")
        return float(np.average(each, weights=rays)), error

    @property
    def kernel_seconds(self) -> float:
        return self.pace.kernel_seconds

    def _keep(self, kept: Kept, found_size: int) -> None:
        """What the next launches tell apart; with found_size above 0 they list what is detected instead."""
        table = kept.table()
        self._paths = self._workspace.upload(table)
        self._job["path_count"], self._job["found_size"] = len(table), found_size

    def launch(self, replicate: int, part: tuple[int, int, int, int]) -> None:
        _, streams, _, rays = part
        per_item = max(1, min(rays, self.max_rays_per_item))
        launch = launch_structure(self.scene, self.options, replicate, part, per_item)
        scene, *tables = self._before
        arguments = [scene, launch, *tables, self._paths, self._sums, self._images, self._found, self._job]
        seconds = self._workspace.launch((streams, max(1, -(-rays // per_item))), arguments)
        self.pace.launched(streams * rays, seconds)


def _compose(packed, parts: tuple[Part, ...], structs, options: TraceOptions, branches: str, device: Device) -> Source:
    """The kernel's source, with the shapes and kinds of elements and the scatter models that there are, no others."""
    kinds, models = {part.kind for part in parts}, {_model(part) for part in parts} - {"none"}
    refracts = any(part.refracts for part in parts)
    choices = packed.choices | {
        "sampler": options.sampler,
        "keys": "random" if refracts or models else "none",
        "spawn": "list" if models or (refracts and branches == "both") else "none",
        "branch": branches,
    }
    # made of the program's own words: no text of a scene comes into a source
    calls = " ".join(f"DO({part.shape}, {part.kind}, {_model(part)}, {k})" for k, part in enumerate(parts))
    deviated = ("element_deviated.cl",) if any(part.shape == "deviated" for part in parts) else ()
    finish = ("finish_refractor.cl" if branches == "roulette" else "finish_both.cl",) * refracts
    first = (*deviated, *(f"interact_{kind}.cl" for kind in sorted(kinds)), *finish,
             *(f"scatter_{model}.cl" for model in sorted(models)))  # fmt: skip
    width = device.vector_width(options.precision)
    return compose("trace_paths.cl", choices, packed.structs | structs, options.precision, width, packed.constants,
                   {"ELEMENTS(DO)": calls}, first)  # fmt: skip


def _model(part: Part) -> str:
    return "none" if part.scatter is None else type(part.scatter).__name__.lower()


def _ledger(ends: dict[str, int]) -> dict[str, int]:
    """The ends in the words of all estimators' ledgers."""
    absorbed = sum(count for name, count in ends.items() if name.startswith("absorbed by "))
    return {
        "launched": ends["launched"] + ends["parted"], "detected": ends["detected"], "missed_mirror": ends["escaped"],
        "clipped": 0, "off_detector": 0, "off_screen": 0, "absorbed": absorbed,
        "failed": ends["failed"] + ends["bounce limit"],
    }  # fmt: skip


def _scale(weight: float) -> float:
    """A power of two that takes the weight to at most 2^SCALE_BITS."""
    return float(2.0 ** (SCALE_BITS - np.ceil(np.log2(weight))))
