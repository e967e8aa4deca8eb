"""A laboratory's folder of images of any patterns, made from a traced test through the pictures of `patterns`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import tifffile
from PIL import Image

import irtscots_cl as irt
from irtscots_cl.imaging.fringe_manifest import read_manifest
from irtscots_cl.imaging.orientation import stored, upright
from irtscots_cl.imaging.pictures import Pictures
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene

DARK_COUNTS = 60.0
PEAK = 3600.0  # counts of a white screen, of 4095
READ, ELECTRONS = 2.0, 5.0  # noise in counts; electrons per count


def small_scene(name: str = "sphere-deviated", pixels: int = 24, **camera: Any) -> Scene:
    """A preset seen by a camera of fewer, larger pixels."""
    scene = irt.load_scene(name)
    detector = scene.camera.detector
    pitch = detector.pitch_mm * detector.pixels[0] / pixels
    detector = replace(detector, pixels=(pixels, pixels), pitch_mm=pitch)
    return replace(scene, camera=replace(scene.camera, detector=detector, **camera))


def shown_pictures(folder: Path, scene: Scene) -> np.ndarray:
    """What the screen shows by the PNG files of a folder's manifest: [frames, rows, columns], upright, from 0 to 1."""
    values = []
    for frame in read_manifest(folder / "manifest.toml", scene).frames:
        with Image.open(folder / frame.picture) as file:
            image = np.asarray(file)
        values.append(image[::-1, ::-1] / np.iinfo(image.dtype).max)
    return np.stack(values)


def record(
    run: Any, scene: Scene, folder: Path, *, noise: float = 1.0, seed: int = 1, peak: float = PEAK, white_w: float = 0.0
) -> list[Path]:
    """Record the pictures of a folder with a 12-bit camera: TIFF files in folder/camera. noise: times the usual one.

    white_w: flux of a white screen's brightest pixel, for `peak`; 0: the brightest sample of all.
    """
    light = run.images(Pictures(scene, shown_pictures(folder, scene)))
    counts = DARK_COUNTS + light * peak / (white_w or light.max())
    random = np.random.default_rng(seed)
    sigma = noise * np.sqrt(READ**2 + np.maximum(counts, 0) / ELECTRONS)
    whole = np.clip(np.rint(counts + sigma * random.standard_normal(counts.shape)), 0, 4095).astype(np.uint16)
    frames = stored(whole, scene.camera.detector.orientation)
    (folder / "camera").mkdir()
    paths = [folder / "camera" / f"IMG_{k + 1}.tif" for k in range(len(frames))]
    for path, image in zip(paths, frames, strict=True):
        tifffile.imwrite(path, np.ascontiguousarray(image))
    return paths


def height_error_nm(result: Path, scene: Scene) -> tuple[float, float]:
    """rms of the height's error without piston and tilt, and the stated one, of a result.h5."""
    word = scene.camera.detector.orientation
    names = ("mirror/x_mm", "mirror/y_mm", "deviation_nm", "height_standard_error_nm", "mask")
    with h5py.File(result) as file:
        x, y, height, error, mask = (upright(file[name][()], word) for name in names)
    true_nm = Setup(scene).chief_rays.surface.deviation_at(x, y)[0] * 1e6
    return rms(remove_terms(x, y, height - true_nm, mask, "piston_tilt"), mask), rms(error, mask)
