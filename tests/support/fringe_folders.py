"""A laboratory's folder of fringe images, made from a traced test: pictures' manifest, noise, whole numbers, files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.imaging.fringe_manifest import FringeManifest, frames_of, manifest_text
from irtscots_cl.imaging.fringes import FringeScan, FringeSet
from irtscots_cl.imaging.orientation import stored
from irtscots_cl.scene.model import Scene

DARK_COUNTS = 60.0  # of 4095
READ = 2.0  # counts of 4095
ELECTRONS = 5.0  # per count of 4095


def stored_as(scene: Scene, orientation: str) -> Scene:
    """The scene with images that lie in their files as `orientation` says."""
    detector = replace(scene.camera.detector, orientation=orientation)
    return replace(scene, camera=replace(scene.camera, detector=detector))


@dataclass
class Lab:
    """Frames [N, rows, columns] in whole counts of `bits`, as stored, and the manifest that tells of them."""

    manifest: FringeManifest
    frames: np.ndarray

    def write(self, folder: Path, kind: str = "tif", name: str = "IMG_{}", manifest: bool = True) -> list[Path]:
        """Write the images into folder/camera, and the manifest; return the images' paths."""
        camera = folder / "camera"
        camera.mkdir(parents=True)
        paths = [camera / f"{name.format(k + 1)}.{kind}" for k in range(len(self.frames))]
        for path, image in zip(paths, self.frames, strict=True):
            write_image(path, image)
        if manifest:
            (folder / "manifest.toml").write_text(manifest_text(self.manifest, "test"), encoding="utf-8")
        return paths


def write_image(path: Path, image: np.ndarray) -> None:
    if path.suffix == ".tif":
        import tifffile

        tifffile.imwrite(path, image)
    else:
        from PIL import Image

        Image.fromarray(image).save(path)


def recorded(
    run: Any, scene: Scene, sets: tuple[FringeSet, ...], *, bits: int = 12, noise: bool = True, seed: int = 1,
    gamma: float = 1.0, exposure: float = 0.9
) -> Lab:  # fmt: skip
    """What a camera records of a traced run. exposure: of the brightest sample, over the full scale."""
    stack = run.images(FringeScan(scene, sets, gamma=gamma, levels=255))
    assert stack.white is not None
    light = np.concatenate([np.zeros((1, *stack.shape)), stack.white[None], np.asarray(stack.frames)])
    top = 2**bits - 1
    counts = DARK_COUNTS * top / 4095 + light * (exposure * top - DARK_COUNTS * top / 4095) / light.max()
    if noise:
        random = np.random.default_rng(seed)
        scale = 4095 / top
        sigma = np.sqrt((READ / scale) ** 2 + np.maximum(counts, 0) / (ELECTRONS * scale))
        counts = counts + sigma * random.standard_normal(counts.shape)
    whole = np.clip(np.rint(counts), 0, top).astype(np.uint8 if bits == 8 else np.uint16)
    orientation = scene.camera.detector.orientation
    frames = np.ascontiguousarray(stored(whole, orientation))
    return Lab(FringeManifest(scene.name, scene.screen.pixels, frames_of(sets), ("camera",), 8), frames)
