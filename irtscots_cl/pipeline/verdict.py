"""A measured map judged by the budget of its test: figures with intervals that hold the truth, and requirements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from irtscots_cl.budget.assess import own_sensitivities
from irtscots_cl.budget.intervals import ErrorSamples
from irtscots_cl.budget.measured_design import NOLLS, MeasuredDesign
from irtscots_cl.budget.trials import LEAST_SHARE, Trials
from irtscots_cl.budget.verdict import LEFT_OUT, WAVELENGTH_NM, Verdict, judge, requirements
from irtscots_cl.calibration.seen_pixels import FEWEST
from irtscots_cl.formats.height_map import SURFACE, HeightMap
from irtscots_cl.formats.maps import open_map
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.optics.height_map import placed_map
from irtscots_cl.optics.map_edges import Aperture
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.height_map import HeldMap, MirrorMap
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError

MOST_FITTED = 10**5  # nodes, of a map's low orders
FARTHEST = 1.5  # mirror's radii from its middle: a square about the mirror reaches 1.41


def judge_map(
    scene: Scene | Setup, budget: Budget, path: Path, require: str = "", wavelength_nm: float = WAVELENGTH_NM
) -> Verdict:
    """Judge the map in a file, a deviation from the design, by the budget of the scene's test.

    require: an indication as of `requirements`; "" for none. Raises ValueError or SceneError, with one line, for a
    file that is no map of this mirror, an indication that is none, or a budget without sources.
    """
    limits = requirements(require, wavelength_nm) if require else {}
    if not budget.sources and budget.calibrated is None:
        raise ValueError("--result: must have a scene with error sources: give them in [budget.sources]")
    setup = Setup.of(scene)
    read = _read(path)
    design = MeasuredDesign.of_budget(setup, budget)
    trials = Trials.of(design, budget)
    heights = heights_at_pixels(read, design, path)
    used = np.isfinite(heights)
    if used.sum() < max(FEWEST, LEAST_SHARE * design.count):
        raise ValueError(
            f"{path}: has heights at {used.sum()} of the {design.count} points of the mirror that the design's pixels "
            f"see; must be at least {max(FEWEST, int(np.ceil(LEAST_SHARE * design.count)))}"
        )
    errors = {
        name: replace(one, height_mm=trials.procedure.fitted(one.height_mm, used))
        for name, one in own_sensitivities(trials).items()
    }
    samples = ErrorSamples(design, errors, trials.budget.sources, used, trials.joint)
    own = trials.procedure.fitted(np.where(used, heights, 0.0), used)[used]
    rms = {name: samples.rms(own, nolls) for name, nolls in LEFT_OUT.items()}
    judged = tuple(judge(samples, own, limits))
    warnings = (*read.warnings, *_beyond(read, setup.scene.mirror.diameter_mm / 2))
    return Verdict(trials, str(path), wavelength_nm, used, samples.zernikes(own), rms, judged, warnings)


def _read(path: Path) -> HeightMap:
    """The surface in a file. Raises ValueError for what cannot be read as it is."""
    try:
        return open_map(path).as_kind(SURFACE)
    except ValueError as error:
        asks = ": give --" in str(error)  # an option of the commands that read any file
        raise ValueError(f"{error}; to `irtscots convert` first" if asks else str(error)) from None


def _beyond(read: HeightMap, radius_mm: float) -> list[str]:
    """A warning about a map that is too large for the mirror."""
    x, y = read.positions_mm()
    reach = float(np.hypot(x, y)[read.valid].max())
    if reach <= FARTHEST * radius_mm:
        return []
    return [f"has heights {reach:.4g} mm from the middle of a mirror of {radius_mm:g} mm radius: is it this mirror's?"]


def heights_at_pixels(read: HeightMap, design: MeasuredDesign, path: Path) -> FloatArray:
    """Heights [n] in mm of a map at the design's mirror points, by a cubic spline; NaN next to where it has none.

    Raises ValueError for a map of unknown lateral scale or beside the mirror.
    """
    if read.pitch_mm is None:
        raise ValueError(f"{path}: tells no lateral scale: write it with `irtscots convert --pitch-mm` first")
    mirror, seen = design.setup.scene.mirror, design.seen
    smooth, rest = _split(read, mirror.diameter_mm / 2)
    table = MirrorMap(heights=HeldMap(rest), outside="nearest")  # what is made up is not used
    try:
        placed = placed_map(table, rest, 0, Aperture(mirror.diameter_mm / 2, mirror.obscuration_mm / 2, mirror.outline))
    except SceneError as error:
        raise ValueError(f"{path}: {str(error).partition(': ')[2]}") from None
    x, y = seen.x_mm[seen.mask], seen.y_mm[seen.mask]
    return np.where(_inside(read, x, y), placed.at(x, y)[0] + smooth(x, y), np.nan)


def _split(read: HeightMap, radius_mm: float) -> tuple[Callable[[FloatArray, FloatArray], FloatArray], HeightMap]:
    """A map as low orders and the rest, so that the spline has no kink where heights end."""
    row, column = np.nonzero(read.valid)
    middle = (np.array(read.valid.shape) - 1) / 2
    assert read.pitch_mm is not None

    def basis(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.stack([zernike(noll, x / radius_mm, y / radius_mm) for noll in NOLLS], -1)

    def of_nodes(row: IntArray, column: IntArray) -> FloatArray:
        (pitch_x, pitch_y), (x, y) = read.pitch_mm, read.centre_mm  # type: ignore[misc]
        return basis(x + (column - middle[1]) * pitch_x, y + (row - middle[0]) * pitch_y)

    some = slice(None, None, -(-len(row) // MOST_FITTED))
    heights = read.heights_mm[row[some], column[some]]
    coefficients = np.linalg.lstsq(of_nodes(row[some], column[some]), heights)[0]
    rest = read.heights_mm.copy()
    for first in range(0, len(row), MOST_FITTED):
        part = slice(first, first + MOST_FITTED)
        rest[row[part], column[part]] -= of_nodes(row[part], column[part]) @ coefficients
    return lambda x, y: basis(x, y) @ coefficients, replace(read, heights_mm=rest)


def _inside(read: HeightMap, x: FloatArray, y: FloatArray) -> BoolArray:
    """Whether the four nodes around points (x, y) [n] all have a height."""
    valid = read.valid
    assert read.pitch_mm is not None
    first = []
    found = np.ones(x.shape, bool)
    for place, centre, pitch, count in zip((x, y), read.centre_mm, read.pitch_mm, valid.shape[::-1], strict=True):
        node = np.floor((place - centre) / pitch + (count - 1) / 2 + 1e-9).astype(int)
        found &= (node >= 0) & (node < count)
        first.append((np.clip(node, 0, count - 1), np.clip(node + 1, 0, count - 1)))
    for column in first[0]:
        for row in first[1]:
            found &= valid[row, column]
    return found
