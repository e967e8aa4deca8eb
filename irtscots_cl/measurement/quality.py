"""Checks of what the images themselves show, before any height is believed.

Every check has a name, a value, the limit that it is held against with its chance of a false alarm, and a line of text
with what to do. "error": wrong beyond doubt, the measurement is refused. "warning": doubtful, the result may be right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.orientation import combined
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.curve_windows import line_pitch
from irtscots_cl.measurement.light_curves import Flag
from irtscots_cl.measurement.one_scan import ScanEstimate
from irtscots_cl.measurement.orientation import Orientation, best_orientation
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.optics.setup import Setup

OK, WARNING, ERROR = "ok", "warning", "error"
LEVELS = (OK, WARNING, ERROR)

LINE_POSITION = 1e-3  # pitches: a pitch that is wrong by 1 % of a screen of 21 lines costs 190 nm
GAIN = 0.02  # a frame whose brightness differs by more is named
BRIGHT = 0.1  # of the median frame's light, squared: frames with less are not judged
PROFILE = 0.02  # of the peak: largest mean difference of the curves from the modelled profile
PLACE = 0.5  # lines: the light of the whole scan that far from the design's place is named
STRAY_SHARE = 0.01  # of the pixels on the mirror
FEW = 0.9, 0.1  # shares of the pixels on the mirror that are used: below them doubtful, wrong
SIGMAS = 5.0  # 6e-7 for Gaussian noise
SHIFT = 8  # pixels to each side that the mirror's outline is tried at
SHOWN = 2  # orientations that a message lists
FIDUCIAL = "a fiducial would tell, a mark on the mirror off its axes whose x and y are known"
OUTLINE = 0.02  # of the mirror's pixels that must fit better elsewhere


@dataclass(frozen=True)
class Check:
    """One check. value and limit: in the unit that the text names. false_alarm: chance that good images fail it.
    cost_nm: rms of the height that what it names costs, piston and tilt removed; NaN where that is not known."""

    name: str
    level: str
    value: float
    limit: float
    false_alarm: float
    text: str
    cost_nm: float = math.nan


def worst(checks: list[Check]) -> str:
    """The worst level of some checks."""
    return max((check.level for check in checks), key=LEVELS.index, default=OK)


def check_images(stack: ImageStack, setup: Setup, estimates: tuple[ScanEstimate, ScanEstimate]) -> list[Check]:
    """All checks of a stack of images, of one kind after the other.

    setup: of the design. estimates: of both scans by "likelihood".
    """
    checks: list[Check] = []
    for estimate in estimates:
        checks += [_lines(estimate, setup), *_frames(estimate)]
        checks += [_gains(estimate), _profile(estimate), _stray(estimate, setup)]
    checks.append(_saturation(stack, estimates))
    checks.append(_orientation(setup, estimates))
    if checks[-1].level == OK:
        checks += [outline_check(_lit(stack), setup), *(_place(setup, estimate) for estimate in estimates)]
    checks.append(_used(setup, estimates, stack.use))
    return checks


def _lines(estimate: ScanEstimate, setup: Setup) -> Check:
    """Positions in the file against the scene's screen; line_positions.py refuses those that are another line's."""
    axis = estimate.scan.axis
    pitch = LineScan(setup.scene).spacing_mm(axis)
    off = estimate.scan.positions_mm - LineScan(setup.scene).positions_mm(axis)
    value = float(np.abs(off).max()) / pitch
    if value <= LINE_POSITION:
        absent, told = int(np.isnan(estimate.scan.flux_w).all((0, 1)).sum()), ""
        if absent:
            told = (
                f"; {absent} of its {len(off)} were not recorded (if lines are wider than the screen's: [screen.lines])"
            )
        text = f"lines of the {axis} scan are the screen's{told}"
        return Check(f"lines {axis}", OK, value, LINE_POSITION, 0.0, text)
    scale = 1 + float(np.ptp(off)) / max(float(np.ptp(estimate.scan.positions_mm)), 1e-300)
    text = (
        f"lines of the {axis} scan lie up to {value * pitch:.3g} mm from those of the scene's screen (pitch "
        f"{scale:.5g} times the scene's): the images' positions are used; mend the wrong one"
    )
    return Check(f"lines {axis}", WARNING, value, LINE_POSITION, 0.0, text)


def _frames(estimate: ScanEstimate) -> list[Check]:
    shows, axis = estimate.frames.shows, estimate.scan.axis
    wrong = np.flatnonzero(shows != np.arange(len(shows)))
    if not wrong.size:
        return [Check(f"frames {axis}", OK, 0.0, 0.0, 1e-9, "every frame shows its own line")]
    several = len(wrong) > len(shows) / 4
    words = {-1: "shows no light", -2: "shows light where none can be"}
    told = "; ".join(
        f"frame {k} {words.get(int(shows[k]), f'shows line {shows[k]}, not {k}')}" for k in wrong[:8]
    )  # fmt: skip
    more = f"; and {len(wrong) - 8} more" if len(wrong) > 8 else ""
    done = "" if several else "; left out"
    text = f"{axis} scan (frames count from 0): {told}{more}{done}"
    return [Check(f"frames {axis}", ERROR if several else WARNING, float(len(wrong)), 0.0, 1e-9, text)]


def _gains(estimate: ScanEstimate) -> Check:
    axis = estimate.scan.axis
    lit = np.isfinite(estimate.frames.ratio) & (estimate.frames.shows == np.arange(len(estimate.gain)))
    # gains of frames that light only the tails of a few curves are less certain than the limit
    lit &= estimate.frames.light > BRIGHT * (np.median(estimate.frames.light[lit]) if lit.any() else 0.0)
    gain = estimate.gain / (np.median(estimate.gain[lit]) if lit.any() else 1.0)
    off = np.where(lit, np.abs(gain - 1), 0.0)
    largest = float(off.max(initial=0.0))
    if largest <= GAIN:
        return Check(f"gains {axis}", OK, largest, GAIN, 1e-4, f"frames of the {axis} scan are equally bright")
    worst_frames = [int(k) for k in np.argsort(-off)[:3] if off[k] > GAIN]
    told = ", ".join(f"frame {k} {gain[k]:.3g} times" for k in worst_frames)
    text = (
        f"{axis} scan: {told} as bright as the others; corrected, from all pixels together: the exposure or the screen "
        "varied"
    )
    return Check(f"gains {axis}", WARNING, largest, GAIN, 1e-4, text)


def _profile(estimate: ScanEstimate) -> Check:
    """Mean residual of all curves by distance from their centroid: noise averages away, a wrong profile stays."""
    value, axis = estimate.profile_error, estimate.scan.axis
    if not value > PROFILE:
        text = f"light curves of the {axis} scan have the modelled profile"
        return Check(f"profile {axis}", OK, float(np.nan_to_num(value)), PROFILE, 1e-6, text)
    text = (
        f"light curves of the {axis} scan differ by {value:.1%} of their peak from the modelled profile: is the "
        "camera's response linear (no gamma), the aperture's diameter right, the camera in focus, the lines as wide "
        "as the scene says?"
    )
    return Check(f"profile {axis}", WARNING, value, PROFILE, 1e-6, text)


def _stray(estimate: ScanEstimate, setup: Setup) -> Check:
    on_mirror = setup.chief_rays.footprint.coverage.ravel()[estimate.scan.pixels] >= 0.5
    share = float((estimate.flags[on_mirror] == Flag.STRAY).mean()) if on_mirror.any() else 0.0
    axis = estimate.scan.axis
    if share <= STRAY_SHARE:
        return Check(f"stray {axis}", OK, share, STRAY_SHARE, 1e-6, f"no second light in the {axis} scan")
    text = f"{share:.1%} of the pixels of the {axis} scan see a second light, of a reflection or an object; not used"
    return Check(f"stray {axis}", WARNING, share, STRAY_SHARE, 1e-6, text)


def _saturation(stack: ImageStack, estimates: tuple[ScanEstimate, ScanEstimate]) -> Check:
    full, ceiling = 0, np.inf
    for scan, estimate in zip((stack.x, stack.y), estimates, strict=True):
        ceiling = min(ceiling, scan.saturation_w)
        if np.isfinite(scan.saturation_w):
            full += int(np.count_nonzero(estimate.scan.flux_w >= scan.saturation_w))
    if not full:
        return Check("saturation", OK, 0.0, 0.0, 1e-6, "no sample is saturated")
    text = f"{full} samples are at {ceiling:.10g}, the highest value: saturated and left out; expose less"
    return Check("saturation", WARNING, float(full), 0.0, 1e-6, text)


def _maps(setup: Setup, estimates: tuple[ScanEstimate, ScanEstimate]) -> list[FloatArray]:
    """Measured centroids x, y [rows, columns]; NaN where a curve is not good."""
    maps = []
    for estimate in estimates:
        on_grid = np.full(setup.chief_rays.shape, np.nan)
        good = (estimate.flags == Flag.GOOD) | (estimate.flags == Flag.CLIPPED)
        on_grid.ravel()[estimate.scan.pixels] = np.where(good, estimate.centroid_mm[0], np.nan)
        maps.append(on_grid)
    return maps


def _orientation(setup: Setup, estimates: tuple[ScanEstimate, ScanEstimate]) -> Check:
    centres = [float(np.mean(estimate.scan.positions_mm[[0, -1]])) for estimate in estimates]
    return orientation_check(setup, _maps(setup, estimates), centres)


def orientation_check(setup: Setup, maps: list[FloatArray], centres: list[float]) -> Check:
    """Whether the places u, v [rows, columns] in mm fit the design as they are. centres: about which a scan turns."""
    found: Orientation = best_orientation(maps, design_points(setup)[2:], centres)
    if not found.is_wrong:
        text = "orientation of the images and directions of the scans fit the design"
        if found.alike and not found.names:
            text += f"; the set-up is symmetric, they would also with {_some(found.alike)}: {FIDUCIAL}"
        return Check("orientation", OK, found.misfit, found.best_misfit, 1e-6, text)
    now = setup.scene.camera.detector.orientation
    remedies = [_remedy(now, *both) for both in zip(found.names, found.images, strict=True)]
    text = (
        f"centroids fit the design {found.misfit / max(found.best_misfit, 1e-12):.3g} times better with "
        f"{' or '.join(found.names)}: must be as the scene says, seen from behind the camera; {' or '.join(remedies)}"
    )
    if len(found.names) + len(found.alike) > 1:
        also = f", nor from {_some(found.alike)}" if found.alike else ""
        text += f"; a symmetric set-up does not tell these apart{also}: {FIDUCIAL}"
    return Check("orientation", ERROR, found.misfit, found.best_misfit, 1e-6, text)


def _remedy(now: str, name: str, image: str) -> str:
    """What to set or to mend, if the images need the change `image` of those in `name`. now: the scene's word."""
    key = f'camera.detector.orientation = "{combined(now, image)}" (now "{now}")'
    if image == "upright":
        return f"mend the order of the lines ({name})"
    return f"set {key}" + (" and mend the order of the lines" if " scan" in name else "")


