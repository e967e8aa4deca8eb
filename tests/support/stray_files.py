"""Files of stray light whose maps are made up."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from irtscots_cl.imaging.stray_files import StrayMaps, write_stray_maps
from irtscots_cl.scene.model import Scene

REPLICATES = 4


def made_maps(scene: Scene, seed: int = 1, noise: float = 0.1) -> StrayMaps:
    """Maps of light that is a thousandth of the direct light and comes from the screen's middle, as it were: places
    move towards it, some um over the mirror. noise: of single replicates, relative."""
    columns, rows = scene.camera.detector.pixels
    y, x = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    random = np.random.default_rng(seed)
    change = -1e-3 * np.stack([x + 0.3 * x * y, y - x**2])
    left_out = change * (1 + noise / REPLICATES * random.standard_normal((REPLICATES, *change.shape)))
    share = 1e-3 * (1 + 0.5 * x)
    return StrayMaps(np.concatenate([change[None], left_out]), share, 0.01 * share, 20 * x, 0.1 + 0 * x)


def write_made(path: Path, scene: Scene, **kinds: StrayMaps) -> None:
    write_stray_maps(path, kinds, scene, {"seed": 1})
