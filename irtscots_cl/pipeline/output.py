"""The folder of a run: result.h5, figures, report."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from irtscots_cl.pipeline.simulate import Run
from irtscots_cl.report.result_file import write_result
from irtscots_cl.system import interruption
from irtscots_cl.system.atomic_files import check_output_folder, write_json
from irtscots_cl.system.versions import versions


def write_run(run: Run, folder: Path) -> None:
    """Write report.json, result.h5, report.html and figures/*.png; the folder is made if it is not there.

    report.json comes last: where it is, the others are complete.
    """
    # matplotlib is slow to import: only where figures are made
    from irtscots_cl.report.figures import write_figures
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
        write_result(folder / "result.h5", run.stack, run.result, attributes | version_attributes(), run.bars)
        write_figures(folder / "figures", run.stack, run.result, run.comparison, run.parts)
        write_page(folder / "report.html", report, run.stack, run.result, run.comparison, run.parts, run.bars)
        write_json(folder / "report.json", report)


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
