"""Light by the path that it took: codes and names of paths, and the result of a non-sequential trace."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from irtscots_cl.opencl.structs import EVENT_BITS, SHORT_EVENTS
from irtscots_cl.optics.screen_windows import Windows
from irtscots_cl.scene.model import Scene
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.results.transport import TraceResult

KINDS = ("direct", "ghost", "scatter")  # of paths; the last that any of its events is: kernels/elements/ray.cl
PATH_BITS = EVENT_BITS
MARKS = ("", " (r)", " (s)")  # of events in names: reflected at a refractor, scattered


@dataclass(frozen=True)
class PathFlux:
    """Light that takes one path to the detector. kind: one of KINDS, or "other" for all paths that are not kept apart.

    standard_error_w: from the replicates, NaN with one. rays: that came this way. focus_mm, blur_mm: how sharp it is on
    the detector, as sequence.path_focus says; NaN where that is unknown.
    """

    name: str
    kind: str
    flux_w: float
    standard_error_w: float
    rays: int
    focus_mm: float = float("nan")
    blur_mm: float = float("nan")


NOT_TRACED = "beside the mirror, not traced"  # a LostFlux's name


@dataclass(frozen=True)
class LostFlux:
    """Light that ends elsewhere than on the detector. standard_error_w: as of PathFlux."""

    name: str
    flux_w: float
    standard_error_w: float


@dataclass(frozen=True, repr=False)
class PathLight(TraceResult):
    """Result of a non-sequential trace.

    paths: by flux, the largest first; the last, "other", holds those that the pilot run had not found. losses: light
    that does not reach the detector, absorbed at elements, escaped or given up, in steps of 2^-20 of a ray; and first,
    if rays go into the mirror's cone alone, what leaves beside it. launched_w: flux that leaves the screen in all, pi
    times its radiance and area; paths and losses add up to it in the mean. images_w: [replicates, KINDS, screen columns
    + rows, detector pixels] under single lines [W]. ends: rays by where they ended. ledger: the same in the words of
    all estimators. bounce_limit: events after which rays were given up. The rest as in transport.Transport.
    """

    scene: Scene
    options: TraceOptions
    device: dict[str, object]
    paths: tuple[PathFlux, ...]
    losses: tuple[LostFlux, ...]
    launched_w: float
    images_w: np.ndarray = field(repr=False)
    rays: np.ndarray
    ends: dict[str, int]
    ledger: dict[str, int]
    seconds: dict[str, float]
    bounce_limit: int = SHORT_EVENTS

    @property
    def windows(self) -> Windows:
        """Every detector pixel with the whole screen."""
        columns, rows = self.scene.screen.pixels
        pixels = np.arange(self.images_w.shape[-1])
        return Windows(pixels, np.zeros((len(pixels), 2), np.int32), rows, columns)

    def hits(self) -> np.ndarray:
        """Unknown: rays weigh differently."""
        return np.full(self.images_w.shape[-1], np.nan)

    def only(self, *kinds: str) -> PathLight:
        """The same with the light of paths of these kinds alone."""
        kept = np.isin(KINDS, kinds)[None, :, None, None]
        paths = tuple(path for path in self.paths if path.kind in kinds)
        return replace(self, paths=paths, images_w=np.where(kept, self.images_w, 0.0))

    def line_flux_w(self, axis: str, brightness: np.ndarray | None = None) -> np.ndarray:
        """Light curves [replicates, n, lines] in W of all paths; ValueError for a brightness."""
        if brightness is not None:
            raise ValueError("brightness: the non-sequential estimator knows a screen of equal brightness only")
        columns = self.scene.screen.pixels[0]
        lines = slice(None, columns) if axis == "x" else slice(columns, None)
        return self.images_w[:, :, lines].sum(1).transpose(0, 2, 1)


def events_of(code: int) -> list[tuple[int, int]]:
    """(element number, event) of a path's code, in order; event: index of KINDS."""
    digits = []
    while code:
        digits.append(divmod((code & (2**PATH_BITS - 1)) - 1, len(KINDS)))
        code >>= PATH_BITS
    return digits[::-1]


def kind_of(code: int) -> int:
    """Index of KINDS of a path: the highest of its events.

    A ghost is light that an interface reflected instead of passing it on. How often a path meets an element does not
    matter: the light of a window before the mirror crosses it twice, and is direct.
    """
    return max((event for _, event in events_of(code)), default=0)


def name_of(code: int, elements: tuple[str, ...]) -> str:
    """A path in words, such as "screen > mirror > front (r) > detector"."""
    return " > ".join(["screen", *(elements[number] + MARKS[event] for number, event in events_of(code))])
