"""Files written whole under a temporary name, then renamed: no half-written file has the final name."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from irtscots_cl.system import interruption

T = TypeVar("T")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path next to `path` to write to; on success it becomes `path`, on an error it is removed."""
    interruption.check()
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        with interruption.before_the_end(temporary.unlink):
            yield temporary
        with open(temporary, "rb+") as written:
            os.fsync(written.fileno())
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, data: Mapping[str, object]) -> None:
    """Write JSON; NaN becomes null, which every reader of JSON understands."""
    write_text(path, json.dumps(plain(data), indent=2, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """The value in JSON's own types: NumPy scalars unpacked, NaN and infinities as None."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def check_output_folder(folder: Path, files: Iterable[str] = (), folders: Iterable[str] = ()) -> None:
    """Raises ValueError if the folder could not be made or written, without making it.

    files, folders: names in it that will be written; the same if something else is in the place of one.
    """
    if "\0" in str(folder):
        raise ValueError(f"--out = {str(folder)!r}: no folder can have this name")
    nearest = next(part for part in (folder, *folder.absolute().parents) if part.exists())
    if not nearest.is_dir():
        raise ValueError(f"--out = {str(folder)!r}: {nearest} is not a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise ValueError(f"--out = {str(folder)!r}: no permission to write in {nearest}")
    for name in files:
        if (folder / name).is_dir():
            raise ValueError(f"--out = {str(folder)!r}: {name} is a folder there; must be a file, or not be there")
    for name in folders:
        if (folder / name).exists() and not (folder / name).is_dir():
            raise ValueError(f"--out = {str(folder)!r}: {name} is no folder there; must be one, or not be there")
        for path in (folder / name).glob("*.png"):
            if path.is_dir():
                raise ValueError(f"--out = {str(folder)!r}: {name}/{path.name} is a folder there; must be a file")


def draw_or_delete(folder: Path, names: Iterable[str], wanted: bool, draw: Callable[[Path], T]) -> T | None:
    """Draw figures into a folder, which is made; where none are wanted, delete an earlier command's of these names, and
    the folder if it is then empty."""
    if wanted:
        folder.mkdir(parents=True, exist_ok=True)
        return draw(folder)
    if folder.is_dir():
        for name in names:
            (folder / name).unlink(missing_ok=True)
        if not any(folder.iterdir()):
            folder.rmdir()
    return None


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Make a folder before long work whose files it is to hold; at the end, what was made here and is empty goes.

    Raises OSError if it cannot be made.
    """
    made = [part for part in (folder, *folder.parents) if not part.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        for part in made:
            with suppress(OSError):  # not empty
                part.rmdir()
