"""Saves the sums of traces in files, so that an interrupted trace can be continued, to the same bits.

A file is one line, `irtscots-cl checkpoint 2 DIGEST JSON`, then the sums (packed_sums.py), then the digest of all
before. DIGEST is that of the JSON: the facts that the sums depend on, where the trace continues, and the time that it
took. The arrays' shapes come from the trace, never from the file.
"""

from __future__ import annotations

import json
import math
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from io import BufferedReader
from pathlib import Path

import numpy as np

from irtscots_cl.execution.checkpoint_file import (
    DIGEST_BYTES,
    Fingerprint,
    damaged,
    differences,
    digest_hash,
    digest_of,
    nbytes_of,
    new_path,
    read_header,
    write_checkpoint,
)
from irtscots_cl.execution.launch_plan import Cursor
from irtscots_cl.execution.packed_sums import unpack
from irtscots_cl.system import interruption

MIN_SECONDS = 5.0  # between two saves
COST_SHARE = 50  # the time between two saves is so many times that of a save: 2 %
LONG_SAVE_SECONDS = 5.0  # a shorter save is always made when a signal comes
BYTES_PER_SECOND = 1e8  # of saving, before a save has been timed


class Interrupted(Exception):  # noqa: N818  no error
    """A trace ended before its last ray, after its sums were saved; the message is one line."""


class Checkpoints:
    """Where the traces of a command are saved, and when they end early.

    path: the file of the one trace, or with many=True a folder with a file for each, named after its facts. resume:
    continue from the files that are there. max_seconds: of tracing, after which traces end. warn(line): called once if
    a save fails, since the trace continues without. stop: if set to True, for example by a callback, the trace ends
    after the launch, as after a signal that system.interruption handles.
    """

    def __init__(
        self,
        path: Path | str,
        resume: bool = False,
        many: bool = False,
        max_seconds: float = math.inf,
        warn: Callable[[str], None] = warnings.warn,
    ):
        self.path, self.resume, self.many, self.max_seconds = Path(path), resume, many, max_seconds
        self.warn, self.warned, self.stop, self.end_time = warn, False, False, math.inf

    def file_of(self, facts: Fingerprint) -> Checkpoint:
        """The file of a trace, by all the facts that are known before its kernel is built.

        Raises ValueError if there is a folder in its place, or a file in the place of the folder of many.
        """
        self.check_place()
        path = self.path / digest_of(facts) if self.many else self.path
        if path.is_dir():
            raise ValueError(f"{path}: is a folder; must be a checkpoint's file, or not be there")
        return Checkpoint(self, path, facts)

    def check_place(self) -> None:
        """Raise ValueError if the path is a folder where it must be a file, or the other way round."""
        if self.path.exists() and self.path.is_dir() != self.many:
            found, must = ("a file", "the checkpoints' folder") if self.many else ("a folder", "the checkpoint's file")
            raise ValueError(f"{self.path}: is {found}; must be {must}, or not be there")

    def files(self) -> list[Path]:
        """The files from which traces can be continued."""
        if self.many:
            return sorted(path for path in self.path.glob("*") if path.suffix != ".new")
        return [self.path] * self.path.exists()

    def check_start(self) -> None:
        """Refuse, with a ValueError, to overwrite the files of an interrupted run, or what is no checkpoint."""
        self.check_place()
        if self.files() and not self.resume:
            raise ValueError(
                f"{self.path}: left by an interrupted run; must be continued by --resume, or deleted first"
            )

    def remove(self) -> None:
        """All files, once the results are written."""
        for path in self.path.glob("*") if self.many else (self.path, new_path(self.path)):
            path.unlink(missing_ok=True)
        if self.many and self.path.exists():
            self.path.rmdir()


