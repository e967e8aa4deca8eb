"""What the screen shows. Light adds up, so every pattern is a product with the transport map: no new rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.images import ImageStack, Scan
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
        flux = np.stack([transport.flux_w(r) for r in range(transport.replicates)])
        if self.brightness is not None:
            flux *= transport.windows.gather(np.asarray(self.brightness))
        # a scan along x adds up the window's rows, one along y its columns
        return ImageStack(*(self._scan(axis, flux.sum(summed), transport) for axis, summed in (("x", 2), ("y", 3))))

    def _scan(self, axis: str, flux_w: np.ndarray, transport: Transport) -> Scan:
        columns, rows = self.scene.camera.detector.pixels
        return Scan(
            axis,
            self.positions_mm(axis),
            (rows, columns),
            transport.windows.pixels,
            transport.windows.origins[:, "xy".index(axis)].astype(np.int64),
            flux_w,
            transport.rays.astype(float),
            transport.hits(),
        )
