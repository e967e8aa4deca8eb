"""Small kernels for tests: compose one around the package's kernel files, run it, fetch what it wrote."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import compose
from irtscots_cl.opencl.structs import LAUNCH, PRECISIONS
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.tracing.packing.scene import pack

# Files that non-sequential kernels include, for tests that need none in particular.
PATH_FILES = {"path_code": "short", "light": "unpolarised", "carry": "unpolarised", "fresnel": "unpolarised"}
FOLDER = Path(__file__).parents[1] / "kernels"


class SmallKernel:
    """A kernel file of the tests' own, built for a scene (for a part of its files at least) on a device.

    entry: the file's path; its kernel has the same name. width: rays side by side; block: rays of a sampler's block.
    """

    def __init__(self, device: Device, entry: Path, precision: str, scene=None, width: int | None = None):
        self.real = PRECISIONS[precision]
        self.width = width or device.vector_width(precision)
        self.block = 256 if self.width > 1 else 1  # BLOCK of kernels/arithmetic/simd_*.cl
        self.words = 16 if self.width > 1 else 1  # WORD_LANES
        structs, choices, constants, self._scene = {"Launch": LAUNCH}, {}, {}, None
        if scene is not None:
            packed = pack(ChiefRays(scene), precision)
            structs, choices, self._scene = packed.structs, packed.choices, packed.scene
            constants, self.tables = packed.constants, packed.tables
        source = compose(entry, choices | {"sampler": "philox"}, structs, precision, self.width, constants)
        self._work = Workspace(device, source, entry.stem)

    def run(self, grid: tuple[int, int], inputs: list, outputs: list[np.ndarray]) -> list[np.ndarray]:
        """Launch with arguments (scene if there is one, inputs, outputs); the outputs, filled.

        inputs: arrays become buffers, numpy scalars and [()] structures are passed by value.
        """
        work = self._work
        before = [] if self._scene is None else [work.upload(self._scene)]
        given = [work.upload(x) if isinstance(x, np.ndarray) and x.ndim else x for x in inputs]
        buffers = [work.empty(out.nbytes) for out in outputs]
        for buffer in buffers:
            work.clear(buffer)
        work.launch(grid, [*before, *given, *buffers])
        return [work.download(buffer, out) for buffer, out in zip(buffers, outputs, strict=True)]


def kernel_text(path: Path, includes: list[str], signature: str, body: str) -> Path:
    """Write a kernel file that includes kernel files of the package; its kernel is named after the file."""
    lines = [f'#include "{name}"' for name in includes]
    lines += [f"__kernel void {path.stem}({signature}) {{", body, "}"]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path


def launch_of(**values: int) -> np.ndarray:
    """A Launch structure with these fields, the others 0."""
    launch = np.zeros((), LAUNCH)
    for name, value in values.items():
        launch[name] = value
    return launch


def lanes(vector: str, lane: str = "lane") -> str:
    """C text of one lane of a vector of reals, on any width."""
    return f"((const real *)&{vector})[{lane}]"


def width_of(device: Device, kind: str) -> int:
    """Rays side by side: 1 for "scalar", as many as the device likes for "own". Skips the test where these are one."""
    if kind == "own" and device.vector_width("fp32") == 1:
        pytest.skip("this device's own width is 1")
    return 1 if kind == "scalar" else device.vector_width("fp32")


def draw_on(device: Device, folder: Path, sampler: str, width: int) -> Callable[..., np.ndarray]:
    """draw(seed, stream, replicate, first, count) -> words [count, 4] of the device's sampler."""
    body = """    Sampler sampler;
    Words words;
    sampler_begin(&sampler, &launch, stream);
    sampler_block(&sampler, launch.first_ray + get_global_id(0) * BLOCK, &words);
    for (int ray = 0; ray < BLOCK; ++ray)
        for (int i = 0; i < 4; ++i) {
            const uintv word = ray_words(&words, i, ray / WIDTH);
            out[4 * (get_global_id(0) * BLOCK + ray) + i] = ((const uint *)&word)[ray % WIDTH];
        }"""
    signature = "const Launch launch, uint stream, __global uint *out"
    entry = kernel_text(folder / "draw.cl", [f"sampler_{sampler}.cl"], signature, body)
    kernel = SmallKernel(device, entry, "fp32", width=width)

    def draw(seed: int, source: int, replicate: int, first: int, count: int) -> np.ndarray:
        launch = launch_of(seed_low=seed & 0xFFFFFFFF, seed_high=seed >> 32, replicate=replicate, first_ray=first)
        out = np.zeros((-(-count // kernel.block) * kernel.block, 4), np.uint32)
        return kernel.run((len(out) // kernel.block, 1), [launch, np.uint32(source)], [out])[0][:count]

    return draw
