"""What the screen shows. Light adds up, so every pattern is a product with the transport map: no new rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.images import ImageStack, Scan
from irtscots_cl.samplers import INDEPENDENT
from irtscots_cl.scene import Scene
from irtscots_cl.transport import Transport


@dataclass(frozen=True)
class LineScan:
    """Single lines of screen pixels: columns one after the other (x scan), then rows (y scan).

    brightness: [rows, columns] of the screen, factor on the radiance of every screen pixel; None: all 1.
    """

    scene: Scene
    brightness: np.ndarray | None = None

    def __post_init__(self) -> None:
        columns, rows = self.scene.screen.pixels
        if self.brightness is None:
            return
        if np.shape(self.brightness) != (rows, columns):
            raise ValueError(f"brightness has shape {np.shape(self.brightness)}, must be {(rows, columns)}: the screen")
        if not (np.isfinite(self.brightness).all() and np.min(self.brightness) >= 0):
            raise ValueError("brightness must be finite and not negative")

    def positions_mm(self, axis: str) -> np.ndarray:
        """Centres [lines] of the lines of the "x" or "y" scan in the screen's own x or y."""
        k = "xy".index(axis)
        screen = self.scene.screen
        count = screen.pixels[k]
        return (np.arange(count) - (count - 1) / 2) * screen.pitch_mm + screen.centre_offset_mm[k]

    def images(self, transport: Transport) -> ImageStack:
        """The image stack of both scans. Raises ValueError for a transport of another screen."""
        if transport.scene.screen.pixels != self.scene.screen.pixels:
            raise ValueError(
                f"the pattern's screen has {self.scene.screen.pixels} pixels, "
                f"the transport's {transport.scene.screen.pixels}"
            )
        # a scan along x adds up the window's rows, one along y its columns
        return ImageStack(*(self._scan(axis, transport, summed) for axis, summed in (("x", 1), ("y", 2))))

    def _scan(self, axis: str, transport: Transport, summed: int) -> Scan:
        columns, rows = self.scene.camera.detector.pixels
        windows, replicates = transport.windows, transport.replicates
        if self.brightness is None and transport.unit_w.shape[1:] == (1, 1):
            # one factor for a whole window: whole numbers are added up first, which is faster
            sums = transport.counts.sum(1 + summed) * (transport.unit_w[:, 0] / transport.rays[:, None, None])
        else:
            brightness = 1.0 if self.brightness is None else windows.gather(np.asarray(self.brightness))
            sums = np.stack([(transport.flux_w(r) * brightness).sum(summed) for r in range(replicates)])
        first_line = windows.origins[:, "xy".index(axis)].astype(np.int64)
        weights, hits = transport.rays.astype(float), transport.hits()
        if transport.options.sampler not in INDEPENDENT:
            hits = np.full(len(hits), np.nan)
        return Scan(axis, self.positions_mm(axis), (rows, columns), windows.pixels, first_line, sums, weights, hits)
