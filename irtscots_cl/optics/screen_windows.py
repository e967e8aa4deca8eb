"""The transport map's windows: the screen pixels stored for each detector pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.optics.chief_rays import ChiefRays


@dataclass(frozen=True)
class Windows:
    """pixels: [n] flat numbers of the detector pixels that can see the mirror; origins: [n, 2] first (column, row) of
    each one's window on the screen; rows, columns: the size of all windows."""

    pixels: np.ndarray
    origins: np.ndarray
    rows: int
    columns: int

    @property
    def count(self) -> int:
        """Bins in all windows together."""
        return len(self.pixels) * self.rows * self.columns

    def gather(self, of_screen: np.ndarray) -> np.ndarray:
        """Values [rows, columns] of the screen's pixels in the windows [n, window rows, window columns]."""
        column = self.origins[:, 0, None, None] + np.arange(self.columns)
        row = self.origins[:, 1, None, None] + np.arange(self.rows)[:, None]
        return of_screen[row, column]


def place_windows(chief: ChiefRays, margin: int) -> Windows:
    """Windows of equal size around the chief rays' landing ranges, widened by margin pixels, inside the screen."""
    pixels = np.flatnonzero(chief.sees_mirror)
    lowest, highest = (edge.reshape(-1, 2)[pixels] for edge in chief.landing_range())
    size = np.array(chief.scene.screen.pixels)
    first = np.floor(np.clip(np.nan_to_num(lowest + 0.5, nan=0.0), -1e6, 1e6)).astype(int) - margin
    last = np.floor(np.clip(np.nan_to_num(highest + 0.5, nan=0.0), -1e6, 1e6)).astype(int) + margin
    on_screen = np.all((last >= 0) & (first < size), axis=-1)
    extent = np.clip(last, 0, size - 1) - np.clip(first, 0, size - 1) + 1
    columns, rows = extent[on_screen].max(0)
    origins = np.clip(first, 0, size - [columns, rows]).astype(np.int32)
    for array in (pixels, origins):
        array.setflags(write=False)  # the result is shared between calls
    return Windows(pixels, origins, int(rows), int(columns))
