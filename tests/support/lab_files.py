"""Files of a laboratory's camera in every kind that is read, byte by byte where a library hides how they lie."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
from picture_files import fits, packed, png, ser, tiff

KINDS = ("tif12", "tif16", "tif-pages", "png8", "fits", "fits-cube", "ser-little", "ser-big", "npz", "h5")


def write_frames(folder: Path, frames: np.ndarray, kind: str, name: str = "IMG_{}", seed: int = 0) -> list[Path]:
    """Write frames [N, rows, columns] of whole counts, and return the paths in the frames' order.

    Kinds of one image a file are written in a shuffled order, so that neither the order of the directory nor the times
    of the files are that of the frames.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if kind in ("tif-pages", "fits-cube", "ser-little", "ser-big", "npz", "h5"):
        return [_stack(folder, frames, kind)]
    suffix = {"tif12": "tif", "tif16": "tif", "png8": "png", "fits": "fits"}[kind]
    paths = [folder / f"{name.format(k + 1)}.{suffix}" for k in range(len(frames))]
    for k in np.random.default_rng(seed).permutation(len(frames)):
        paths[k].write_bytes(_image(frames[k], kind))
    return paths


def _image(image: np.ndarray, kind: str) -> bytes:
    shape = image.shape
    if kind == "tif12":
        return tiff([packed(image, 12)], 12, shapes=[shape])
    if kind == "tif16":
        return tiff([image.astype(">u2").tobytes()], 16, big=True, shapes=[shape])
    if kind == "png8":
        return png(image, 8, 0)
    return fits(image[::-1].astype(np.int64) - 2**15, 16, "BZERO   =                32768")


def _stack(folder: Path, frames: np.ndarray, kind: str) -> Path:
    path = folder / f"series.{kind.split('-')[0]}"
    if kind == "tif-pages":
        path.write_bytes(tiff([image.tobytes() for image in frames], 16, shapes=[frames.shape[1:]] * len(frames)))
    elif kind == "fits-cube":
        stored = frames[:, ::-1].astype(np.int64) - 2**15
        path.write_bytes(fits(stored, 16, "BZERO   =                32768"))
    elif kind == "npz":
        np.savez_compressed(path, frames)
    elif kind == "h5":
        with h5py.File(path, "w") as file:
            file["camera/frames"] = frames
    else:
        order = kind.split("-")[1]  # and a flag that says the other, as many programs write it
        path.write_bytes(ser(frames, 12, order=order, flag=int(order == "big")))
    return path
