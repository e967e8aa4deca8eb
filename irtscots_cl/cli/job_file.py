"""What a running command tells in its output folder, for `irtscots watch`: progress.json, and the map so far."""

from __future__ import annotations

import json
import os
import platform
import shlex
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from irtscots_cl.system import interruption

FILE, MAP_FILE = "progress.json", "progress-map.json"
SECONDS = 2.0  # between two writes
SILENT_SECONDS = 120.0  # after which a process of another machine is taken for dead
STATES = {
    "running": "running",
    "died": "died: its process is gone, without a word",
    "silent": f"on another machine, and has said nothing for {SILENT_SECONDS:g} s",
    "finished": "finished: report.html has the results",
    "stopped": "stopped; the same command with --resume goes on",
}


class JobFile:
    """The files of one command. arguments: of the command line."""

    def __init__(self, folder: Path, arguments: Sequence[str]):
        self._folder, self._told, self._doing, self._so_far = folder, -SECONDS, "", ""
        self._about = {"command": shlex.join(["irtscots", *map(str, arguments)]), "process": os.getpid(),
                       "machine": platform.node(), "began": time.time()}  # fmt: skip

    def tell(self, doing: str, so_far: str = "", **facts: Any) -> None:
        """Write what is done now: at once if it is something else than before, else every SECONDS.

        so_far: the error in words; later work keeps it.
        """
        now, self._so_far = time.monotonic(), so_far or self._so_far
        if interruption.requested() or (doing == self._doing and now - self._told < SECONDS):
            return  # after a signal no file is begun
        self._doing, self._told = doing, now
        from irtscots_cl.system.atomic_files import write_json

        facts |= {"updated": time.time(), "doing": doing, "so_far": self._so_far}
        write_json(self._folder / FILE, self._about | facts)

    def show(self, grid: dict[str, Any]) -> None:
        """Write the maps so far, as report.page.layers.grid_data has them."""
        if interruption.requested():
            return
        from irtscots_cl.system.atomic_files import write_json

        write_json(self._folder / MAP_FILE, grid)


@contextmanager
def told_in(folder: Path, arguments: Sequence[str]) -> Iterator[JobFile]:
    """The JobFile of a command, whose files go when it ends, however it ends."""
    try:
        yield JobFile(folder, arguments)
    finally:
        for name in (FILE, MAP_FILE):
            (folder / name).unlink(missing_ok=True)


@dataclass(frozen=True)
class Job:
    """What a folder tells of a command. state: a key of STATES. facts: of progress.json. maps: so far, or None."""

    state: str
    facts: dict[str, Any] = field(default_factory=dict)
    maps: dict[str, Any] | None = None


def read_job(folder: Path) -> Job:
    """What runs, or ran, in an output folder. Raises ValueError, one line, where nothing did, or for a damaged file."""
    facts = _read(folder / FILE)
    if facts is None:
        if (folder / "report.json").exists():
            return Job("finished")
        if (folder / "checkpoint").exists():
            return Job("stopped")
        raise ValueError(
            f"{folder}: no {FILE}, checkpoint or report.json; must be the output folder of `irtscots run` at work"
        )
    return Job(_state(facts), facts, _read(folder / MAP_FILE))


def _read(path: Path) -> dict[str, Any] | None:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except ValueError:  # no UTF-8, no JSON
        found = None
    if not isinstance(found, dict):
        raise ValueError(f"{path}: not written by this program")
    return found


def _state(facts: dict[str, Any]) -> str:
    if facts.get("machine") != platform.node() or os.name == "nt":  # there is no asking for a process
        updated = facts.get("updated")
        return "running" if isinstance(updated, float) and time.time() - updated < SILENT_SECONDS else "silent"
    try:
        os.kill(int(facts.get("process", 0)), 0)
    except PermissionError:  # another user's
        return "running"
    except (ProcessLookupError, OverflowError, TypeError, ValueError):
        return "died"
    return "running"
