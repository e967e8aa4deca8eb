"""Long commands: one process per folder, and checkpoints after Ctrl-C, SIGTERM or a time limit."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from irtscots_cl.cli.common import StoppedError
from irtscots_cl.system import interruption

LOCK = ".lock"


def add_resume(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--resume",
        action="store_true",
        help="continue an interrupted command with the same options and --out, to the same bits; without a checkpoint, "
        "start",
    )


@contextmanager
def keeping(folder: Path, name: str, resume: bool, *, many: bool = False, max_seconds: float = math.inf) -> Iterator:
    """The Checkpoints of a command's traces, in folder / name. It locks the folder for this process.

    Raises StoppedError if the command is interrupted and can be resumed. A folder created here is removed if empty.
    """
    from irtscots_cl.execution.checkpoint import Checkpoints, Interrupted
    from irtscots_cl.system.atomic_files import made_folder

    keeper = Checkpoints(
        folder / name, resume, many, max_seconds, lambda line: print(f"irtscots: {line}", file=sys.stderr)
    )
    try:
        with made_folder(folder), _locked(folder):
            keeper.check_start()
            yield keeper
    except (Interrupted, KeyboardInterrupt) as ended:
        of_trace = isinstance(ended, Interrupted)
        if not keeper.files():
            raise KeyboardInterrupt("" if of_trace else str(ended)) from None
        why = str(ended) if of_trace else "interrupted"
        raise StoppedError(f"{why}; continue with --resume, from {keeper.path}") from None


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock the folder for this process; ValueError if another holds it. The system releases locks of dead processes."""
    try:
        import fcntl
    except ImportError:  # not on Windows
        yield
        return
    path = folder / LOCK
    while True:
        with open(path, "ab") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise ValueError(f"--out = {str(folder)!r}: in use by another process; must be another") from None
            if not _is_at(file.fileno(), path):  # the previous owner has just removed it
                continue
            try:
                with interruption.before_the_end(path.unlink):
                    yield
            finally:
                path.unlink(missing_ok=True)
            return


def _is_at(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False
