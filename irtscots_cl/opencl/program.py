"""From kernel files to a built program: the files that a scene needs, one source text, one build.

A kernel file includes others with #include "name.cl". A name with a star, such as "surface_*.cl", is a choice: the
host selects the one file of that family that the scene, the sampler or the device needs. Every file is included once,
after a #line directive, so that compiler messages name the right file and line.
"""

from __future__ import annotations

import hashlib
import re
import tempfile
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

import numpy as np
import pyopencl as cl

from irtscots_cl.opencl.device import Device, DeviceError, first_line
from irtscots_cl.opencl.pocl_cache import PLATFORM, cache_problem
from irtscots_cl.opencl.structs import PRECISIONS, c_declarations

BLOCK = 256  # rays of a block: their data (22 KiB) fits the L1 cache
LEAST_BLOCK = 16  # random words come by so many
_INCLUDE = re.compile(r'^#include "([a-z0-9_]+(?:_\*)?\.cl)"\s*$')


def kernels_folder() -> Path:
    """The folder of the kernel files: inside the installed package, or next to it in a source tree."""
    package = Path(str(files("irtscots_cl")))
    for folder in (package / "kernels", package.parent / "kernels"):
        if folder.is_dir():
            return folder
    raise FileNotFoundError("the package's kernels folder is missing")


def kernel_files(folder: Path | None = None) -> dict[str, Path]:
    """The kernel files by name. Names are unique over all subfolders, so that an #include needs no path."""
    return {path.name: path for path in sorted((folder or kernels_folder()).rglob("*.cl"))}


@dataclass(frozen=True)
class Source:
    """A composed OpenCL source: text, build options, its kernel files in order, and the precision of its reals."""

    text: str
    options: tuple[str, ...]
    files: tuple[str, ...]
    precision: str

    @property
    def digest(self) -> str:
        """32 hexadecimal digits that tell this source and its options from others."""
        digest = hashlib.blake2b(digest_size=16)
        for text in (self.text, *self.options):
            digest.update(len(text).to_bytes(8, "little") + text.encode())
        return digest.hexdigest()


def compose(
    entry: str | Path,
    choices: dict[str, str],
    structs: dict[str, np.dtype],
    precision: str,
    width: int,
    constants: dict[str, tuple[int, ...]] | None = None,
    macros: dict[str, str] | None = None,
    first: tuple[str, ...] = (),
    block: int = BLOCK,
) -> Source:
    """Source of the kernel file `entry` with all files that it includes.

    entry: the name of a kernel file, or the path of a file elsewhere that includes some of them.
    choices: family -> member, e.g. {"surface": "sphere"}; structs, constants: see structs.c_declarations.
    width: rays side by side in a work-item, 1, 8 or 16. macros: "NAME(arguments)" -> text.
    first: files that come before the entry, with what they include. block: rays that a work-item with several side by
    side traces from stage to stage, a power of two from 16 on.
    """
    choices = choices | {
        "real": "float" if precision == "fp32" else "double",
        **dict.fromkeys(("simd", "gather", "sobol_words"), "vector" if width > 1 else "scalar"),
    }
    known = kernel_files()
    files: list[str] = []
    pieces = [piece for name in (*first, entry) for piece in _expand(known, name, choices, files)]
    # The structures need the types' names only, so they come first, before any kernel file.
    declarations = _pragma(precision) + c_declarations(structs, constants)
    declarations += "".join(f"#define {name} {text}\n" for name, text in (macros or {}).items())
    text = '#line 1 "interface (generated)"\n' + declarations + "".join(pieces)
    options = (f"-DWIDTH={width}", f"-DBLOCK={block}") if width > 1 else ()
    return Source(text, (*options, "-cl-std=CL1.2"), tuple(files), precision)


def _pragma(precision: str) -> str:
    return "#pragma OPENCL EXTENSION cl_khr_fp64 : enable\n" if precision == "fp64" else ""


def _expand(known: dict[str, Path], entry: str | Path, choices: dict[str, str], files: list[str]) -> list[str]:
    """Text of one file and of its includes that are not yet in files, depth first."""
    name = Path(entry).name
    if name in files:
        return []
    lines = _lines(known.get(str(entry), Path(entry)))
    pieces, here = [], f'#line 1 "{name}"\n'
    for number, line in enumerate(lines, 1):
        match = _INCLUDE.match(line)
        if match is None:
            here += line + "\n"
            continue
        pieces += [here, *_expand(known, _chosen(match[1], choices), choices, files)]
        here = f'#line {number + 1} "{name}"\n'
    files.append(name)
    return [*pieces, here]


@lru_cache
def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="ascii").splitlines()


def _chosen(name: str, choices: dict[str, str]) -> str:
    return name if "*" not in name else name.replace("*", choices[name.split("_*")[0]])


_built: dict[tuple[cl.Context, Source], cl.Program] = {}


def build(device: Device, source: Source) -> cl.Program:
    """The built program. A second call with the same device and source returns the same program.

    Across processes, the user's binary caches avoid builds: the driver's own (PoCL, NVIDIA), else PyOpenCL's, whose key
    is the source, the options, the device and its driver.
    Raises DeviceError if the device's compiler rejects the source; its message names the file of the compiler's log.
    """
    key = (device.context, source)
    if key not in _built:
        try:
            _built[key] = cl.Program(device.context, source.text).build(options=list(source.options))
        except cl.Error as error:
            if device.platform == PLATFORM and (problem := cache_problem()):
                raise DeviceError(f"{device.label}: kernels do not build: {problem}") from error
            log = str(error)
            line = next((line for line in log.splitlines() if "error" in line.lower()), first_line(error))
            told = f"{device.label}: kernels do not build: {line.strip()[:300]}"
            raise DeviceError(f"{told}; {_keep_log(log)}") from error
    return _built[key]


def _keep_log(log: str) -> str:
    """Write a compiler's log to a new file in the user's folder for temporary files. Returns a text with its path."""
    try:
        handle, path = tempfile.mkstemp(prefix="irtscots-build-", suffix=".log")  # its name cannot be guessed
        with open(handle, "w", encoding="utf-8", errors="replace") as file:
            file.write(log + "\n")
    except OSError as error:
        return f"its log could not be kept: {error}"
    return f"the compiler's log: {path}"


def check_precision(device: Device, precision: str) -> None:
    """Raise DeviceError if the device cannot compute in that precision; ValueError unless it is "fp32" or "fp64"."""
    if precision not in PRECISIONS:
        raise ValueError(f"precision = {precision!r}: must be fp32 or fp64")
    if precision == "fp64" and not device.has_fp64:
        raise DeviceError(f"--precision = fp64: {device.label} has no double precision; use fp32")
