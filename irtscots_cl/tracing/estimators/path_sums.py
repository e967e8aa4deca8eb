"""What a non-sequential trace fills, known without a device, and what becomes of its sums: light by path."""

from __future__ import annotations

import json
from copy import copy
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np

from irtscots_cl.opencl.structs import PATH
from irtscots_cl.optics.chief_rays import check_visible, chief_rays
from irtscots_cl.optics.elements.components import components_of
from irtscots_cl.optics.elements.media import check_media
from irtscots_cl.optics.elements.path_focus import NO_FOCUS, path_focus
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import parse_scene
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.packing.sources import emitters
from irtscots_cl.tracing.results.paths import KINDS, LostFlux, PathFlux, PathLight, events_of, kind_of, name_of

# As in kernels/tally/tally.cl: then one per element, absorbed. "parted" are no end, but rays beside those launched.
ENDS = ("detected", "escaped", "bounce limit", "failed", "parted")
TRACKED_PATHS = 64  # the most powerful ones and, last, all others
SCALE_BITS = 22  # of a path's largest weight in the pilot; leaves 2^9 for larger ones
MAX_IMAGE_BYTES = 2**31
LOSS_ONE = 2.0**20  # as in kernels/tally/tally.cl


@dataclass(frozen=True)
class TrackedPaths:
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


class PathSums:
    """A non-sequential trace without a device: what its kernel needs of the scene, and what its sums say.

    how: bounce_limit, least_chance, branches, aimed_scatter of trace_paths. parts: the elements. streams: screen
    pixels. sources: the kernel's emitters. unit_w: flux [W] of weight 1 in a run of one ray per screen pixel,
    launched_w: of all rays. sums_shapes: images [kinds, lines, pixels], sums. kept: paths to be told apart. Raises
    ValueError or SceneError for what cannot be traced.
    """

    def __init__(self, scene: Scene, options: TraceOptions, **how: Any):
        chief = chief_rays(scene)
        check_visible(chief, f"scene {scene.name}")
        self.scene, self.options, self.how, self.components, self.tracked = (
            scene,
            options,
            how,
            components_of(scene),
            TrackedPaths((), ()),
        )
        check_media(scene, self.components)
        self.source_structs, area = emitters(chief, options.precision, options.overfill, options.aim)
        self.sources, gain = len(self.source_structs), scene.screen.radiance * scene.screen.pitch_mm**2
        self.unit_w, self.launched_w = gain * float(area.max()), gain * float(area.sum())
        images = (len(KINDS), sum(scene.screen.pixels), int(np.prod(scene.camera.detector.pixels)))
        self.sums_shapes = (images, (len(ENDS) + 2 * len(self.components) + 2 + 2 * TRACKED_PATHS,))
        size = 8 * int(np.prod(images))
        if size > MAX_IMAGE_BYTES:
            raise ValueError(f"scene {scene.name}: images of {images[1]} lines with {images[2]} "
                             f"pixels take {size} bytes; must be at most {MAX_IMAGE_BYTES}")  # fmt: skip

    def tracking(self, tracked: TrackedPaths) -> Self:
        """The same with paths to be told apart."""
        other = copy(self)
        other.tracked = tracked
        return other

    def to_json(self) -> str:
        return json.dumps({"scene": self.scene.to_toml(), "options": asdict(self.options), "how": self.how,
                           "kept": asdict(self.tracked)})  # fmt: skip

    @classmethod
    def from_json(cls, text: str) -> Self:
        data = json.loads(text)
        work = cls(parse_scene(data["scene"]), TraceOptions(**data["options"]), **data["how"])
        return work.tracking(TrackedPaths(*(tuple(data["kept"][key]) for key in ("codes", "weights"))))

    def result(
        self, images: np.ndarray, sums: np.ndarray, rays: np.ndarray, device: dict, seconds: dict[str, float]
    ) -> PathLight:
        """The trace of rays [replicates] per stream from its sums. device: facts of where it ran."""
        ends = self.ends(sums, int(rays.sum()) * self.sources)
        images_w = images * (self.unit_w / self.tracked.of_kind)[None, :, None, None] / rays[:, None, None, None]
        return PathLight(self.scene, self.options, device, self.fluxes(sums, rays), self.losses(sums, rays),
                         self.launched_w, images_w, rays, ends, _ledger(ends), seconds)  # fmt: skip

    def ends(self, sums: np.ndarray, launched: int) -> dict[str, int]:
        """Rays of all replicates by where they ended; they add up to those launched and those that parted from others.

        AssertionError if not: a bug.
        """
        names = (*ENDS, *(f"absorbed by {component.name}" for component in self.components))
        found = dict(zip(names, (int(n) for n in sums.sum(0)[: len(names)]), strict=True))
        parted = found.pop("parted")
        ended = sum(found.values())
        assert ended == launched + parted, f"{launched + parted} rays launched and parted, {ended} accounted for"
        return {"launched": launched, "parted": parted} | found

    def fluxes(self, sums: np.ndarray, rays: np.ndarray) -> tuple[PathFlux, ...]:
        """Flux of every path, by power, and last of all others."""
        paths = sums[:, -2 * TRACKED_PATHS :].reshape(len(rays), TRACKED_PATHS, 2)
        names = tuple(component.name for component in self.components)
        labels = [(name_of(code, names), KINDS[kind_of(code)]) for code in self.tracked.codes] + [("other", "other")]
        sharp = [*(path_focus(self.components, events_of(code)) for code in self.tracked.codes), NO_FOCUS]
        found = []
        for p, (label, entry) in enumerate(zip(labels, self.tracked.table(), strict=True)):
            flux = self._watts(paths[:, p, 1] / float(entry["scale"]), rays)
            found.append(PathFlux(*label, *flux, int(paths[:, p, 0].sum()), *sharp[p]))
        return (*sorted(found[:-1], key=lambda path: -path.flux_w), found[-1])

    def losses(self, sums: np.ndarray, rays: np.ndarray) -> tuple[LostFlux, ...]:
        """Light that does not reach the detector, by where it stays: absorbed by elements, escaped, given up."""
        names = (*(f"absorbed by {component.name}" for component in self.components), "escaped", "bounce limit")
        first = len(ENDS) + len(self.components)
        weights = sums[:, first : first + len(names)] / LOSS_ONE
        return tuple(LostFlux(name, *self._watts(each, rays)) for name, each in zip(names, weights.T, strict=True))

    def _watts(self, weights: np.ndarray, rays: np.ndarray) -> tuple[float, float]:
        """Flux of weights [replicates] in W and its standard error."""
        each = weights * self.unit_w / rays
        error = float(np.std(each, ddof=1) / np.sqrt(len(rays))) if len(rays) > 1 else float("nan")
        return float(np.average(each, weights=rays)), error


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
