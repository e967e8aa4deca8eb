"""The file of a checkpoint: its format, its digests, how it is written whole."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from irtscots_cl.execution.packed_sums import packed
from irtscots_cl.system import interruption

Fingerprint = dict[str, str | int | float | bool]
FORMAT = b"irtscots-cl checkpoint 2 "
MAX_HEADER_BYTES = 2**14
DIGEST_BYTES = 32
HASHED = ("scene", "code", "inputs", "paths", "maps")  # facts whose values are too long for a message


def digest_of(facts: Fingerprint) -> str:
    """A name for the facts: 32 hexadecimal digits."""
    return hash_of(json.dumps(facts, sort_keys=True).encode())


def hash_of(*pieces: bytes | np.ndarray) -> str:
    """A digest of the pieces and their lengths: 32 hexadecimal digits."""
    digest = hashlib.blake2b(digest_size=16)
    for piece in pieces:
        data = piece if isinstance(piece, bytes) else np.ascontiguousarray(piece).tobytes()
        digest.update(len(data).to_bytes(8, "little") + data)
    return digest.hexdigest()


def write_checkpoint(path: Path, header: bytes, arrays: list[np.ndarray]) -> None:
    """Write a new file, flush it to the disk and rename it: at any time either the old or the new file is complete."""
    line = FORMAT + hash_of(header).encode() + b" " + header + b"\n"
    digest, new = digest_hash(line), new_path(path)
    try:
        with interruption.before_the_end(new.unlink), open(new, "wb") as file:
            file.write(line)
            for array in arrays:
                for piece in packed(array):
                    file.write(piece)
                    digest.update(piece)
            file.write(digest.digest())
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    except OSError:
        new.unlink(missing_ok=True)
        raise
    if os.name == "posix":  # so that the new name, too, is on the disk
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def new_path(path: Path) -> Path:
    """Where a file is written before it takes its place: one name, so that killed processes leave one file at most."""
    return path.with_name(path.name + ".new")


def read_header(file: BinaryIO, path: Path) -> dict[str, Any]:
    """The JSON of the first line; ValueError if the line is not as it was written."""
    line = file.readline(MAX_HEADER_BYTES)
    digest, _, text = line.removeprefix(FORMAT).removesuffix(b"\n").partition(b" ")
    if not line.startswith(FORMAT) or not line.endswith(b"\n") or digest != hash_of(text).encode():
        raise damaged(path)
    try:
        header = json.loads(text)
    except (ValueError, RecursionError):
        raise damaged(path) from None
    if not isinstance(header, dict) or not isinstance(header.get("facts"), dict):
        raise damaged(path)
    return header


def damaged(path: Path) -> ValueError:
    return ValueError(f"{path}: damaged, or not a checkpoint of this version; must be deleted, to start anew")


def differences(kept: dict[str, Any], here: Fingerprint) -> str:
    """In words where two runs differ, "" where they do not; what follows from the rest is named only when alone."""
    names = [name for name in {**here, **kept} if kept.get(name) != here.get(name)]
    for follows in ("inputs", "code"):  # the kernel's text has numbers of the options in it
        if len(names) > 1 and follows in names:
            names.remove(follows)
    words = []
    for name in names:
        values = (f"{kept.get(name, 'none')}"[:60], f"{here.get(name, 'none')}"[:60])
        shown = name not in HASHED and all(value.isprintable() for value in values)
        words.append(f"{name[:60]!a} = {values[0]}, here {values[1]}" if shown else f"other {name[:60]!a}")
    return "; ".join(words[:5]).replace("'", "")


def digest_hash(data: bytes) -> hashlib.blake2b:
    return hashlib.blake2b(data, digest_size=DIGEST_BYTES)


def nbytes_of(arrays: list[np.ndarray]) -> int:
    return sum(array.nbytes for array in arrays)
