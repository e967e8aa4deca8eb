"""What the screen shows. Light adds up, so every pattern is a product with the transport map: no new rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.images import ImageStack, Scan
from irtscots_cl.scene import Scene
from irtscots_cl.transport import LineLight, Transport


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

    def images(self, transport: Transport | LineLight) -> ImageStack:
        """The image stack of both scans. Raises ValueError for a transport of another screen."""
        if transport.scene.screen.pixels != self.scene.screen.pixels:
            raise ValueError(
                f"the pattern's screen has {self.scene.screen.pixels} pixels, "
                f"the transport's {transport.scene.screen.pixels}"
            )
        return ImageStack(*(self._scan(axis, transport) for axis in ("x", "y")))

    def _scan(self, axis: str, transport: Transport | LineLight) -> Scan:
        columns, rows = self.scene.camera.detector.pixels
        windows = transport.windows
        brightness = None if self.brightness is None else np.asarray(self.brightness)
        flux = transport.line_flux_w(axis, brightness)
        first_line = windows.origins[:, "xy".index(axis)].astype(np.int64)
        weights = transport.rays.astype(float)
        return Scan(
            axis, self.positions_mm(axis), (rows, columns), windows.pixels, first_line, flux, weights, transport.hits()
        )
