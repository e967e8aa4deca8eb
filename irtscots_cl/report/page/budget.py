"""The page of an error budget: the tornado chart, the maps of its sources and of its ledger, its tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.budget.assess import ErrorBudget
from irtscots_cl.budget.sensitivity import NM
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.report.budget import budget_tables, stray_warnings
from irtscots_cl.report.page.arrays import packed
from irtscots_cl.report.page.drawings import Drawing
from irtscots_cl.report.page.layers import Layer, grid_data
from irtscots_cl.report.page.rendering import rendered
from irtscots_cl.report.page.setup import setup_data
from irtscots_cl.report.page.tornado import Cost, tornado_chart, tornado_table
from irtscots_cl.report.table import Table
from irtscots_cl.system.atomic_files import write_text
from irtscots_cl.system.versions import versions

MOST_LAYERS = 20  # maps of sources, and of rows of the ledger, the largest
LARGEST = 3  # sources that the summary names


def write_budget_page(path: Path, found: ErrorBudget, more_tables: Sequence[Table] = ()) -> None:
    """Write report.html of a budget. more_tables: what else was printed, such as a simulated trial."""
    write_text(path, budget_page(found, more_tables))


def budget_page(found: ErrorBudget, more_tables: Sequence[Table] = ()) -> str:
    """The text of the page. Of a scene without a budget: what all known sources cost at a usual value, without maps."""
    scene, costs = found.trials.design.setup.scene, costs_of(found)
    words = {
        "title": f"{scene.name}: error budget", "summary": summary_of_budget(found, costs), "command": "",
        "cautions": stray_warnings(found.ray_noise), "failed": [], "passed": 0, "pictures": [],
        "drawings": [Drawing("What each source costs", tornado_chart(costs), _caption(found), tornado_table(costs))],
        "tables": [*budget_tables(found), *more_tables],
        "facts": [(f"version of {name}", value) for name, value in versions().items()], "toml": scene.to_toml(),
    }  # fmt: skip
    data = {"maps": _maps(found), "curves": None, "setup": setup_data(scene)}
    return rendered("report", words, data, ("maps.js", "setup.js"))


def costs_of(found: ErrorBudget) -> list[Cost]:
    """What the sources cost, the largest first."""
    kinds = {name: one.source.kind.value for name, one in found.sensitivities.items()}
    if found.linear is None:
        all_ = [
            Cost(name, kinds[name], float(one.left_nm[0] * one.source.usual))
            for name, one in found.sensitivities.items()
        ]
    else:
        squares = sum(float(nm[0]) ** 2 for nm in found.linear.nm.values()) or 1.0
        all_ = [
            Cost(name, kinds[name], float(nm[0]), float(nm[0]) ** 2 / squares) for name, nm in found.linear.nm.items()
        ]
    return sorted(all_, key=lambda cost: -cost.nm)


def summary_of_budget(found: ErrorBudget, costs: Sequence[Cost]) -> str:
    """One sentence: what all sources cost together, and which cost most."""
    largest = ", ".join(f"{cost.source} {cost.text}" for cost in costs[:LARGEST])
    if found.linear is None or found.monte_carlo is None:
        return f"The scene has no error sources of its own; at usual values the largest would be {largest} rms."
    below = found.monte_carlo.percentile_nm(0.95)[0]
    text = (
        f"All {len(costs)} sources together make a height error of {found.linear.total_nm[0]:.3g} nm rms, piston and "
    )
    text += (
        f"tilt removed, below {below:.3g} nm in 95 % of {found.trials.budget.trials} trials; the largest are {largest}."
    )
    return text


def _caption(found: ErrorBudget) -> str:
    if found.linear is None:
        return "Height error of each known source at a usual value, nm rms, piston and tilt removed."
    return (
        "Height error of each source's standard deviation, nm rms, piston and tilt removed; in brackets its square's "
        "share of the sum of all squares. Parameters have one value in a test, constants act in every test alike, "
        "fixed patterns stay, processes are drawn anew."
    )


def _maps(found: ErrorBudget) -> dict[str, Any] | None:
    """The maps as JSON for report.js, None without sources."""
    if found.linear is None:
        return None
    design = found.trials.design
    seen = design.seen
    x, y = (np.where(seen.mask, place, np.nan) for place in (seen.x_mm, seen.y_mm))

    def layer(name: str, height_mm: FloatArray, group: str) -> Layer:
        return Layer(name, "nm", seen.on_grid(height_mm * NM), True, True, group)

    layers = []
    if found.ledger is not None:
        layers.append(layer(f"whole error of trial {found.trial}", found.ledger.total_mm, "ledger"))
    spread = seen.on_grid(found.linear.deviation_mm * NM)
    layers.append(Layer("standard deviation of all sources", "nm", spread))
    for cost in costs_of(found)[:MOST_LAYERS]:
        one = found.sensitivities[cost.source]
        height = np.atleast_2d(one.height_mm)[0] * found.trials.budget.sources[cost.source].sigma
        which = "one draw" if one.source.kind.is_random else "one standard deviation"
        layers.append(layer(f"{cost.source}, {which}", height, "sources"))
    if found.ledger is not None:
        left = design.response.left
        ranked = sorted(found.ledger.rows, key=lambda row: -left(row.height_mm[None])[0, 0])
        layers += [layer(f"ledger: {row.name}", row.height_mm, "ledger") for row in ranked[:MOST_LAYERS]]
    columns, rows = design.setup.scene.camera.detector.pixels
    return grid_data(x, y, seen.mask, layers) | {
        "rows": rows, "columns": columns, "step": seen.step, "first": [int(seen.row[0]), int(seen.column[0])],
        "flags": packed(np.where(seen.mask, 0, 1).astype(np.int32)), "details": [],
    }  # fmt: skip
