"""A measured map judged by its test's budget: as data for programs, and as tables."""

from __future__ import annotations

from typing import Any

import numpy as np

from irtscots_cl.budget.intervals import COVERAGE, Interval
from irtscots_cl.budget.verdict import OPEN, Verdict
from irtscots_cl.report.table import Table


def verdict_facts(found: Verdict) -> dict[str, Any]:
    """All of it as plain data."""
    return {
        "scene": found.trials.design.setup.scene.name,
        "map": found.source,
        "pixels": found.trials.design.count,
        "pixels_with_height": int(np.sum(found.used)),
        "coverage": COVERAGE,
        "compensators": list(found.trials.procedure.compensators),
        "corrected": list(found.corrected),
        "wavelength_nm": found.wavelength_nm,
        "zernike_nm": {str(noll): _facts(interval) for noll, interval in found.zernikes.items()},
        "rms_nm": {name: _facts(interval) for name, interval in found.rms.items()},
        "required": [
            {
                "name": one.name, "limit_nm": one.limit_nm, **_facts(one.interval), "verdict": one.verdict,
                "guard_band_nm": one.guard_nm, "missing_nm": one.missing_nm,
            }
            for one in found.judged
        ],
    }  # fmt: skip


def _facts(interval: Interval) -> dict[str, float]:
    return {"estimate_nm": interval.estimate, "low_nm": interval.low, "high_nm": interval.high}


def verdict_tables(found: Verdict) -> list[Table]:
    """Terms, rms values and, where they were asked for, the limits."""
    share = f"{100 * COVERAGE:g} %"
    head = ("", "nm", f"{share} from", "to")
    terms = [(f"Zernike {noll} (Noll)", *_shown(one)) for noll, one in found.zernikes.items() if noll > 1]
    rms = [(name, *_shown(one)) for name, one in found.rms.items()]
    title = (
        f"{found.source}: what the mirror has, of {int(np.sum(found.used))} of {len(found.used)} pixels; RMSt: without "
        "piston, tilt; RMSi: and without power; RMSa: without all that is rotationally symmetric"
    )
    if found.trials.procedure.text:
        title += f"; {found.trials.procedure.text}"
    if found.corrected:
        title += f"; corrected by what these do in every test: {', '.join(found.corrected)}"
    tables = [Table(title, head, [*terms, *rms])]
    if found.judged:
        limits = [
            (one.name, f"{one.limit_nm:.4g}", *_shown(one.interval), one.verdict, f"{one.guard_nm:.3g}",
             f"{one.missing_nm:.3g}" if one.verdict == OPEN else "")
            for one in found.judged
        ]  # fmt: skip
        title = f"Required, in fringes of half of {found.wavelength_nm:g} nm"
        columns = ("", "limit [nm]", "nm", f"{share} from", "to", "", "guard band [nm]", "missing to decide [nm]")
        tables.append(Table(title, columns, limits))
    return tables


def _shown(interval: Interval) -> tuple[str, str, str]:
    return f"{interval.estimate:.4g}", f"{interval.low:.4g}", f"{interval.high:.4g}"
