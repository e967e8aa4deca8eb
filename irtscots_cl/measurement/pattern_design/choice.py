"""The choice of patterns: each set's height error at equal frames, equal light and equal time, and the best one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.pattern_design.bias import gamma_bias_nm
from irtscots_cl.measurement.pattern_design.bound import place_bounds
from irtscots_cl.measurement.pattern_design.camera import DesignCamera, camera_of
from irtscots_cl.measurement.pattern_design.families import families
from irtscots_cl.measurement.pattern_design.fringe_errors import (
    Fringes,
    phase_bounds,
    phase_errors,
    place_errors_mm,
)
from irtscots_cl.measurement.pattern_design.heights import HeightNoise, height_noise
from irtscots_cl.measurement.pattern_design.lines import line_candidates, line_errors
from irtscots_cl.measurement.pattern_design.orders import wrong_orders
from irtscots_cl.measurement.pattern_design.pixels import SeenPixels, seen_pixels
from irtscots_cl.measurement.pattern_design.safe_periods import SAFE, SafePeriods, highest_safe
from irtscots_cl.optics.pixel.light import whole_flux_w
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption
from irtscots_cl.system.option_error import OptionError

FRAMES = 32  # of a whole test
TIE = 0.005  # relative difference of nm below which sets are as good as each other


@dataclass(frozen=True)
class SetError:
    """What is expected of one set of patterns.

    fringes: or None; lines: (width, step) in pixels, or None. frames: of one pass over both axes; used: of the budget,
    in whole passes, 0 where one pass does not fit. nm_frames, nm_light, nm_time: rms height error, piston and tilt
    removed, if every set gets the same number of frames, the same exposure in all, the same time, in passes that need
    not be whole. nm_bound: Cramer-Rao bound of its own frames, at equal frames. nm_rounding: part of nm_frames from
    rounding to counts. ambiguous: share of the pixels whose orders are wrong with more than the limit's probability;
    wrong: of the worst pixel. safe: how many periods may be highest. bias_nm: of the screen's gamma, left in.
    """

    name: str
    fringes: Fringes | None
    lines: tuple[int, int] | None
    frames: int
    used: int
    nm_frames: float
    nm_light: float
    nm_time: float
    nm_bound: float
    nm_rounding: float
    ambiguous: float = 0.0
    wrong: float = 0.0
    safe: SafePeriods | None = None
    bias_nm: float | None = None

    @property
    def recommendable(self) -> bool:
        """Whether it fits the frames, tells the orders, and leaves residuals."""
        shows = self.fringes is None or self.fringes.tells_noise
        return shows and self.used > 0 and np.isfinite(self.nm_frames) and (self.safe is None or self.safe.found)


@dataclass(frozen=True)
class PatternDesign:
    """The sets, best first. bound_frames_nm: of the best patterns for each pixel at equal frames and exposure;
    bound_light_nm: at the same exposure in all, in any number of frames. gamma: of the screen. limit: of ambiguity."""

    scene: Scene
    camera: DesignCamera
    frames: int
    limit: float
    gamma: float
    sets: tuple[SetError, ...]
    bound_frames_nm: float
    bound_light_nm: float
    seen: SeenPixels = field(repr=False)
    heights: HeightNoise = field(repr=False)

    @property
    def best(self) -> SetError | None:
        """The best that can be recommended; None where no set can."""
        return next((one for one in self.sets if one.recommendable), None)

    @property
    def best_fringes(self) -> SetError | None:
        return next((one for one in self.sets if one.recommendable and one.fringes is not None), None)


def design_patterns(
    scene: Scene | Setup, *, frames: int = FRAMES, limit: float = SAFE, camera: DesignCamera | None = None, **given: Any
) -> PatternDesign:
    """The height error of pattern sets for a scene's design, before any image exists. Needs no device.

    frames: of the whole test, 6 at least. limit: of the probability of wrong orders in a pixel. camera: instead of that
    of the scene's tables; given: single numbers of it instead, as of camera_of. Raises ValueError for numbers that are
    not allowed, and where no pixel sees the screen.
    """
    if not 6 <= frames <= 10**6:
        raise OptionError(f"--frames = {frames}: must be from 6 (three steps along x and along y) to 1000000")
    if not 0 < limit < 0.5:
        raise OptionError(f"--ambiguity = {limit:g}: must be above 0 and below 0.5")
    setup = Setup.of(scene).nominal
    seen = seen_pixels(setup)
    table, response = setup.scene.camera.detector.noise, setup.scene.screen.response
    if camera is None:
        camera = camera_of(table, seen.white_share * whole_flux_w(setup.chief_rays), **given)
    gamma = 1.0 if response is None else float(response.gamma)
    first = Fringes("", (0.9, max(0.9, min(seen.most_periods, _precise(seen)))), 4)
    heights = height_noise(setup, seen, _fringe_places(seen, camera, first, frames, gamma))
    judge = _Judge(seen, camera, heights, frames, limit, gamma)
    sets = [judge.of_fringes(kind) for kind in families(frames)]
    sets += [judge.of_lines(*kind) for kind in line_candidates(seen)]
    of_frames, of_light = judge.bounds()
    ranked = sorted(sets, key=_rank)
    if gamma != 1.0:
        ranked = sorted((replace(one, bias_nm=judge.bias(one)) for one in ranked), key=_rank)
    return PatternDesign(setup.scene, camera, frames, limit, gamma, tuple(ranked), of_frames, of_light, seen, heights)


def _rank(one: SetError) -> tuple[bool, int, float, int, int]:
    """Least error first; of equal ones the least bias, then the most steps, which show most of what is wrong."""
    nm = one.nm_frames if np.isfinite(one.nm_frames) else 1e300
    return (
        not np.isfinite(one.nm_frames), round(float(np.log(max(nm, 1e-300))) / TIE), abs(one.bias_nm or 0.0),
        -(one.fringes.steps if one.fringes else 0), one.frames,
    )  # fmt: skip


def _precise(seen: SeenPixels) -> float:
    """Number of periods of which one series tells the places of typical pixels best."""
    typical = np.median(seen.modulation, axis=2).min(0)
    return float(seen.periods[np.argmax(typical * seen.periods)])


def _fringe_places(
    seen: SeenPixels, camera: DesignCamera, fringes: Fringes, frames: float, gamma: float, bound: bool = False
) -> FloatArray:
    """Errors [2, n] of the places as the measurement weighs the series, or their Cramer-Rao bounds."""
    of_phases = phase_bounds if bound else phase_errors
    return np.stack([
        place_errors_mm(seen, k, fringes.periods, of_phases(seen, camera, k, fringes, frames, gamma))
        for k in range(2)
    ])  # fmt: skip


@dataclass(frozen=True)
class _Judge:
    """What all sets are judged by. searched: what it has found."""

    seen: SeenPixels
    camera: DesignCamera
    heights: HeightNoise
    frames: int
    limit: float
    gamma: float
    searched: dict[tuple[str, int, int, int], SafePeriods] = field(default_factory=dict)

    def of_fringes(self, kind: Fringes) -> SetError:
        """The set of this kind with the highest number of periods that is best, of those that are safe."""
        interruption.check()
        used = self.frames // kind.frames * kind.frames
        safe = self._safe(kind, used)
        fringes = replace(kind, periods=safe.best)
        nm, exact = (
            self.heights.nm(_fringe_places(self.seen, camera, fringes, self.frames, self.gamma))
            for camera in (self.camera, self.camera.without_rounding)
        )
        bound = _fringe_places(self.seen, self.camera, fringes, self.frames, self.gamma, bound=True)
        wrong = np.zeros(len(self.seen.bright))
        for k in range(2):
            errors = phase_errors(self.seen, self.camera, k, fringes, used, self.gamma)
            wrong = np.maximum(wrong, wrong_orders(fringes.periods, errors, self.seen.fraction(k)))
        return SetError(
            fringes.name, fringes, None, fringes.frames, used, nm, nm, nm, self.heights.nm(bound),
            _rest(nm, exact), float(np.mean(wrong > self.limit)), float(wrong.max()), safe,
        )  # fmt: skip

    def _safe(self, kind: Fringes, used: int) -> SafePeriods:
        """Searched once for all numbers of steps whose noise is the same: those from four on, of as many frames."""
        key = (kind.family, len(kind.periods), min(kind.steps, 4), used)
        if key not in self.searched:
            self.searched[key] = highest_safe(self.seen, self.camera, kind, used, self.heights, self.limit, self.gamma)
        return self.searched[key]

    def of_lines(self, width: int, step: int) -> SetError:
        interruption.check()
        found = line_errors(self.seen, self.camera, width, step)
        one, bound = self.heights.nm(found.error_mm), self.heights.nm(found.bound_mm)
        exact = self.heights.nm(found.exact_mm)
        passes = found.frames / self.frames
        light, camera = passes * found.longer, self.camera
        time = passes * (found.longer * camera.exposure_s + camera.frame_s) / (camera.exposure_s + camera.frame_s)
        by_frames, by_light, by_time = (float(np.sqrt(part)) for part in (passes, light, time))
        return SetError(
            found.name, None, (width, step), found.frames, self.frames // found.frames * found.frames,
            one * by_frames, one * by_light, one * by_time, bound * by_frames, _rest(one, exact) * by_frames,
        )  # fmt: skip

    def bounds(self) -> tuple[float, float]:
        """Bounds in nm at equal frames and at equal light, with the frames shared by the axes as is best."""
        found = place_bounds(self.seen, self.camera, self.frames / 2)
        frames, light = (
            sum(np.sqrt(self.heights.squares(errors))) / np.sqrt(self.frames)
            for errors in (found.of_frames, found.of_light)
        )
        return float(frames), float(light)

    def bias(self, one: SetError) -> float | None:
        if one.fringes is None:
            return 0.0
        interruption.check()
        return gamma_bias_nm(one.fringes, self.gamma, self.seen, self.heights.reference)


def _rest(whole: float, part: float) -> float:
    """What is left of a root sum square without a part; 0 where both are not finite."""
    return float(np.sqrt(max(whole**2 - part**2, 0.0))) if np.isfinite(whole) else 0.0