def _some(names: tuple[str, ...]) -> str:
    return " or with ".join(names[:SHOWN]) + (f" ({len(names) - SHOWN} more)" if len(names) > SHOWN else "")


def outline_check(lit: BoolArray, setup: Setup) -> Check:
    """The lit pixels [rows, columns] against the mirror's outline of the design, shifted by whole pixels."""
    mirror = setup.chief_rays.footprint.coverage >= 0.5
    if not (lit & mirror).any():
        return Check("outline", OK, 0.0, 0.0, 1e-6, "no outline is visible")
    least = np.count_nonzero(lit & ~mirror), (0, 0)
    here = least[0]
    for row in range(-SHIFT, SHIFT + 1):
        for column in range(-SHIFT, SHIFT + 1):
            outside = np.count_nonzero(lit & ~_moved(mirror, row, column))
            if (outside, row * row + column * column) < (least[0], least[1][0] ** 2 + least[1][1] ** 2):
                least = outside, (row, column)
    gain = (here - least[0]) / np.count_nonzero(mirror)
    limit = max(OUTLINE, 3 / np.sqrt(np.count_nonzero(mirror)) / 10)
    if gain <= limit:
        return Check("outline", OK, float(gain), limit, 1e-6, "the mirror's outline lies where the design has it")
    row, column = least[1]
    text = (
        f"the mirror's image lies {row:+d} rows and {column:+d} columns from its place in the design: the camera's "
        "position or direction, or a region of interest, differs from the scene's"
    )
    return Check("outline", ERROR, float(np.hypot(row, column)), 0.5, 1e-6, text)


