"""budget.h5: the maps of an error budget, with their units."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from irtscots_cl.budget.assess import ErrorBudget
from irtscots_cl.budget.covariance import error_modes
from irtscots_cl.budget.linear import error_parts
from irtscots_cl.budget.sensitivity import NM
from irtscots_cl.formats.hdf5 import write_dataset
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system.atomic_files import replacing

MOST_MODES = 20


def write_budget_file(found: ErrorBudget, path: Path, attributes: dict[str, str]) -> None:
    """Write the maps [rows, columns] of a budget with sources, NaN where the design's pixels see no mirror.

    attributes: of the file. Piston and tilt are removed, but from the ledger, whose maps add up as they are.
    """
    linear, spread, trials = found.linear, found.monte_carlo, found.trials
    assert linear is not None and spread is not None
    design, given = trials.design, trials.budget.sources
    seen, without = design.seen, design.response.without

    with replacing(path) as temporary, h5py.File(temporary, "w") as file:

        def write(name: str, height_mm: FloatArray) -> h5py.Dataset:
            return write_dataset(file, name, seen.on_grid(height_mm * NM), "nm")

        for key, value in attributes.items():
            file.attrs[key] = value
        file.attrs["every_pixel"] = seen.step
        for name, place in (("mirror/x_mm", seen.x_mm), ("mirror/y_mm", seen.y_mm)):
            write_dataset(file, name, np.where(seen.mask, place, np.nan), "mm")
        file["detector/row"], file["detector/column"] = seen.row, seen.column
        for name, one in found.sensitivities.items():
            if name in given:
                maps = without(np.atleast_2d(one.height_mm) * given[name].sigma, "piston_tilt")
                is_random = one.source.kind.is_random
                dataset = write(f"sources/{name}", np.sqrt(np.mean(maps**2, axis=0)) if is_random else maps[0])
                dataset.attrs["kind"] = one.source.kind.value
                dataset.attrs["holds"] = "rms over draws" if is_random else "of one standard deviation, signed"
        write("predicted/mean", linear.constant_mm)
        write("predicted/standard_deviation", linear.deviation_mm)
        parts = error_parts(found.sensitivities, given, trials.joint)
        modes, share = error_modes(design, parts, MOST_MODES)
        write("predicted/modes", modes).attrs["share_of_variance"] = share
        write("trials/mean", spread.mean_mm)
        write("trials/standard_deviation", spread.deviation_mm)
        if found.ledger is not None:
            for row in found.ledger.rows:
                write(f"ledger/{row.name}", row.height_mm).attrs["value"] = row.value
            write("ledger_total", found.ledger.total_mm).attrs["trial"] = found.trial
