"""Results of a trace: the light-transport map, or light curves alone.

The map (Transport) holds for each detector pixel the flux that each screen pixel in its window sends there, and serves
every pattern. Estimators that integrate light along lines give light curves only (LineLight).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import overload

import numpy as np

from irtscots_cl.imaging.fringes import FringeScan, FringeStack
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.imaging.pictures import Pictures
from irtscots_cl.opencl.structs import WEIGHT_ONE, Fate
from irtscots_cl.optics.screen_windows import Windows
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.shown import html_table, one_line
from irtscots_cl.tracing.options import ANALYTIC, TraceOptions
from irtscots_cl.tracing.samplers import INDEPENDENT


class TraceResult:
    """The common part of the results of all estimators."""

    __repr__ = one_line
    _repr_html_ = html_table

    def summary(self) -> dict[str, str]:
        """Scene, estimator, rays and time."""
        said = {"scene": self.scene.name, "estimator": self.options.estimator}
        if self.options.estimator != ANALYTIC:
            share = self.ledger["detected"] / max(self.rays_total, 1)
            said |= {"rays": f"{self.rays_total:,}, {share:.1%} detected", "replicates": str(self.replicates),
                     "sampler": self.options.sampler, "seed": str(self.options.seed),
                     "device": str(self.device["name"])}  # fmt: skip
        return said | {"time": f"{self.seconds['trace']:.3g} s"}

    @property
    def rays_total(self) -> int:
        return self.ledger["launched"]

    @property
    def replicates(self) -> int:
        return len(self.rays)

    @overload
    def images(self, pattern: LineScan) -> ImageStack: ...
    @overload
    def images(self, pattern: FringeScan) -> FringeStack: ...
    @overload
    def images(self, pattern: Pictures) -> np.ndarray: ...

    def images(self, pattern: LineScan | FringeScan | Pictures) -> ImageStack | FringeStack | np.ndarray:
        """The images of a pattern, without new rays: of both scans, or of fringes or pictures the mean over all rays.

        Of pictures [pictures, rows, columns] in W. ValueError for a pattern of another screen, and for pictures that
        need a map of transport where there is none.
        """
        if pattern.scene.screen.pixels != self.scene.screen.pixels:
            raise ValueError(
                f"the pattern's screen has {pattern.scene.screen.pixels} pixels, "
                f"the transport's {self.scene.screen.pixels}"
            )
        if isinstance(pattern, FringeScan):
            return self.fringe_images(pattern)
        if isinstance(pattern, Pictures):
            columns, rows = self.scene.camera.detector.pixels
            images = np.zeros((len(pattern.values), rows * columns))
            images[:, self.windows.pixels] = self.picture_flux_w(pattern.radiance)
            return images.reshape(-1, rows, columns)
        return ImageStack(*(self._scan(pattern, axis) for axis in ("x", "y")))

    def fringe_images(self, pattern: FringeScan, replicate: int | None = None) -> FringeStack:
        """Flux [W] of every frame of the fringes, of one replicate or the mean over all rays; dark where no light is.

        A frame is the sum of the light curves under single lines, each times what the pattern shows there.
        """
        columns, rows = self.scene.camera.detector.pixels
        frames = np.zeros((sum(one.count for one in pattern.sets), rows * columns))
        white = np.zeros(rows * columns)
        first = 0
        for fringes in pattern.sets:
            axis = fringes.axis
            curves = self.mean_curves_w(axis) if replicate is None else self.line_flux_w(axis)[replicate]
            origins = self.windows.origins[:, "xy".index(fringes.axis)].astype(np.int64)
            lines = origins[:, None] + np.arange(curves.shape[1])
            for frame in pattern.radiance(fringes):
                frames[first, self.windows.pixels] = (curves * frame[lines]).sum(1)
                first += 1
            white[self.windows.pixels] = curves.sum(1)
        shape = (rows, columns)
        return FringeStack(pattern.sets, frames.reshape(-1, *shape), np.zeros(shape), white.reshape(shape), unit="W")

    def mean_curves_w(self, axis: str) -> np.ndarray:
        """Light curves [n, window] in W under single columns ("x") or rows ("y"), the mean over all rays."""
        curves: np.ndarray = np.tensordot(self.rays / self.rays.sum(), self.line_flux_w(axis), 1)
        return curves

    def picture_flux_w(self, radiance: np.ndarray) -> np.ndarray:
        """Flux [pictures, n] in W for relative radiances [pictures, rows, columns] of the screen's pixels."""
        raise NotImplementedError

    def _scan(self, pattern: LineScan, axis: str) -> Scan:
        columns, rows = self.scene.camera.detector.pixels
        single_w = self.line_flux_w(axis, None if pattern.brightness is None else np.asarray(pattern.brightness))
        flux_w, first = pattern.joined(axis, single_w, self.windows.origins[:, "xy".index(axis)])
        return Scan(
            axis,
            pattern.positions_mm(axis),
            (rows, columns),
            self.windows.pixels,
            first,
            flux_w,
            self.rays.astype(float),
            self.hits() * min(1.0, pattern.line_width),  # rays that land between the lines are none
            line_width=pattern.line_width,
        )


