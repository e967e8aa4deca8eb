"""Single rays on a device: the kernels' own files, around entry kernels that write out what they computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.calibration import Calibration
from irtscots_cl.device import Device
from irtscots_cl.execution import Workspace
from irtscots_cl.interface import PRECISIONS
from irtscots_cl.packing import pack
from irtscots_cl.program import check_precision, compose
from irtscots_cl.scene import Scene


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


class MeetProbe:
    """kernels/probe_meet.cl for a scene on a device. Raises DeviceError if the device cannot build it."""

    def __init__(self, device: Device, scene: Scene, precision: str):
        check_precision(device, precision)
        self.real, self._width = PRECISIONS[precision], device.vector_width(precision)
        packed = pack(Calibration(scene), precision)
        source = compose("probe_meet.cl", packed.choices, packed.structs, precision, self._width, packed.constants)
        self._work = Workspace(device, source, "probe_meet")
        self._scene = self._work.upload(packed.scene)

    def __call__(self, lines: np.ndarray) -> Met:
        """Follow lines [4, n] (x0, y0, p, q), which must be numbers of the probe's precision."""
        count = lines.shape[1]
        items = -(-count // self._width)
        padded = np.zeros((4, items * self._width), self.real)
        padded[:, :count] = lines
        met, marks = np.zeros((8, padded.shape[1]), self.real), np.zeros((2, padded.shape[1]), np.int32)
        work = self._work
        buffers = [work.empty(out.nbytes) for out in (met, marks)]
        work.launch((items, 1), [self._scene, work.upload(padded), *buffers])
        for buffer, out in zip(buffers, (met, marks), strict=True):
            work.download(buffer, out)
        met, marks = met[:, :count], marks[:, :count].astype(bool)
        return Met(met[0:3], met[3:6], met[6:8], marks[0], marks[1])
