"""Fiducials in a picture: marks that look like those of a table, found and placed to a fraction of a pixel.

Candidates are peaks of the correlation with the mark's picture, whatever the brightness around. To each a blurred dot
or cross is fitted, on light that changes evenly; both are symmetric, so that neither blur nor size moves their middle.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.ndimage import binary_erosion
from scipy.optimize import least_squares
from scipy.special import ndtr
from skimage.feature import match_template, peak_local_max

from irtscots_cl.imaging.mark_files import Mark
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.system import interruption

LEAST_PX = 1.2  # width of a mark; smaller ones are seen by a pixel or two
CORRELATION = 0.55  # of a candidate with its picture
AROUND_PX = 2.5  # of the fit's window around the mark
CLEAR_PX = 3  # from the mirror's edge: nearer pixels tell no mark's place
PARTS = 3  # of a pixel, each way
BLUR = 0.3, 4.0  # pixels: at the start, and at most
CERTAIN = 6.0  # standard errors of a mark's contrast
CONTRAST = 0.08  # of the light around
EXPLAINED = 0.5  # least share of the variance in the window that the mark explains
MOST = 400  # candidates of one kind


@dataclass(frozen=True)
class MarkShape:
    """What a mark looks like. mm_per_px: [2, 2], the mirror's x, y for rows, columns."""

    mark: Mark
    mm_per_px: FloatArray = field(repr=False)

    @property
    def key(self) -> tuple[object, ...]:
        """Marks of one key look alike."""
        one = self.mark
        return one.kind, one.size_mm, one.arm_mm if one.kind == "cross" else 0.0, one.turn_deg, one.bright

    @cached_property
    def scale(self) -> float:
        """mm of a pixel."""
        return float(np.sqrt(abs(np.linalg.det(self.mm_per_px))))

    @property
    def reach_px(self) -> float:
        """From its middle to its farthest point."""
        return self.mark.size_mm / 2 / self.scale

    def depth_px(self, row: FloatArray, column: FloatArray) -> FloatArray:
        """Pixels from the mark's edge to places about its middle, above 0 inside."""
        offsets = np.stack([row, column], -1) @ self.mm_per_px.T
        if self.mark.kind == "dot":
            return (self.mark.size_mm / 2 - np.hypot(offsets[..., 0], offsets[..., 1])) / self.scale
        u, v, half, arm = self._along(row, column)
        bars = [np.minimum(half - np.abs(a), arm - np.abs(b)) for a, b in ((u, v), (v, u))]
        depth: FloatArray = np.maximum(*bars)
        return depth

    def _along(self, row: FloatArray, column: FloatArray) -> tuple[FloatArray, FloatArray, float, float]:
        """Places along a cross's arms, half their length, half their width; all in pixels."""
        turn = np.radians(self.mark.turn_deg)
        along = np.stack([row, column], -1) @ self.mm_per_px.T / self.scale
        along = along @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        return along[..., 0], along[..., 1], self.reach_px, self.mark.arm_mm / 2 / self.scale

    def _blurred(self, row: FloatArray, column: FloatArray, blur: float) -> FloatArray:
        """The mark's light at places, blurred: of a cross exactly, of a dot as if its edge were straight."""
        if self.mark.kind == "dot":
            disk: FloatArray = ndtr(self.depth_px(row, column) / blur)
            return disk
        u, v, half, arm = self._along(row, column)

        def bar(place: FloatArray, side: float) -> FloatArray:
            between: FloatArray = ndtr((place + side) / blur) - ndtr((place - side) / blur)
            return between

        return bar(u, half) * bar(v, arm) + bar(u, arm) * bar(v, half) - bar(u, arm) * bar(v, arm)

    def share(self, row: FloatArray, column: FloatArray, blur: float) -> FloatArray:
        """How much of the mark pixels at places about its middle see."""
        steps = (np.arange(PARTS) + 0.5) / PARTS - 0.5
        total = np.zeros(np.shape(row))
        for down in steps:
            for right in steps:
                total += self._blurred(row + down, column + right, blur)
        return total / PARTS**2

    def window(self) -> tuple[FloatArray, FloatArray]:
        """Rows and columns about the middle of the pixels around it."""
        half = int(np.ceil(self.reach_px + AROUND_PX))
        row, column = np.mgrid[-half : half + 1, -half : half + 1].astype(float)
        return row, column


@dataclass(frozen=True)
class FoundMark:
    """place_px: [2] (row, column). covariance: [2, 2] of it. contrast: over the light around. blur_px: of its edge."""

    place_px: FloatArray
    covariance: FloatArray = field(repr=False)
    contrast: float
    blur_px: float