@dataclass(frozen=True, repr=False)
class Transport(TraceResult):
    """Result of a trace. n: detector pixels that can see the mirror; windows are [rows, columns] of screen pixels.

    options: of the trace. device: Device.describe() of the device that traced.
    counts: [replicates, n, window rows, window columns] uint64, ray counts (forward) or summed weights (adjoint).
    unit_w: flux [W] of one count in a run of one ray per source; broadcasts to [n, window rows, window columns].
    rays: [replicates] rays per source (screen pixel or detector pixel) of each replicate.
    ledger: rays by fate; all but "launched" add up to it. seconds: build, trace, and the part of it in kernels.
    """

    scene: Scene
    options: TraceOptions
    device: dict[str, object]
    windows: Windows
    counts: np.ndarray = field(repr=False)
    unit_w: np.ndarray = field(repr=False)
    rays: np.ndarray
    ledger: dict[str, int]
    seconds: dict[str, float]

    def flux_w(self, replicate: int | None = None) -> np.ndarray:
        """Flux [n, window rows, window columns] in W of one replicate, or the mean over all rays."""
        if replicate is None:
            return self.counts.sum(0) * (self.unit_w / self.rays.sum())
        return self.counts[replicate] * (self.unit_w / self.rays[replicate])

    def hits(self) -> np.ndarray:
        """Independent rays [n] that reached each detector pixel, of all replicates; NaN for other samplers."""
        if self.options.sampler not in INDEPENDENT:
            return np.full(len(self.windows.pixels), np.nan)
        one = WEIGHT_ONE if self.options.estimator == "adjoint" else 1
        return self.counts.sum((0, 2, 3)) / one

    def line_flux_w(self, axis: str, brightness: np.ndarray | None = None) -> np.ndarray:
        """Light curves [replicates, n, window] in W under single columns ("x") or rows ("y") of screen pixels.

        brightness: [rows, columns] of the screen, factor on its radiance; None: all 1.
        """
        summed = {"x": 1, "y": 2}[axis]  # a line along y adds up the window's rows, one along x its columns
        if brightness is None and self.unit_w.shape[1:] == (1, 1):
            # one factor for a whole window: whole numbers are added up first, which is faster
            return self.counts.sum(1 + summed) * (self.unit_w[:, 0] / self.rays[:, None, None])
        factor = 1.0 if brightness is None else self.windows.gather(brightness)
        return np.stack([(self.flux_w(r) * factor).sum(summed) for r in range(self.replicates)])

    def picture_flux_w(self, radiance: np.ndarray) -> np.ndarray:
        flux_w = self.flux_w()
        return np.stack([np.einsum("nij,nij->n", flux_w, self.windows.gather(one)) for one in radiance])

    def standard_error_w(self) -> np.ndarray:
        """Standard error of flux_w() per bin, from the scatter of the replicates; NaN with fewer than two."""
        if self.replicates < 2:
            return np.full(self.counts.shape[1:], np.nan)
        mean, variance = self.flux_w(), np.zeros(self.counts.shape[1:])
        for r in range(self.replicates):
            variance += (self.flux_w(r) - mean) ** 2
        return np.sqrt(variance / (self.replicates * (self.replicates - 1)))


