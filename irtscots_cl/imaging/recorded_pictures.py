"""A camera's images of the pictures that `irtscots patterns` wrote, from traced rays: a rehearsal of a real test."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.imaging.detector import mean_of_frames, pixel_properties
from irtscots_cl.imaging.fringe_manifest import CAMERA, NAME, read_manifest
from irtscots_cl.imaging.orientation import stored
from irtscots_cl.imaging.pictures import Pictures, read_pictures
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.detector_noise import DetectorNoise

MAX_BITS = 16
SCAN = "x"  # whose random numbers the frames take
DARK_SHARE = 0.015  # of full scale, without light: a camera's black level


def record_pictures(
    run: Any,
    folder: str | Path,
    *,
    electrons: float = 9000.0,
    full_well_e: float = 10_000.0,
    read_noise_e: float = 2.5,
    bits: int = 12,
    seed: int = 1,
) -> list[Path]:
    """Write the camera's images of the pictures of a manifest's folder into folder/camera, as TIFF of whole counts.

    run: a trace by rays (adjoint or forward) of the scene that the pictures were made for. electrons: in the brightest
    sample of all frames; full_well_e: at the highest count. Each sample has the noise of its electrons, and read noise.
    Returns the paths, in the manifest's order. Raises ValueError for pictures that do not fit, a folder `camera` that
    is not empty, and numbers that are not allowed.
    """
    for name, value, least in (("electrons", electrons, 1.0), ("full_well_e", full_well_e, 1.0),
                               ("read_noise_e", read_noise_e, 0.0)):  # fmt: skip
        if not least <= value <= 1e12:
            raise ValueError(f"{name} = {value:g}: must be from {least:g} to 1e12")
    if not 1 <= bits <= MAX_BITS:
        raise ValueError(f"bits = {bits}: must be from 1 to {MAX_BITS}")
    folder, scene = Path(folder), run.scene
    camera = folder / CAMERA
    if camera.exists() and any(camera.iterdir()):
        raise ValueError(f"{camera}: has files; must be empty, or not there")
    frames = read_manifest(folder / NAME, scene).frames
    response = scene.screen.response
    values = read_pictures([folder / frame.picture for frame in frames], scene)
    light = run.images(Pictures(scene, values, 1.0 if response is None else float(response.gamma)))
    if not light.max() > 0:
        raise ValueError(f"{folder}: no light of these pictures reaches the camera")
    counts = _counts(light * (electrons / light.max()), full_well_e, read_noise_e, bits, seed)
    camera.mkdir(exist_ok=True)
    paths = [camera / f"IMG_{k:04d}.tif" for k in range(1, len(counts) + 1)]
    import tifffile

    for path, image in zip(paths, stored(counts, scene.camera.detector.orientation), strict=True):
        tifffile.imwrite(path, np.ascontiguousarray(image))
    return paths


def _counts(electrons: FloatArray, full_well_e: float, read_noise_e: float, bits: int, seed: int) -> NDArray[Any]:
    """Whole counts of electrons [frames, rows, columns], with noise and a black level, as `record` makes them."""
    top = 2**bits - 1
    noise = DetectorNoise(
        electrons_at_peak=float(electrons.max()), shot_noise=True, read_noise_e=float(read_noise_e),
        full_well_e=float(full_well_e), gain_e_per_dn=full_well_e / top, offset_dn=DARK_SHARE * top, bits=bits,
        seed=seed,
    )  # fmt: skip
    pixels, one_frame = pixel_properties(noise, electrons.shape[1:]), np.ones(1)
    counts = [mean_of_frames(noise, pixels, light.ravel(), one_frame, SCAN, k)[0] for k, light in enumerate(electrons)]
    whole: NDArray[Any] = np.reshape(counts, electrons.shape).astype(np.uint8 if bits <= 8 else np.uint16)
    return whole
