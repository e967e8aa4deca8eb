"""The non-sequential estimator: light goes from element to element in any order, and is kept by its path."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import asdict, dataclass

import numpy as np

from irtscots_cl.aiming import emitters
from irtscots_cl.calibration import calibrate, check_visible
from irtscots_cl.checkpoint import Keeper, KeptTrace, hash_of, trace_facts
from irtscots_cl.cluster import site_of
from irtscots_cl.device import Device
from irtscots_cl.execution import Workspace
from irtscots_cl.interface import PATH, PRECISIONS, element_dtype, path_job_dtype
from irtscots_cl.launches import Pace, launch_structure, plan_launches, share_rays
from irtscots_cl.options import NONSEQUENTIAL, TraceOptions
from irtscots_cl.packing import pack
from irtscots_cl.parts import Part, check_media, groups_of, on_screen, parts_of
from irtscots_cl.paths import KINDS, MAX_EVENTS, PathFlux, PathLight, kind_of, name_of
from irtscots_cl.presets import parse_scene
from irtscots_cl.program import Source, check_precision, compose
from irtscots_cl.runner import run_rays
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
    device: Device | Sequence[Device] | None = None,
    client=None,
    sampler: str = "philox",
    precision: str = "fp32",
    rays_per_pixel: int = 2**16,
    replicates: int = 8,
    seed: int = 1,
    overfill: float = 1.0,
    bounce_limit: int = MAX_EVENTS,
    least_chance: float = LEAST_CHANCE,
    progress: Callable[[int, int], None] | None = None,
    keeper: Keeper | None = None,
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
    started = time.perf_counter()
    work, site = PathWork(scene, options, bounce_limit, least_chance), site_of(device, client)
    kept = Kept(*map(tuple, site.call(find_paths, work.wire())))
    if not kept.codes:
        raise SceneError(
            f"scene {scene.name}: detector: no path from the screen reaches it; must be reached by one of "
            f"{max(PILOT_RAYS // work.streams, 16) * work.streams} rays that look for paths"
        )
    found = time.perf_counter() - started
    file = None
    if keeper is not None:
        more = {"bounce_limit": bounce_limit, "least_chance": least_chance}
        file = keeper.file_of(trace_facts(scene, options, rays, site.about(), **more))
    ran = site.run(work.keeping(kept), rays, progress, kept=file)
    images, sums = ran.sums
    seconds = ran.seconds | {"build": ran.seconds["build"] + found}
    seconds |= {name: seconds[name] + before for name, before in (file.seconds if file is not None else {}).items()}
    ends = ends_of(sums, work.parts, int(rays.sum()) * work.streams)
    images_w = images * (work.unit_w / kept.of_kind)[None, :, None, None] / rays[:, None, None, None]
    return PathLight(scene, options, ran.device, fluxes(sums, work, kept, rays), images_w, rays, ends, _ledger(ends),
                     seconds)  # fmt: skip


def find_paths(device: Device, wire: str) -> tuple[list[int], list[float]]:
    """PathTracer.find of PathWork.wire on a device, in plain lists."""
    kept = PathWork.from_wire(wire).build(device).find()
    return list(kept.codes), list(kept.weights)


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


class PathWork:
    """The rays of a non-sequential trace and what they fill, known without a device: a crew.Work.

    parts: the elements. unit_w: flux [W] of weight 1 in a run of one ray per screen pixel. kept: paths to be told
    apart. Raises ValueError or SceneError for what cannot be traced.
    """

    def __init__(self, scene: Scene, options: TraceOptions, bounce_limit: int, least_chance: float):
        calibration = calibrate(scene)
        check_visible(calibration, f"scene {scene.name}")
        self.scene, self.options, self.bounce_limit, self.least_chance = scene, options, bounce_limit, least_chance
        self.parts, self.kept = parts_of(scene), Kept((), ())
        check_media(scene, self.parts)
        self.max_rays_per_item, self.first_launch_rays = MAX_RAYS_PER_ITEM, FIRST_LAUNCH_RAYS
        self.sources, area = emitters(calibration, options.precision, options.overfill, options.aim)
        self.streams = len(self.sources)
        self.unit_w = scene.screen.radiance * scene.screen.pitch_mm**2 * float(area.max())
        images = (len(KINDS), sum(scene.screen.pixels), int(np.prod(scene.camera.detector.pixels)))
        self.sums_shapes = (images, (len(ENDS) + len(self.parts) + 2 * KEPT_PATHS,))
        size = 8 * int(np.prod(images))
        if size > MAX_IMAGE_BYTES:
            raise ValueError(f"scene {scene.name}: images of {images[1]} lines with {images[2]} "
                             f"pixels take {size} bytes; must be at most {MAX_IMAGE_BYTES}")  # fmt: skip

    def keeping(self, kept: Kept) -> PathWork:
        other = copy(self)
        other.kept = kept
        return other

    def build(self, device: Device) -> PathTracer:
        tracer = PathTracer(self.scene, device, self.options, self.bounce_limit, self.least_chance, self)
        tracer.keep(self.kept)
        return tracer

    def wire(self) -> str:
        return json.dumps({"scene": self.scene.to_toml(), "options": asdict(self.options), "kept": asdict(self.kept),
                           "bounce_limit": self.bounce_limit, "least_chance": self.least_chance})  # fmt: skip

    @classmethod
    def from_wire(cls, text: str) -> PathWork:
        data = json.loads(text)
        work = cls(parse_scene(data["scene"]), TraceOptions(**data["options"]), data["bounce_limit"],
                   data["least_chance"])  # fmt: skip
        return work.keeping(Kept(*(tuple(data["kept"][key]) for key in ("codes", "weights"))))


class PathTracer:
    """The kernel and buffers of one scene on one device.

    source: what was built. streams: screen pixels. work: of the same, where there is one. kernel_seconds: of `run` so
    far. A runner.Job. Raises DeviceError if the device cannot build or hold it.
    """

    def __init__(
        self,
        scene: Scene,
        device: Device,
        options: TraceOptions,
        bounce_limit: int = MAX_EVENTS,
        least_chance: float = LEAST_CHANCE,
        work: PathWork | None = None,
    ):
        check_precision(device, options.precision)
        made = work or PathWork(scene, options, bounce_limit, least_chance)
        self.scene, self.options, self.parts, self.pace = scene, options, made.parts, Pace()
        self.max_rays_per_item, self.first_launch_rays = made.max_rays_per_item, made.first_launch_rays
        real, packed = PRECISIONS[options.precision], pack(calibrate(scene), options.precision)
        elements = pack_elements(scene, self.parts, real, least_chance)
        self.streams, self._job = made.streams, _job(scene, self.parts, real, bounce_limit, made.sources)
        self.source = _compose(packed, self.parts, elements, self._job, options, device)
        self._image_shape, self._sums_shape = made.sums_shapes
        self._facts = {
            "code": hash_of(self.source.text.encode(), *(option.encode() for option in self.source.options)),
            "inputs": hash_of(packed.scene, made.sources, elements, self._job),
        }
        self._workspace = work = Workspace(device, self.source, "trace_paths")
        self._before = [work.upload(array) for array in (packed.scene, made.sources, elements)]
        self._sums, self._images = work.empty(8 * self._sums_shape[0]), work.empty(8 * int(np.prod(self._image_shape)))
        self._found = work.empty(4 * (1 + 3 * FOUND_SIZE))

    def find(self) -> Kept:
        """The paths that reach the detector in a pilot run."""
        found = np.zeros(1 + 3 * FOUND_SIZE, np.uint32)
        self._workspace.clear(self._found)
        self.clear()
        self.keep(Kept((), ()), FOUND_SIZE)
        rays = max(PILOT_RAYS // self.streams, 16)
        for part in plan_launches(self.streams, rays, lambda: self.first_launch_rays, self.max_rays_per_item):
            self.launch(PILOT, part)
        self._workspace.download(self._found, found)
        low, high, bits = found[1:].reshape(-1, 3)[: min(int(found[0]), FOUND_SIZE)].T
        weights = bits.copy().view(np.float32).astype(float)
        order = np.lexsort((bits, low, high))  # rays are found in any order; sums in floating point depend on it
        low, high, weights = low[order], high[order], weights[order]
        codes, index = np.unique(high.astype(np.uint64) << np.uint64(32) | low.astype(np.uint64), return_inverse=True)
        largest, power = np.zeros(len(codes)), np.bincount(index, weights, len(codes))
        np.maximum.at(largest, index, weights)
        best = [k for k in np.argsort(-power, kind="stable")[: KEPT_PATHS - 1] if largest[k] > 0]
        return Kept(tuple(int(codes[k]) for k in best), tuple(float(largest[k]) for k in best))

    def run(
        self, rays: np.ndarray, kept: Kept, progress=None, file: KeptTrace | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Images [replicates, kinds, lines, pixels] and sums [replicates, ends + elements + 2 paths]: whole numbers."""
        self.keep(kept)
        return run_rays(self, rays, progress, kept=file)

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
        self.keep(Kept((), ()))
        self.clear()
        self.pace.kernel_seconds = 0.0
        self.launch(0, (0, self.streams, 0, of_stream))
        return of_stream * self.streams / self.kernel_seconds

    @property
    def kernel_seconds(self) -> float:
        return self.pace.kernel_seconds

    def keep(self, kept: Kept, found_size: int = 0) -> None:
        """What the next launches tell apart; with found_size above 0 they list what is detected instead."""
        table = kept.table()
        self._paths = self._workspace.upload(table)
        self.facts = self._facts | {"paths": hash_of(table)}
        self._job["path_count"], self._job["found_size"] = len(table), found_size

    def launch(self, replicate: int, part: tuple[int, int, int, int]) -> None:
        _, streams, _, rays = part
        per_item = max(1, min(rays, self.max_rays_per_item))
        launch = launch_structure(self.scene, self.options, replicate, part, per_item)
        scene, sources, elements = self._before
        arguments = [scene, launch, sources, elements, self._paths, self._sums, self._images, self._found, self._job]
        seconds = self._workspace.launch((streams, max(1, -(-rays // per_item))), arguments)
        self.pace.launched(streams * rays, seconds)


def ends_of(sums: np.ndarray, parts: tuple[Part, ...], launched: int) -> dict[str, int]:
    """Rays of all replicates by where they ended; they add up to those launched and those that parted from others.

    sums: as of PathTracer.run. AssertionError if they do not add up: a bug.
    """
    names = (*ENDS, *(f"absorbed by {part.name}" for part in parts))
    found = dict(zip(names, (int(n) for n in sums.sum(0)[: len(names)]), strict=True))
    parted = found.pop("parted")
    ended = sum(found.values())
    assert ended == launched + parted, f"{launched + parted} rays launched and parted, {ended} accounted for"
    return {"launched": launched, "parted": parted} | found


def fluxes(sums: np.ndarray, work: PathWork, kept: Kept, rays: np.ndarray) -> tuple[PathFlux, ...]:
    """Flux of every path, by power, and last of all others. sums: as of PathTracer.run."""
    paths = sums[:, len(ENDS) + len(work.parts) :].reshape(len(rays), KEPT_PATHS, 2)
    names = tuple(part.name for part in work.parts)
    labels = [(name_of(code, names), KINDS[kind_of(code)]) for code in kept.codes] + [("other", "other")]
    found = []
    for p, (label, entry) in enumerate(zip(labels, kept.table(), strict=True)):
        each = paths[:, p, 1] / float(entry["scale"]) * work.unit_w / rays
        error = float(np.std(each, ddof=1) / np.sqrt(len(rays))) if len(rays) > 1 else float("nan")
        found.append(PathFlux(*label, float(np.average(each, weights=rays)), error, int(paths[:, p, 0].sum())))
    return (*sorted(found[:-1], key=lambda path: -path.flux_w), found[-1])


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
