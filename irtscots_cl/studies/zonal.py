"""Error of slope integration alone: each method on exact slopes, for several numbers of sampling points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from irtscots_cl.maths.integration import METHODS, integrate_slopes
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.drawing import curves
from irtscots_cl.studies.traces import SharedTraces
from irtscots_cl.studies.verdicts import StudyResult, VerdictRow, exact, row

TITLE = "Error of integration on exact slopes (section 4)"
POINTS = (31, 63, 125, 250)  # across the aperture, on a regular grid
PAPER_POINTS, PRINTED_NM = 125, 0.17
KEPT = {"piston_tilt": "with power", "piston_tilt_power": "without power"}


def study(traces: SharedTraces) -> StudyResult:
    errors = {(points, *key): value for points in (POINTS[:3] if traces.quick else POINTS)
              for key, value in _errors(points)}  # fmt: skip
    by_method = sorted(errors, key=lambda key: (key[1] == "deviation", METHODS.index(key[2]), key[3]))
    return StudyResult(tuple(_row(*key, errors[key]) for key in by_method), (
        "exact slopes on a regular grid of so many points across the aperture; piston and tilt removed, power kept or "
        "removed; no rays, no seed",
        "expected: the trapezoids' h^2 r^2 / (8 R^3) on a sphere, which is power; measurements do not have it, since "
        "the program integrates the difference from the design's slopes",
        "the paper's 0.17 nm at 125 x 125 points is compared with Southwell's error on the ideal sphere, power removed",
    ), {"zonal.png": _figure(errors)})  # fmt: skip


def _errors(points: int) -> Iterator[tuple[tuple[str, str, str], float]]:
    """(surface, method, terms removed) and the rms error in nm."""
    scene = load_scene("sphere-deviated")
    radius = scene.mirror.diameter_mm / 2
    x, y = np.meshgrid(*2 * [np.linspace(-radius, radius, points)])
    mask = np.hypot(x, y) <= radius
    x, y = np.where(mask, x, 0.0), np.where(mask, y, 0.0)
    design = Surface.of(scene.nominal().mirror)
    deviation, *slopes = Surface.of(scene.mirror).deviation_at(x, y)
    shapes = {"ideal sphere": (design.sag(x, y), design.gradient(x, y)), "deviation": (deviation, slopes)}
    for shape, (height, gradient) in shapes.items():
        for method in METHODS:
            error = integrate_slopes(x, y, *gradient, mask, method) - height
            for terms in KEPT:
                yield (shape, method, terms), 1e6 * rms(remove_terms(x, y, error, mask, terms), mask)


def _row(points: int, shape: str, method: str, terms: str, value: float) -> VerdictRow:
    quantity = f"{shape}, {method}, {points} points, {KEPT[terms]} [nm]"
    trapezoids = shape == "ideal sphere" and method == "southwell"
    if trapezoids and terms == "piston_tilt":
        mirror = load_scene("sphere").mirror
        step, radius = mirror.diameter_mm / (points - 1), mirror.diameter_mm / 2
        expected = 1e6 * step**2 / (8 * mirror.radius_mm**3) * radius**2 / np.sqrt(12)
        return row(quantity, exact(value), expected=expected, allowed=0.1 * expected)
    if trapezoids and points == PAPER_POINTS:
        return row(quantity, exact(value), paper=PRINTED_NM, better="lower")
    return row(quantity, exact(value))


def _figure(errors: dict):
    series = []
    for method, style in zip(METHODS, ("o", "s", "^", "v"), strict=True):
        for shape, line in (("ideal sphere", "-"), ("deviation", "--")):
            found = [(key[0], value) for key, value in errors.items() if key[1:] == (shape, method, "piston_tilt")]
            points, values = np.array(found).T
            series.append((f"{method}, {shape}", points, values, style + line))
    figure = curves(series, "sampling points across the aperture", "height error [nm rms]")
    figure.axes[0].set(xscale="log", yscale="log")
    return figure
