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
from irtscots_cl.interface import PATH, PRECISIONS, element_dtype, path_job_dtype
from irtscots_cl.launches import Pace, launch_structure, plan_launches, share_rays
from irtscots_cl.memory import check_memory
from irtscots_cl.options import NONSEQUENTIAL, TraceOptions
from irtscots_cl.packing import pack
from irtscots_cl.parts import Part, check_media, groups_of, on_screen, parts_of
from irtscots_cl.paths import KINDS, MAX_EVENTS, PathFlux, PathLight, kind_of, name_of
from irtscots_cl.program import Source, check_precision, compose
from irtscots_cl.scatter import ABg, Harvey
from irtscots_cl.scene import Scene, SceneError

# As in kernels/finish.cl: then one per element, absorbed. "parted" are no end, but rays beside those launched.
ENDS = ("detected", "escaped", "bounce limit", "failed", "parted")
KEPT_PATHS = 64  # the most powerful ones and, last, all others
PILOT_RAYS = 2**22  # that look for paths
PILOT = 2**20  # their replicate, which no run has
FOUND_SIZE = 2**20  # detected rays that a pilot can tell of
SCALE_BITS = 22  # of a path's largest weight in the pilot; leaves 2^9 for larger ones
MAX_IMAGE_BYTES = 2**31
LEAST_CHANCE = 0.1  # of either branch at an interface
SCATTER_CHANCE = 0.125  # of a ray to send another towards the camera from where it scatters
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
    progress: Callable[[int, int], None] | None = None,
) -> PathLight:
    """Trace rays_per_pixel rays per screen pixel, aimed at the mirror, from element to element to their ends.

    bounce_limit: events after which a ray is given up (and counted). least_chance: with which a ray is reflected or
    refracted at an interface however small that share of its light is; its weight makes up for it. The rest as in
    tracer.trace. Raises as that does.
    """
    options = TraceOptions(NONSEQUENTIAL, sampler, precision, seed, overfill=overfill)
    if not 1 <= bounce_limit <= MAX_EVENTS:
        raise ValueError(f"--bounce-limit = {bounce_limit}: must be 1 to {MAX_EVENTS}")
    if not 0 <= least_chance <= 0.5:
        raise ValueError(f"--least-chance = {least_chance}: must be 0 to 0.5")
    rays = share_rays(rays_per_pixel, replicates)
    device = device if device is not None else select_device()
    started = time.perf_counter()
    tracer = PathTracer(scene, device, options, bounce_limit, least_chance)
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
    return PathLight(scene, options, device.describe(), tracer.fluxes(sums, kept, rays), images_w, rays, ends,
                     _ledger(ends), seconds)  # fmt: skip


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

    source: what was built. streams: screen pixels. unit_w: flux [W] of weight 1 in a run of one ray per screen pixel.
    kernel_seconds: of `run` so far. Raises DeviceError if the device cannot build or hold it.
    """

    def __init__(
        self,
        scene: Scene,
        device: Device,
        options: TraceOptions,
        bounce_limit: int = MAX_EVENTS,
        least_chance: float = LEAST_CHANCE,
    ):
        check_precision(device, options.precision)
        calibration = calibrate(scene)
        check_visible(calibration, f"scene {scene.name}")
        self.scene, self.options, self.parts, self._pace = scene, options, parts_of(scene), Pace()
        check_media(scene, self.parts)
        real, packed = PRECISIONS[options.precision], pack(calibration, options.precision)
        elements = pack_elements(scene, self.parts, real, least_chance)
        sources, area = emitters(calibration, options.precision, options.overfill, options.aim)
        self.streams, self._job = len(sources), _job(scene, self.parts, real, bounce_limit, sources)
        self.source = _compose(packed, self.parts, elements, self._job, options, device)
        self.unit_w = scene.screen.radiance * scene.screen.pitch_mm**2 * float(area.max())
        self._image_shape = (len(KINDS), sum(scene.screen.pixels), int(np.prod(scene.camera.detector.pixels)))
        self._sums_shape = (len(ENDS) + len(self.parts) + 2 * KEPT_PATHS,)
        size = 8 * int(np.prod(self._image_shape))
        if size > MAX_IMAGE_BYTES:
            raise ValueError(f"scene {scene.name}: images of {self._image_shape[1]} lines with {self._image_shape[2]} "
                             f"pixels take {size} bytes; must be at most {MAX_IMAGE_BYTES}")  # fmt: skip
        self._workspace = work = Workspace(device, self.source, "trace_paths")
        self._before = [work.upload(array) for array in (packed.scene, sources, elements)]
        self._sums, self._images = work.empty(8 * self._sums_shape[0]), work.empty(size)
        self._found = work.empty(4 * (1 + 3 * FOUND_SIZE))

    def find(self) -> Kept:
        """The paths that reach the detector in a pilot run."""
        work, rays = self._workspace, max(PILOT_RAYS // self.streams, 16)
        found, table = np.zeros(1 + 3 * FOUND_SIZE, np.uint32), work.upload(np.zeros(1, PATH))
        for buffer in (self._found, self._sums):
            work.clear(buffer)
        for part in plan_launches(self.streams, rays, self._launch_rays, MAX_RAYS_PER_ITEM):
            self._launch(table, 1, PILOT, FOUND_SIZE, part)
        work.download(self._found, found)
        low, high, bits = found[1:].reshape(-1, 3)[: min(int(found[0]), FOUND_SIZE)].T
        weights = bits.copy().view(np.float32).astype(float)
        codes, index = np.unique(high.astype(np.uint64) << np.uint64(32) | low.astype(np.uint64), return_inverse=True)
        largest, power = np.zeros(len(codes)), np.bincount(index, weights, len(codes))
        np.maximum.at(largest, index, weights)
        best = [k for k in np.argsort(-power, kind="stable")[: KEPT_PATHS - 1] if largest[k] > 0]
        return Kept(tuple(int(codes[k]) for k in best), tuple(float(largest[k]) for k in best))

    def run(self, rays: np.ndarray, kept: Kept, progress=None) -> tuple[np.ndarray, np.ndarray]:
        """Images [replicates, kinds, lines, pixels] and sums [replicates, ends + elements + 2 paths]: whole numbers."""
        work, table = self._workspace, self._workspace.upload(kept.table())
        size = 2 * 8 * len(rays) * int(np.prod(self._image_shape))  # as whole numbers and in watts
        check_memory(f"scene {self.scene.name}: images of {len(rays)} replicates", size)
        images = np.empty((len(rays), *self._image_shape), np.uint64)
        sums = np.empty((len(rays), *self._sums_shape), np.uint64)
        done, total = 0, int(rays.sum()) * self.streams
        self._pace.kernel_seconds = 0.0
        for replicate, of_stream in enumerate(rays):
            work.clear(self._images)
            work.clear(self._sums)
            for part in plan_launches(self.streams, int(of_stream), self._launch_rays, MAX_RAYS_PER_ITEM):
                self._launch(table, len(kept.codes) + 1, replicate, 0, part)
                done += part[1] * part[3]
                if progress is not None:
                    progress(done, total)
            work.download(self._images, images[replicate])
            work.download(self._sums, sums[replicate])
        return images, sums

    def throughput(self, rays: int) -> float:
        """Rays per second of one launch of about that many rays, from its kernel's time; paths are not told apart."""
        work, of_stream = self._workspace, max(rays // self.streams, 1)
        nothing = Kept((), ())
        table = work.upload(nothing.table())
        for buffer in (self._images, self._sums):
            work.clear(buffer)
        self._pace.kernel_seconds = 0.0
        self._launch(table, 1, 0, 0, (0, self.streams, 0, of_stream))
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
        paths = sums[:, len(ENDS) + len(self.parts) :].reshape(len(rays), KEPT_PATHS, 2)
        names = tuple(part.name for part in self.parts)
        labels = [(name_of(code, names), KINDS[kind_of(code)]) for code in kept.codes] + [("other", "other")]
        found = []
        for p, (label, entry) in enumerate(zip(labels, kept.table(), strict=True)):
            each = paths[:, p, 1] / float(entry["scale"]) * self.unit_w / rays
            error = float(np.std(each, ddof=1) / np.sqrt(len(rays))) if len(rays) > 1 else float("nan")
            found.append(PathFlux(*label, float(np.average(each, weights=rays)), error, int(paths[:, p, 0].sum())))
        return (*sorted(found[:-1], key=lambda path: -path.flux_w), found[-1])

    @property
    def kernel_seconds(self) -> float:
        return self._pace.kernel_seconds

    def _launch_rays(self) -> int:
        return self._pace.launch_rays(FIRST_LAUNCH_RAYS)

    def _launch(self, table, count: int, replicate: int, found_size: int, part: tuple[int, int, int, int]) -> None:
        _, streams, _, rays = part
        per_item = max(1, min(rays, MAX_RAYS_PER_ITEM))
        launch, job = launch_structure(self.scene, self.options, replicate, part, per_item), self._job.copy()
        job["path_count"], job["found_size"] = count, found_size
        scene, sources, elements = self._before
        arguments = [scene, launch, sources, elements, table, self._sums, self._images, self._found, job]
        seconds = self._workspace.launch((streams, max(1, -(-rays // per_item))), arguments)
        self._pace.launched(streams * rays, seconds)


def pack_elements(scene: Scene, parts: tuple[Part, ...], real, least_chance: float) -> np.ndarray:
    """The parts as the kernels' structures [parts]."""
    origins, group = groups_of(scene, parts)
    out = np.zeros(len(parts), element_dtype(real, len(origins)))
    for entry, part, of in zip(out, parts, group, strict=True):
        frame = part.frame
        entry["axis_x"], entry["axis_y"], entry["axis_z"] = frame.axes
        to = (origins - frame.position_mm) @ frame.axes.T
        entry["offset"] = np.column_stack([to, np.abs(to).sum(1)])
        entry["origin"] = frame.position_mm - origins[of]
        for name in ("q_xx", "q_yy", "q_zz", "q_xz"):
            entry[name] = getattr(part.quadric, name)
        entry["outer2"], entry["inner2"] = min(part.outer_mm**2, 1e30), part.inner_mm**2
        entry["half_u"], entry["half_v"] = (min(half, 1e30) for half in part.half_mm)
        entry["reflectance"] = -1.0 if np.isnan(part.reflectance) else part.reflectance
        entry["index_front"], entry["index_back"] = part.index_front, part.index_back
        entry["least_chance"], entry["transmittance"] = least_chance, part.transmittance
        entry["inverse_focal_length"], entry["group"] = 1 / part.focal_length_mm, of
        if part.scatter is not None:
            entry["scattered"], entry["scatter_chance"] = float(part.scatter.tis_at()), SCATTER_CHANCE
            entry["scatter"] = _scatter_numbers(part.scatter)
    return out


def _scatter_numbers(model) -> tuple[float, float, float]:
    """What the model's kernels/scatter_*.cl wants."""
    if isinstance(model, Harvey):
        return float(model.bsdf(0.0)), 1 / model.l**2, model.s / 2
    if isinstance(model, ABg):
        return model.a, model.b, model.g / 2
    return float(model.bsdf(0.0)), 0.0, 0.0


def _compose(packed, parts: tuple[Part, ...], elements, job, options: TraceOptions, device: Device) -> Source:
    """The kernel's source, with the shapes and kinds of elements that there are and no others."""
    kinds, scattering = {part.kind for part in parts}, [p.scatter for p in parts if p.scatter is not None]
    choices = packed.choices | {
        "sampler": options.sampler,
        "keys": "random" if kinds & {"refractor", "scattering"} else "none",
        "spawn": "list" if scattering else "none",
        "scatter": type(scattering[0]).__name__.lower() if scattering else "none",
    }
    structs = packed.structs | {
        "Element": elements.dtype, "Path": PATH, "PathJob": job.dtype,
    }  # fmt: skip
    # made of the program's own words: no text of a scene comes into a source
    calls = " ".join(f"DO({part.shape}, {part.kind}, {number})" for number, part in enumerate(parts))
    deviated = ("element_deviated.cl",) if any(part.shape == "deviated" for part in parts) else ()
    first = (*deviated, *sorted(f"interact_{kind}.cl" for kind in kinds), *["finish_scattering.cl"] * bool(scattering))
    width = device.vector_width(options.precision)
    return compose("trace_paths.cl", choices, structs, options.precision, width, packed.constants,
                   {"ELEMENTS(DO)": calls}, first)  # fmt: skip


def _job(scene: Scene, parts: tuple[Part, ...], real, bounce_limit: int, sources: np.ndarray) -> np.ndarray:
    """The kernels' PathJob [()], but for what changes from launch to launch."""
    origins, _ = groups_of(scene, parts)
    job = np.zeros((), path_job_dtype(real, len(origins)))
    job["aperture"] = np.array(scene.camera.position_mm) - origins
    job["element_count"], job["bounce_limit"] = len(parts), bounce_limit
    job["screen_group"], job["screen_element"] = 1, on_screen(scene, parts)
    job["inverse_unit_area"] = 1 / np.max(sources["aim_ll"] * sources["aim_mm"])
    return job


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
