"""Height maps that tests put on mirrors, and scenes with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene

SOFT_MM = 25.0  # of the letter's edges: no steeper than a detector pixel sees well


def with_maps(scene: Scene, *tables: MirrorMap) -> Scene:
    return replace(scene, mirror=replace(scene.mirror, map=tables))


def letter(nodes: int = 71, pitch_mm: float = 16.0, height_mm: float = 1e-4) -> HeightMap:
    """A soft F, 620 mm high: no turn or mirror image of it is the same."""
    x = (np.arange(nodes) - (nodes - 1) / 2) * pitch_mm

    def bar(low: float, high: float) -> np.ndarray:
        return 1 / (1 + np.exp((np.abs(x - (low + high) / 2) - (high - low) / 2) / SOFT_MM))

    parts = (((-220, -100), (-300, 320)), ((-100, 240), (200, 320)), ((-100, 140), (-60, 60)))
    drawn = sum(np.multiply.outer(bar(*of_y), bar(*of_x)) for of_x, of_y in parts)
    return HeightMap(height_mm * drawn, pitch_mm=(pitch_mm, pitch_mm))


def polishing_marks(
    diameter_mm: float, cut_mm: float, rms_nm: float = 1.0, seed: int = 7, nodes: int = 256
) -> HeightMap:
    """Random heights around a mirror, whose power falls as 1/f^2 down to periods of cut_mm, where it ends."""
    pitch = diameter_mm / (nodes - 8)
    frequency = np.hypot(np.fft.fftfreq(nodes, pitch)[:, None], np.fft.rfftfreq(nodes, pitch))
    with np.errstate(divide="ignore"):
        amplitude = np.where((frequency > 0) & (frequency <= 1 / cut_mm), 1 / frequency, 0.0)
    random = np.random.default_rng(seed).normal(size=(2, *frequency.shape))
    heights = np.fft.irfft2(amplitude * (random[0] + 1j * random[1]), s=(nodes, nodes))
    return HeightMap(heights * (rms_nm * 1e-6 / heights.std()), pitch_mm=(pitch, pitch))


def mapped() -> Scene:
    """The preset `sphere` with a letter of 100 nm, turned by 35 degrees and moved."""
    table = MirrorMap(heights=letter(), rotation_deg=35.0, centre_mm=(20.0, -30.0), outside="nearest")
    return replace(with_maps(load_scene("sphere"), table), name="mapped")