def _moved(mask: np.ndarray, rows: int, columns: int) -> np.ndarray:
    moved = np.zeros_like(mask)
    height, width = mask.shape
    target = moved[max(rows, 0) : height + min(rows, 0), max(columns, 0) : width + min(columns, 0)]
    target[...] = mask[max(-rows, 0) : height - max(rows, 0), max(-columns, 0) : width - max(columns, 0)]
    return moved


def _lit(stack: ImageStack) -> np.ndarray:
    """Pixels [rows, columns] with at least half of the typical light in both scans."""
    both = np.ones(stack.x.shape, bool)
    for scan in (stack.x, stack.y):
        curves = scan.mean_w() if len(scan.weights) > 1 else scan.flux_w[0]
        height = np.zeros(both.size)
        with np.errstate(invalid="ignore"):
            height[scan.pixels] = np.nan_to_num(curves.max(1) - np.median(curves, axis=1))
        both &= (height > 0.5 * np.quantile(height, 0.9)).reshape(both.shape)
    return both


def _place(setup: Setup, estimate: ScanEstimate) -> Check:
    axis = estimate.scan.axis
    design = design_points(setup)[2 + "xy".index(axis)].ravel()[estimate.scan.pixels]
    good = estimate.flags == Flag.GOOD
    lines = (estimate.centroid_mm[0] - design)[good] / line_pitch(estimate.scan)
    if not np.isfinite(lines).any():
        return Check(f"place {axis}", OK, 0.0, PLACE, 1e-6, "no light curves")
    middle = float(np.nanmedian(lines))
    if abs(middle) <= PLACE:
        text = f"the light of the {axis} scan lies at the design's place"
        return Check(f"place {axis}", OK, middle, PLACE, 1e-6, text)
    text = (
        f"the light of the whole {axis} scan lies {middle:+.2f} lines ({middle * line_pitch(estimate.scan):+.3f} mm) "
        "from the design's place: a scan that starts lines late, line positions counted from another point, or a "
        "tilted mirror"
    )
    return Check(f"place {axis}", WARNING, middle, PLACE, 1e-6, text)