def find_marks(signal: FloatArray, mirror: BoolArray, shape: MarkShape) -> list[FoundMark]:
    """All marks of one look in a picture [rows, columns].

    mirror: pixels on the mirror, the marks among them. Raises ValueError for a mark that is too small to be seen.
    """
    width = shape.mark.size_mm / shape.scale
    if width < LEAST_PX:
        raise ValueError(
            f"mark {shape.mark.name}: size_mm = {shape.mark.size_mm:g}: is {width:.2g} pixels wide in the picture; "
            f"must be {LEAST_PX:g} ({LEAST_PX * shape.scale:.3g} mm) or more"
        )
    values = np.where(mirror & np.isfinite(signal), signal, np.median(signal[mirror & np.isfinite(signal)]))
    template = shape.share(*shape.window(), BLUR[0]) * (1.0 if shape.mark.bright else -1.0)
    if min(values.shape) < template.shape[0]:
        return []
    match = match_template(values, template, pad_input=True, mode="edge")
    match = np.where(mirror, match, -1.0)
    apart = max(int(shape.reach_px), 1)
    peaks = peak_local_max(match, min_distance=apart, threshold_abs=CORRELATION, exclude_border=False, num_peaks=MOST)
    found: list[FoundMark] = []
    clear = binary_erosion(mirror, iterations=CLEAR_PX)  # of the blurred rim, which would draw a mark to it
    for row, column in peaks:
        interruption.check()
        one = _fitted(signal, clear, shape, int(row), int(column))
        if one is not None and all(np.hypot(*(one.place_px - o.place_px)) > shape.reach_px for o in found):
            found.append(one)
    return found


def _fitted(signal: FloatArray, clear: BoolArray, shape: MarkShape, row: int, column: int) -> FoundMark | None:
    """The mark near a pixel, or None where the picture has none there."""
    down, right = shape.window()
    at = np.stack([down + row, right + column]).astype(int)
    inside = ((at >= 0) & (at < np.array(signal.shape)[:, None, None])).all(0)
    at = np.where(inside, at, 0)
    use = inside & clear[at[0], at[1]] & np.isfinite(signal[at[0], at[1]])
    use &= np.hypot(down, right) <= shape.reach_px + AROUND_PX + 0.5
    use &= use[::-1, ::-1]  # a window with one side more would let the other side of a wrong shape move the middle
    at, down, right = at[:, use], down[use], right[use]
    values = signal[at[0], at[1]]
    plain = np.stack([np.ones_like(down), down, right], -1)
    if len(values) < 12:
        return None
    level = np.linalg.lstsq(plain, values, rcond=None)[0]
    alone = values - plain @ level
    light = np.clip(plain @ level / level[0], 0.5, 2.0) if level[0] > 0 else 1.0  # a mark takes away a share of it

    def levels(unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        blur = float(np.clip(np.exp(unknowns[2]), BLUR[0] / 3, BLUR[1]))
        mark = light * shape.share(down - unknowns[0], right - unknowns[1], blur)
        columns = np.concatenate([plain, mark[:, None]], -1)
        return columns, np.linalg.lstsq(columns, values, rcond=None)[0]

    def left(unknowns: FloatArray) -> FloatArray:
        columns, level = levels(unknowns)
        misfit: FloatArray = columns @ level - values
        return misfit

    found = least_squares(left, [0.0, 0.0, np.log(BLUR[0])], x_scale=[0.5, 0.5, 1.0], max_nfev=60)
    columns, level = levels(found.x)
    freedom = max(len(values) - 7, 1)
    variance = 2 * found.cost / freedom
    # the levels were solved for at every step, so that the Jacobian holds what they take up
    covariance = np.linalg.pinv(found.jac.T @ found.jac, hermitian=True) * variance
    height = level[3] * (1.0 if shape.mark.bright else -1.0)
    error = np.sqrt(np.linalg.pinv(columns.T @ columns, hermitian=True)[3, 3] * variance)
    explained = 1 - 2 * found.cost / max(float(alone @ alone), 1e-300)
    around = abs(float(level[0])) + 1e-300
    moved = float(np.hypot(*found.x[:2]))
    if height < CERTAIN * error or height < CONTRAST * around or explained < EXPLAINED:
        return None
    if moved > max(shape.reach_px, 1.5) or not np.isfinite(covariance).all():
        return None
    blur = float(np.clip(np.exp(found.x[2]), BLUR[0] / 3, BLUR[1]))
    return FoundMark(found.x[:2] + np.array([row, column]), covariance[:2, :2], height / around, blur)
