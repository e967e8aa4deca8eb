"""Height error against the highest number of periods, for each family of fringe sets."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.pattern_design.choice import PatternDesign
from irtscots_cl.measurement.pattern_design.families import LOWEST, periods_of
from irtscots_cl.measurement.pattern_design.safe_periods import tried

POINTS = 40


@dataclass(frozen=True)
class ErrorCurve:
    """highest: [k] numbers of periods; nm: [k] at equal frames; safe: [k] whether such a set is."""

    name: str
    highest: FloatArray = field(repr=False)
    nm: FloatArray = field(repr=False)
    safe: BoolArray = field(repr=False)


def error_curve(found: PatternDesign) -> list[ErrorCurve]:
    """Of the best set of each family and number of series from two on, for its own steps."""
    curves, done = [], set()
    for one in found.sets:
        if one.fringes is None or len(one.fringes.periods) < 2 or not one.fringes.tells_noise:
            continue
        kind = (one.fringes.family, len(one.fringes.periods))
        if kind in done or found.seen.most_periods <= 1.5 * LOWEST:
            continue
        done.add(kind)
        highest = np.geomspace(1.5 * LOWEST, found.seen.most_periods, POINTS)
        sets = [replace(one.fringes, periods=periods_of(*kind, float(top))) for top in highest]
        all_tried = [
            tried(found.seen, found.camera, fringes, found.frames, found.heights, found.limit, found.gamma)
            for fringes in sets
        ]
        nm = np.array([t.nm for t in all_tried])
        curves.append(ErrorCurve(f"{kind[1]} series, {kind[0]}", highest, nm, np.array([not t.bad for t in all_tried])))
    return curves