class Checkpoint:
    """The file of one trace. seconds: {"trace", "kernels"} that earlier processes spent on its sums."""

    def __init__(self, keeper: Checkpoints, path: Path, facts: Fingerprint):
        self._keeper, self.path, self._facts = keeper, path, facts | {"byte_order": sys.byteorder}
        self.seconds = {"trace": 0.0, "kernels": 0.0}
        self.saves, self.save_seconds = 0, 0.0
        self._in_file, self._seconds_per_byte = False, 1 / BYTES_PER_SECOND

    def saved(self, name: str, allowed: Sequence[int]) -> int:
        """A number of the saved fingerprint; the first of `allowed` if nothing is saved or it is none of them."""
        if not self._found():
            return allowed[0]
        with open(self.path, "rb") as file:
            value = read_header(file, self.path)["facts"].get(name)
        return value if type(value) is int and value in allowed else allowed[0]

    def begin(
        self, job: Fingerprint, rays: np.ndarray, sources: int, per_item: int, sums: tuple[np.ndarray, ...]
    ) -> Cursor:
        """Read the file's sums into `sums`, each [replicates, ...] and zero; returns where the trace continues.

        job: the facts that are known once the kernel is built. rays: [replicates] per source. Without a file, or if
        none is wanted, the trace starts anew. Raises ValueError, one line, for a damaged file or one of another run.
        """
        keeper, self._facts, self._sums, cursor = self._keeper, self._facts | job, sums, Cursor()
        self._rays, self._streams = rays, sources
        if self._found():
            with open(self.path, "rb") as file:
                cursor = self._read(file, rays, sources, per_item)
            self._in_file = True
        self._began = self._saved = time.monotonic()
        if keeper.end_time == math.inf:
            keeper.end_time = self._began + keeper.max_seconds
        return cursor

    def launched(self, cursor: Cursor, kernel_seconds: float, collect: Callable[[], None]) -> None:
        """After each launch except the last: save if a save is due. collect() updates the sums of `begin` to `cursor`.

        kernel_seconds: since `begin`. Raises Interrupted, after a save, if the trace must end.
        """
        now, cost = time.monotonic(), self._seconds_per_byte * nbytes_of(self._kept_of(cursor))
        if not self.ends and now - self._saved < max(MIN_SECONDS, COST_SHARE * cost):
            return
        lost = self._end_unsaved(now, cost)
        if not lost:
            collect()
            self._save(cursor, kernel_seconds, now)
        if self.ends:  # also where the signal came while the sums were saved
            raise Interrupted(f"{self._why()} after {self._share(cursor):.0%} of the rays{lost}")

    def ended(self, cursor: Cursor, kernel_seconds: float) -> None:
        """After the last launch, when the sums are complete: they replace those that were saved before."""
        now, lost = time.monotonic(), ""
        if self._stopped:
            lost = self._end_unsaved(now, self._seconds_per_byte * nbytes_of(self._kept_of(cursor)))
        if (self._in_file or self._stopped) and not lost:
            self._save(cursor, kernel_seconds, now)
        if self._stopped:
            raise Interrupted(f"{self._why()} after all of the rays{lost}")

    def _end_unsaved(self, now: float, cost: float) -> str:
        """What is lost, in words, where a signal ends the trace and saving takes longer than tracing that again; or "".

        cost: of saving, in seconds, estimated. The sums of a large detector have gigabytes.
        """
        if not self._stopped or cost < LONG_SAVE_SECONDS:
            return ""
        if now - self._saved < cost:
            return f", of which the last {now - self._saved:.0f} s are not saved: saving takes about {cost:.0f} s"
        self._keeper.warn(f"{self.path}: saving takes about {cost:.0f} s; a second signal ends it, without")
        return ""

    @property
    def ends(self) -> bool:
        """Whether the trace ends at the next call of `launched`."""
        return self._stopped or time.monotonic() >= self._keeper.end_time

    def discard(self) -> None:
        """Delete the saved sums, which turned out to be useless."""
        self.path.unlink(missing_ok=True)
        self._in_file, self.seconds = False, {"trace": 0.0, "kernels": 0.0}

    def _share(self, cursor: Cursor) -> float:
        return cursor.rays_before(self._rays, self._streams) / (int(self._rays.sum()) * self._streams)

    @property
    def _stopped(self) -> bool:
        return self._keeper.stop or interruption.requested()

    def _why(self) -> str:
        return "interrupted" if self._stopped else f"--max-seconds {self._keeper.max_seconds:g}: stopped"

    def _found(self) -> bool:
        return self._keeper.resume and self.path.exists()

    def _kept_of(self, cursor: Cursor) -> list[np.ndarray]:
        """The parts of the sums that are in a file: those of the replicates begun."""
        return [array[: cursor.replicate + (cursor != Cursor(cursor.replicate))] for array in self._sums]

    def _save(self, cursor: Cursor, kernel_seconds: float, started: float) -> None:
        """Replace the file by the sums; if that fails, the old file stays and the trace continues."""
        arrays, keeper = self._kept_of(cursor), self._keeper
        seconds = {"trace": started - self._began + self.seconds["trace"],
                   "kernels": kernel_seconds + self.seconds["kernels"]}  # fmt: skip
        header = {"facts": self._facts, "place": list(cursor), "seconds": seconds}
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_checkpoint(self.path, json.dumps(header).encode(), arrays)
            self._in_file = True
        except OSError as error:
            if not keeper.warned:
                keeper.warn(f"{self.path}: cannot be saved: {error.strerror or error}; tracing continues")
            keeper.warned = True
        self._saved = time.monotonic()
        self._seconds_per_byte = (self._saved - started) / max(nbytes_of(arrays), 1)
        self.saves, self.save_seconds = self.saves + 1, self.save_seconds + self._saved - started

    def _read(self, file: BufferedReader, rays: np.ndarray, sources: int, per_item: int) -> Cursor:
        header = read_header(file, self.path)
        different = differences(header["facts"], self._facts)
        if different:
            raise ValueError(f"{self.path}: of another run: {different}; must be the same, or the file be deleted")
        try:
            cursor, (trace, kernels) = Cursor(*header["place"]), (header["seconds"][n] for n in ("trace", "kernels"))
            cursor.check(rays, sources, per_item)
            if not all(type(s) is float and 0 <= s < 1e12 for s in (trace, kernels)):
                raise ValueError("seconds")
        except (TypeError, ValueError, KeyError):
            raise damaged(self.path) from None
        start = file.tell()
        file.seek(0)
        digest = digest_hash(file.read(start))

        def read(count: int) -> bytes:
            data = file.read(count)
            if len(data) != count:
                raise damaged(self.path)
            digest.update(data)
            return data

        try:
            for array in self._kept_of(cursor):
                unpack(read, array)
        except ValueError:
            raise damaged(self.path) from None
        if file.read(DIGEST_BYTES + 1) != digest.digest():
            raise damaged(self.path)
        self.seconds = {"trace": trace, "kernels": kernels}
        return cursor