def _used(setup: Setup, estimates: tuple[ScanEstimate, ScanEstimate], use: BoolArray | None) -> Check:
    on_mirror = setup.chief_rays.footprint.coverage >= 0.5
    if use is not None:
        on_mirror = on_mirror & use
    flags = np.zeros(on_mirror.shape, np.int64)
    for estimate in estimates:
        of_scan = np.full(flags.size, Flag.EMPTY)
        of_scan[estimate.scan.pixels] = estimate.flags
        flags = np.maximum(flags, of_scan.reshape(flags.shape))
    counts = np.bincount(flags[on_mirror], minlength=len(Flag))
    share = float(counts[Flag.GOOD] / max(int(counts.sum()), 1))
    if share >= FEW[0]:
        text = f"{share:.1%} of the mirror's pixels have usable light curves"
        return Check("pixels", OK, share, FEW[0], 1e-6, text)
    level = ERROR if share < FEW[1] else WARNING
    limit = FEW[LEVELS.index(level) - 1]
    reasons = ", ".join(f"{counts[flag]} {flag.name.lower()}" for flag in list(Flag)[1:] if counts[flag])
    text = f"only {share:.1%} of the mirror's pixels have usable light curves ({reasons}); " + (
        "too few to be measured" if level == ERROR else "the height map is of these alone"
    )
    return Check("pixels", level, share, limit, 1e-6, text)
