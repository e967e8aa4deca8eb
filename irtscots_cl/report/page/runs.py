"""The page of `irtscots view`: runs side by side, from their folders: numbers, maps, differences of maps."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from irtscots_cl.formats.result_map import read_pixel_maps
from irtscots_cl.imaging.orientation import upright
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.report.page.layers import Layer, grid_data
from irtscots_cl.report.page.rendering import rendered
from irtscots_cl.scene.instrument import ORIENTATIONS

MOST_RUNS = 8
PLACES = ("mirror/x_mm", "mirror/y_mm", "island_groups")
LAYERS = (  # name, dataset, factor, unit, whether low-order terms may be taken off, whether about zero
    ("deviation from the design", "deviation_nm", 1.0, "nm", True, True),
    ("standard error of the height", "height_standard_error_nm", 1.0, "nm", False, False),
    ("slope x", "slope/x_rad", 1e6, "µrad", False, False),
    ("slope y", "slope/y_rad", 1e6, "µrad", False, False),
)
NUMBERS = (  # of report.json: what it is called, and where it is
    ("scene", "scene"),
    ("estimator", "estimator"),
    ("measure", "measure"),
    ("rays per pixel", "rays_per_pixel"),
    ("seed", "seed"),
    ("pixels used", "pixels_used"),
    ("height error [nm rms], piston and tilt removed", "height_error_nm_rms.piston_tilt"),
    ("± standard error", "height_error_nm_rms_standard_error.piston_tilt"),
    ("slope error x [µrad rms]", "slope_error_urad_rms.x"),
    ("slope error y [µrad rms]", "slope_error_urad_rms.y"),
    ("predicted height error [nm rms]", "predicted.height_error_nm_rms_piston_tilt"),
    ("ray noise (simulation) [nm rms]", "predicted.height_ray_noise_nm_rms"),
    ("deviation [nm rms], piston and tilt removed", "deviation_nm_rms.piston_tilt"),
    ("deviation [nm], peak to valley", "deviation_nm_pv"),
    ("standard error of the height [nm]", "height_standard_error_nm"),
    ("seconds of tracing", "seconds.trace"),
)


@dataclass(frozen=True)
class StoredRun:
    """What a folder of `run` or `reconstruct` holds. maps: {dataset: [rows, columns]}, upright."""

    name: str
    facts: dict[str, Any] = field(repr=False)
    maps: dict[str, FloatArray] = field(repr=False)


def read_run(folder: Path, name: str) -> StoredRun:
    """Read report.json and result.h5 of a folder. Raises ValueError, one line, for what is no complete run."""
    report = folder / "report.json"
    try:
        facts = json.loads(report.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{report}: there is none; must be the folder of a finished run") from None
    except ValueError:  # no UTF-8, no JSON
        facts = None
    if not isinstance(facts, dict):
        raise ValueError(f"{report}: not a report of this program")
    maps, orientation = read_pixel_maps(folder / "result.h5", (*PLACES, *(dataset for _, dataset, *_ in LAYERS)))
    if orientation not in ORIENTATIONS:
        raise ValueError(
            f"{folder / 'result.h5'}: orientation = {orientation!r}: must be a word of the scene's detector"
        )
    return StoredRun(name, facts, {key: upright(values, orientation) for key, values in maps.items()})


def read_runs(folders: Sequence[Path]) -> list[StoredRun]:
    """The runs of folders, each named after its folder, or its path where names are alike."""
    if not 1 <= len(folders) <= MOST_RUNS:
        raise ValueError(f"DIR: {len(folders)} folders; must be 1 to {MOST_RUNS}")
    names = [folder.resolve().name for folder in folders]
    return [
        read_run(folder, name if names.count(name) == 1 else str(folder))
        for folder, name in zip(folders, names, strict=True)
    ]


def comparison_rows(runs: Sequence[StoredRun]) -> list[tuple[str, ...]]:
    """A row for each of NUMBERS that a run has, with a text for each run."""
    rows = []
    for label, place in NUMBERS:
        values = [_at(run.facts, place) for run in runs]
        if any(value is not None for value in values):
            rows.append((label, *map(_text, values)))
    return rows


def _at(facts: Any, place: str) -> Any:
    for key in place.split("."):
        facts = facts.get(key) if isinstance(facts, dict) else None
    return facts


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def comparison_page(runs: Sequence[StoredRun]) -> str:
    """The page's text: one file that needs nothing else."""
    words = {"title": "Runs compared", "names": [run.name for run in runs], "rows": comparison_rows(runs)}
    return rendered("view", words, {"runs": [_data(run) for run in runs]})


def _data(run: StoredRun) -> dict[str, Any]:
    """The maps of a run as JSON for view.js: every `step` rows and columns, as in report.html."""
    x, y, groups = (run.maps[name] for name in PLACES)
    layers = [
        Layer(name, unit, run.maps[dataset] * factor, heights, signed)
        for name, dataset, factor, unit, heights, signed in LAYERS
    ]
    return {"name": run.name} | grid_data(x, y, groups == 1, layers)