@dataclass(frozen=True, repr=False)
class LineLight(TraceResult):
    """Light curves of a trace that has no map of transport: of the analytic and of the smoothed estimators.

    flux_w: {"x", "y"}: [replicates, n, window columns or rows]. The rest as in Transport.
    """

    scene: Scene
    options: TraceOptions
    device: dict[str, object]
    windows: Windows
    flux_w: dict[str, np.ndarray] = field(repr=False)
    rays: np.ndarray
    ledger: dict[str, int]
    seconds: dict[str, float]

    def hits(self) -> np.ndarray:
        """As many independent rays as would have the same noise, [n]: infinite without noise; NaN of smoothed rays."""
        return np.full(len(self.windows.pixels), np.inf if self.options.estimator == ANALYTIC else np.nan)

    def line_flux_w(self, axis: str, brightness: np.ndarray | None = None) -> np.ndarray:
        """Light curves [replicates, n, window] in W; ValueError for a brightness, which needs the map of transport."""
        if brightness is not None:
            raise ValueError(
                "brightness: the analytic and the smoothed estimator know a screen of equal brightness only; "
                "must be None, or trace by adjoint or forward"
            )
        return self.flux_w[axis]

    def picture_flux_w(self, radiance: np.ndarray) -> np.ndarray:
        """Of pictures that are the same along columns or along rows; ValueError for others."""
        return np.stack([self._striped_flux_w(k, one) for k, one in enumerate(radiance)])

    def _striped_flux_w(self, number: int, radiance: np.ndarray) -> np.ndarray:
        for axis, line, whole in (("x", radiance[0], radiance), ("y", radiance[:, 0], radiance.T)):
            if (whole == line).all():
                curves = self.mean_curves_w(axis)
                first = self.windows.origins[:, "xy".index(axis), None].astype(np.int64)
                flux: np.ndarray = (curves * line[first + np.arange(curves.shape[1])]).sum(1)
                return flux
        raise ValueError(
            f"picture {number}: not the same along columns or rows: the analytic and the smoothed estimator know "
            "lines only; must be traced by adjoint or forward"
        )


def line_flux(counts: np.ndarray, windows: Windows, unit_w: np.ndarray, rays: np.ndarray) -> dict[str, np.ndarray]:
    """LineLight.flux_w from the sums of kernels/entry/trace_lines.cl.

    counts: [replicates, n, columns + 2 + rows + 2] uint64, second differences in two's complement of the light below
    the lines' edges. unit_w: [n, 1] flux of one unit in a run of one ray. rays: [replicates] per pixel.
    """
    split = windows.columns + 2
    parts = {"x": counts[..., : split - 2], "y": counts[..., split : split + windows.rows]}
    flux = {axis: np.empty(part.shape) for axis, part in parts.items()}
    for axis, part in parts.items():
        for replicate, count in enumerate(rays):
            below = np.cumsum(part[replicate].view(np.int64), axis=-1)
            np.multiply(below, unit_w / count, out=flux[axis][replicate])
    return flux


def ledger_from(counts: np.ndarray, launched: int) -> dict[str, int]:
    """The energy ledger from counts [Fate] of all launches. Raises AssertionError if rays got lost: a bug."""
    ledger = {"launched": launched} | {fate.name.lower(): int(counts[fate]) for fate in Fate if fate != Fate.OFF_WINDOW}
    total = sum(ledger.values()) - launched + int(counts[Fate.OFF_WINDOW])
    assert total == launched, f"the ledger does not close: {launched} rays launched, {total} accounted for"
    return ledger
