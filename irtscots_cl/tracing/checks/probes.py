"""Single rays on a device: the kernels' own files, with entry kernels that write out their results.

For checks of the arithmetic; a run never uses them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import BLOCK, check_precision, compose
from irtscots_cl.opencl.structs import PRECISIONS
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.model import Scene
from irtscots_cl.tracing.packing.scene import pack
from irtscots_cl.tracing.samplers import DIMENSIONS


@dataclass(frozen=True)
class Met:
    """Where lines met the mirror, as the device found it, in its own precision.

    point, normal: [3, n] (the normal of any length); landing: [2, n] in the screen's frame; on_mirror, ahead: bool [n].
    """

    point: np.ndarray
    normal: np.ndarray
    landing: np.ndarray
    on_mirror: np.ndarray
    ahead: np.ndarray


@dataclass(frozen=True)
class AdjointPaths:
    """Paths from detector pixels. disk: [2, n] on the unit disk; point: [3, n] world; landing: [2, n] on the screen;
    weight, on_mirror, ahead: [n]. Lengths in mm."""

    disk: np.ndarray
    point: np.ndarray
    landing: np.ndarray
    weight: np.ndarray
    on_mirror: np.ndarray
    ahead: np.ndarray


@dataclass(frozen=True)
class ForwardPaths:
    """Paths from screen pixels. disk: [2, n] on the unit disk of the aim; point: [3, n] world; aperture, slopes: [2, n]
    in the camera's frame; on_mirror, through, pixel (-1: none): [n]. Lengths in mm."""

    disk: np.ndarray
    point: np.ndarray
    aperture: np.ndarray
    slopes: np.ndarray
    on_mirror: np.ndarray
    through: np.ndarray
    pixel: np.ndarray


class _Probe:
    """One entry kernel built for a scene. Raises DeviceError if the device cannot build it."""

    def __init__(self, device: Device, scene: Scene, precision: str, entry: str):
        check_precision(device, precision)
        self.real, self.width = PRECISIONS[precision], device.vector_width(precision)
        packed = pack(ChiefRays(scene), precision)
        choices = packed.choices | {"sampler": "philox"}
        source = compose(f"{entry}.cl", choices, packed.structs, precision, self.width, packed.constants)
        self._work = Workspace(device, source, entry)
        self._scene, self._tables = self._work.upload(packed.scene), self._work.upload(packed.tables)

    def _run(self, items: int, inputs: list[np.ndarray], outputs: list[np.ndarray]) -> list[np.ndarray]:
        work = self._work
        buffers = [work.empty(out.nbytes) for out in outputs]
        work.launch((items, 1), [self._scene, self._tables, *(work.upload(array) for array in inputs), *buffers])
        return [work.download(buffer, out) for buffer, out in zip(buffers, outputs, strict=True)]


class MeetProbe(_Probe):
    """kernels/entry/probe_meet.cl: lines to the mirror and on to the screen."""

    def __init__(self, device: Device, scene: Scene, precision: str):
        super().__init__(device, scene, precision, "probe_meet")

    def __call__(self, lines: np.ndarray) -> Met:
        """Follow lines [4, n] (x0, y0, p, q), which must be numbers of the probe's precision."""
        count = lines.shape[1]
        items = -(-count // self.width)
        padded = np.zeros((4, items * self.width), self.real)
        padded[:, :count] = lines
        vectors = padded.reshape(4, items, self.width).transpose(1, 0, 2)
        outputs = [np.zeros((items, 8, self.width), self.real), np.zeros((items, 2, self.width), np.int32)]
        met, marks = (
            out.transpose(1, 0, 2).reshape(out.shape[1], -1)[:, :count] for out in self._run(items, [vectors], outputs)
        )
        return Met(met[0:3], met[3:6], met[6:8], *marks.astype(bool))


class PathProbe(_Probe):
    """kernels/entry/probe_adjoint.cl or probe_forward.cl: whole paths of given random words."""

    def __init__(self, device: Device, scene: Scene, precision: str, estimator: str):
        super().__init__(device, scene, precision, f"probe_{estimator}")
        self._fields, self._marks = {"adjoint": (8, 2), "forward": (9, 3)}[estimator]
        self._kind = {"adjoint": AdjointPaths, "forward": ForwardPaths}[estimator]

    def __call__(self, sources: np.ndarray, words: np.ndarray) -> AdjointPaths | ForwardPaths:
        """Paths of sources [n] (packing.receivers or packing.emitters), one ray of random words [n, 4] each.

        Sources that are neighbours should be equal, BLOCK at a time: each block takes its first ray's.
        """
        block = BLOCK if self.width > 1 else 1
        blocks = -(-len(words) // block)
        padded = np.zeros((blocks * block, DIMENSIONS), np.uint32)
        padded[: len(words)] = words
        inputs = [sources[::block], padded.reshape(blocks, block, DIMENSIONS).transpose(0, 2, 1)]
        outputs = [
            np.zeros((blocks, self._fields, block), self.real),
            np.zeros((blocks, self._marks, block), np.int32),
        ]
        paths, marks = (
            out.transpose(1, 0, 2).reshape(out.shape[1], -1)[:, : len(words)]
            for out in self._run(blocks, inputs, outputs)
        )
        if self._kind is AdjointPaths:
            return AdjointPaths(paths[0:2], paths[2:5], paths[5:7], paths[7], *marks.astype(bool))
        return ForwardPaths(paths[0:2], paths[2:5], paths[5:7], paths[7:9], *marks[:2].astype(bool), marks[2])


def uniform_centred(words: np.ndarray) -> np.ndarray:
    """What kernels/random/uniform.cl makes of uint32 words, exactly: odd multiples of 2^-25 in (-1/2, 1/2)."""
    return ((np.ascontiguousarray(words).view(np.int32) >> 7) | 1) * 2.0**-25
