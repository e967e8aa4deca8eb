"""Progress of a command on stderr: a bar on a terminal, else a line every ten seconds; nothing with --quiet."""

from __future__ import annotations

import argparse
import sys
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from irtscots_cl.cli.job_file import JobFile

LINE_SECONDS = 10.0  # between two lines
STAGE_SECONDS = 2.0  # of work that cannot say how far it is, before a line tells of it
FIRST_ESTIMATE_SECONDS = 60.0  # a first estimate of the error takes about a second
COST_SHARE = 50  # time between two estimates, in times of one estimate: 2 % cost


def add_quiet(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--quiet", action="store_true", help="no progress on stderr")


class Progress:
    """Call it with (done, total); `with` draws it. unit: of both. estimate(result): text with the estimated error of a
    trace so far. It is called rarely, when `finished` gets the trace of whole replicates. job: is told the same, also
    with quiet."""

    def __init__(
        self,
        doing: str = "tracing",
        quiet: bool = False,
        unit: str = "rays",
        estimate: Callable[[object], str] | None = None,
        job: JobFile | None = None,
    ):
        self._doing, self._quiet, self._unit, self._estimate = doing, quiet, unit, estimate
        self._known, self._bar, self._job = "", None, job
        self._timer: threading.Timer | None = None
        self._began = self._told = self._estimated = time.monotonic()
        self._next_estimate = FIRST_ESTIMATE_SECONDS
        self._first, self._total = 0, 0

    def __enter__(self) -> Progress:
        if self._quiet:
            return self
        from rich import progress
        from rich.console import Console

        console = Console(stderr=True)
        if console.is_terminal:
            columns = (progress.TextColumn("{task.description}"), progress.BarColumn(), progress.TaskProgressColumn(),
                       progress.TextColumn("{task.fields[facts]}"))  # fmt: skip
            self._bar = progress.Progress(*columns, console=console, transient=True)
            self._bar.start()
            self._task = self._bar.add_task(self._doing, total=None, facts="")
        return self

    def __exit__(self, *_) -> None:
        self._end_stage()
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, done: int, total: int) -> None:
        if self._quiet and self._job is None:
            return
        now = time.monotonic()
        if total != self._total or done < self._first:  # another trace
            self._began, self._first, self._total = now, done, total
        if self._job is not None:
            self._job.tell(self._doing, done=done, total=total, unit=self._unit, so_far=self._known,
                           per_second=self._per_second(done, now))  # fmt: skip
        if self._quiet:
            return
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total, facts=self._facts(done, total, now))
        elif now - self._told >= LINE_SECONDS:
            self._told = now
            print(f"{self._doing}: {done / total:.0%}, {self._facts(done, total, now)}", file=sys.stderr, flush=True)

    def stage(self, doing: str) -> None:
        """Tell of other work, until the next call or the end, that cannot say how far it is."""
        if self._job is not None:
            self._job.tell(doing, so_far=self._known)
        if self._quiet:
            return
        self._end_stage()
        if self._bar is not None:
            self._bar.update(self._task, description=doing, completed=0, total=None, facts="")
            return
        self._timer = threading.Timer(STAGE_SECONDS, lambda: print(f"{doing} ...", file=sys.stderr, flush=True))
        self._timer.daemon = True
        self._timer.start()

    def _end_stage(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def finished(self, result: object) -> None:
        """Take the trace so far, of whole replicates; pass it as trace(finished=...)."""
        now = time.monotonic()
        unseen = self._quiet and self._job is None
        if unseen or self._estimate is None or now - self._estimated < self._next_estimate:
            return
        self._known = self._estimate(result)
        self._estimated = time.monotonic()
        self._next_estimate = max(LINE_SECONDS, COST_SHARE * (self._estimated - now))

    def _facts(self, done: int, total: int, now: float) -> str:
        text = facts_text(done, total, self._unit, self._per_second(done, now))
        return f"{text}, {self._known}" if self._known else text

    def _per_second(self, done: int, now: float) -> float | None:
        """None before any was done here."""
        return (done - self._first) / (now - self._began) if done > self._first and now > self._began else None


def facts_text(done: float, total: float, unit: str, per_second: float | None) -> str:
    """How far, how fast and how long still."""
    text = f"{_short(done)} of {_short(total)} {unit}"
    if not per_second:
        return text
    return f"{text}, {_short(per_second)} {unit}/s, {_clock((total - done) / per_second)} left"


def _short(number: float) -> str:
    """Three digits and a suffix."""
    for suffix, size in (("T", 1e12), ("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if number >= size:
            return f"{number / size:.3g}{suffix}"
    return f"{number:.3g}"


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"
