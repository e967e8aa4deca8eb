"""The folder of a run: result.h5, figures, report."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TypeVar

from irtscots_cl.pipeline.simulate import Run
from irtscots_cl.report.result_file import write_result
from irtscots_cl.report.seconds import with_parts
from irtscots_cl.system import interruption
from irtscots_cl.system.atomic_files import check_output_folder, draw_or_delete, write_json
from irtscots_cl.system.versions import versions

T = TypeVar("T")
# Of a run, and of a measurement.
FIGURES = ("images.png", "light_curve.png", "slopes.png", "height.png", "error_parts.png", "quality.png", "screen.png")


def write_run(
    run: Run,
    folder: Path,
    started: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
    draw: bool = True,
) -> None:
    """Write report.json, result.h5, report.html and figures/*.png; the folder is made if it is not there.

    report.json comes last: where it is, the others are complete. The seconds of the report get those of the files.
    started: seconds of the command before the simulation. progress(done, total): of result.h5, with numbers of light
    curves. draw: false for no figures; an earlier run's are deleted.
    """
    from irtscots_cl.report.page.page import write_page

    report, toml = run.report, run.transport.scene.to_toml()
    attributes = {
        "scene": toml,
        "seed": str(report["seed"]),
        "device": report["device"]["name"],
        "driver": report["device"]["driver"],
        "estimator": report["estimator"],
        "sampler": report["sampler"],
        "precision": report["precision"],
        "measure": report["measure"],
        "ledger": json.dumps(report["ledger"]),
    }
    with open_output_folder(folder):
        began = time.perf_counter()
        attributes |= version_attributes()
        write_result(folder / "result.h5", run.stack, run.result, attributes, run.bars, progress)
        stored = time.perf_counter()
        draw_figures(folder, draw, partial(_draw, run))
        drawn = time.perf_counter()
        report["seconds"] = with_parts(report["seconds"], start=started, store=stored - began, figures=drawn - stored)
        write_page(folder / "report.html", report, run.stack, run.result, run.comparison, run.parts, run.bars)
        written = report["seconds"].get("report", 0.0) + time.perf_counter() - drawn
        report["seconds"] = with_parts(report["seconds"], report=written)
        write_json(folder / "report.json", report)


def draw_figures(folder: Path, wanted: bool, draw: Callable[[Path], T]) -> T | None:
    """draw(figures' folder) in an output folder; where none are wanted, an earlier command's FIGURES are deleted."""
    return draw_or_delete(folder / "figures", FIGURES, wanted, draw)


def _draw(run: Run, folder: Path) -> None:
    from irtscots_cl.report.figures import write_figures  # matplotlib is slow to import: only where figures are made

    write_figures(folder, run.stack, run.result, run.comparison, run.parts)


@contextmanager
def open_output_folder(folder: Path) -> Iterator[None]:
    """Make the folder, without the report.json of an earlier run: that would vouch for files about to be replaced."""
    interruption.check()
    check_output_folder(folder)
    with told_as_incomplete(folder):
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        (folder / "report.json").unlink(missing_ok=True)
        yield


@contextmanager
def told_as_incomplete(folder: Path) -> Iterator[None]:
    """Files are written into the folder: an interruption's message says that some are missing."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{folder}: not all files were written") from None


def version_attributes() -> dict[str, str]:
    return {f"version {name}": value for name, value in versions().items()}
