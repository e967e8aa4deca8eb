"""Seconds of a whole forward run at the three ray numbers, here and in the paper (section 4)."""

from __future__ import annotations

import numpy as np

from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.traces import PAPER_RAYS_PER_SECOND, SharedTraces, describe
from irtscots_cl.studies.verdicts import StudyResult, VerdictRow, exact, row

TITLE = "Computing time of the ideal sphere's forward run"


def study(traces: SharedTraces) -> StudyResult:
    rows: list[VerdictRow] = []
    pixels = int(np.prod(load_scene("sphere").screen.pixels))
    cores = traces.device.cl_device.max_compute_units
    for rays in traces.ray_numbers:
        run = traces.full("sphere", rays)
        paper, ours = rays * pixels / PAPER_RAYS_PER_SECOND, run.seconds["trace"]
        rows.append(row(f"{rays:,} rays per screen pixel: tracing [s]", exact(ours), paper=paper, better="lower"))
        rows.append(row(f"{rays:,} rays: times as fast, in all", exact(paper / ours)))
        rows.append(row(f"{rays:,} rays: times as fast, per core", exact(paper / ours / cores)))
        rows.append(row(f"{rays:,} rays: rays per second", exact(run.rays / ours), paper=PAPER_RAYS_PER_SECOND,
                        better="higher"))  # fmt: skip
    return StudyResult(tuple(rows), (
        f"{traces.device.name}, {cores} compute units; one timing, which moves by a tenth from run to run; building "
        "kernels is apart",
        "paper: 5 s for 156,250 rays of one screen pixel, times 441 pixels: 37 minutes, 6 and 61 hours on one core "
        "(in print \"30 min\" and \"2 days\")",
        *(describe(traces.full("sphere", rays)) for rays in traces.ray_numbers),
    ))  # fmt: skip
