"""Whether a worker runs the same code as who gives it tasks."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from irtscots_cl.opencl.program import kernels_folder


class CodeError(ValueError):
    """A worker runs another version of this package; the message is one line."""


@lru_cache
def code_hash() -> str:
    """Of the package's Python and kernel files: all that a result's bits depend on except device and libraries."""
    package, digest = Path(str(files("irtscots_cl"))), hashlib.sha256()
    for folder, pattern in ((package, "*.py"), (kernels_folder(), "*.cl")):
        for path in sorted(folder.rglob(pattern)):
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def greet() -> dict[str, Any]:
    """A worker's code."""
    return {"code": code_hash()}


def check_code(code: str) -> str:
    """The address of the worker that runs this. Raises CodeError if its code is not the caller's, a code_hash()."""
    from distributed import get_worker

    address = get_worker().address
    if code != code_hash():
        raise CodeError(code_differs(address))
    return address


def code_differs(address: str) -> str:
    return f"--dask: worker {address} runs other code than this irtscots-cl: must be the same version on both sides"
