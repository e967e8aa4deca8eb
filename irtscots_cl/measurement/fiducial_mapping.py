"""From marks in a picture to the mapping error: which mark is which, and where the mirror is by them.

The design's camera tells where the marks should be. A shift brings most of them together; a similarity by RANSAC, and
from six marks on a homography, tells those that belong from those that do not. The design's chief rays through the
places found then meet the mirror where the camera believes the marks to be: the mapping error in mm.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from skimage.measure import ransac
from skimage.transform import ProjectiveTransform, SimilarityTransform

from irtscots_cl.imaging.mark_files import LEAST_MARKS, Marks, is_straight
from irtscots_cl.imaging.orientation import CHANGES, combined, stored, upright
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.fiducials import FoundMark, MarkShape, find_marks
from irtscots_cl.optics.chief_rays import ChiefRays

FAR = 0.5  # of the marks' spread: how far all may be shifted
NEAR = 0.1, 2.0  # of the spread, and pixels: how far a mark may be from its place beside the shift
AGREE_PX = 1.0  # beside five standard errors: marks that near to the transform belong
HOMOGRAPHY = 6  # marks from which on it is used
TRIALS = 300
SEED = 1
ROUNDS = 3


class MirroredMarksError(ValueError):
    """The marks fit the table only turned or mirrored. The message is one line."""


@dataclass(frozen=True)
class FiducialMap:
    """Marks of a table in a picture, upright.

    found: [n] the mark in the picture for each of the table, None where it was not found or does not agree.
    strays: places [m, 2] (row, column) of what looks like a mark and is none of the table's. near_mm: by the number of
    a mark that does not agree, how far from its place the nearest that looks like it is. expected_px: [n, 2] by the
    design. error_mm: [n, 2] mapping error along the mirror's x and y: place by the design's camera less that of the
    table, NaN where not found; covariance_mm: [n, 2, 2]. offset_mm [2], turn_rad, scale: of the mirror in the picture
    at its middle, None without enough marks; move_covariance: [4, 4] of offset x, y, scale, turn.
    alike: other orientations that the marks fit as well.
    """

    marks: Marks
    shapes: tuple[MarkShape, ...] = field(repr=False)
    found: tuple[FoundMark | None, ...] = field(repr=False)
    strays: FloatArray = field(repr=False)
    near_mm: dict[int, float]
    expected_px: FloatArray = field(repr=False)
    error_mm: FloatArray = field(repr=False)
    covariance_mm: FloatArray = field(repr=False)
    alike: tuple[str, ...] = ()

    @cached_property
    def matched(self) -> BoolArray:
        """Marks [n] that were found where they belong."""
        return np.array([one is not None for one in self.found])

    @property
    def is_enough(self) -> bool:
        """Whether the marks found tell offset, turn and scale."""
        return int(self.matched.sum()) >= LEAST_MARKS and not is_straight(self.marks.points_mm[self.matched])

    @cached_property
    def _design(self) -> FloatArray:
        """Change of places [matched, 2, 4] with offset x, y, scale and turn."""
        x, y = self.marks.points_mm[self.matched].T
        one, zero = np.ones_like(x), np.zeros_like(x)
        return np.stack([np.stack([one, zero, x, -y], -1), np.stack([zero, one, y, x], -1)], 1)

    @cached_property
    def _fit(self) -> tuple[FloatArray, FloatArray, float]:
        """Offset x, y, scale less 1, turn; their covariance; chi-square over its freedom."""
        design, errors = self._design, self.error_mm[self.matched]
        floor = 0.0
        for _ in range(ROUNDS):
            weight = np.linalg.inv(self.covariance_mm[self.matched] + floor**2 * np.eye(2))
            normal = np.einsum("nki,nkl,nlj->ij", design, weight, design)
            covariance = np.linalg.pinv(normal, hermitian=True)
            move = covariance @ np.einsum("nki,nkl,nl->i", design, weight, errors)
            left = errors - design @ move
            freedom = max(errors.size - 4, 1)
            chi_square = float(np.einsum("nk,nkl,nl->", left, weight, left)) / freedom
            if chi_square <= 1 + 3 * np.sqrt(2 / freedom):
                break
            noise = float(np.mean(np.trace(self.covariance_mm[self.matched], axis1=1, axis2=2))) / 2
            floor = float(np.sqrt(max(float(np.sum(left**2)) / freedom - noise, 0.0)))
        return move, covariance, chi_square

    @property
    def offset_mm(self) -> FloatArray:
        return self._fit[0][:2]

    @property
    def scale(self) -> float:
        return float(np.hypot(1 + self._fit[0][2], self._fit[0][3]))

    @property
    def turn_rad(self) -> float:
        """From x towards y."""
        return float(np.arctan2(self._fit[0][3], 1 + self._fit[0][2]))

    @property
    def move_covariance(self) -> FloatArray:
        return self._fit[1]

    @property
    def left_mm(self) -> FloatArray:
        """Mapping error [n, 2] without offset, scale and turn."""
        left = np.full(self.error_mm.shape, np.nan)
        left[self.matched] = self.error_mm[self.matched] - self._design @ self._fit[0]
        return left

    @property
    def standard_error_mm(self) -> FloatArray:
        """Standard errors [n, 2] of error_mm."""
        with np.errstate(invalid="ignore"):
            error: FloatArray = np.sqrt(np.diagonal(self.covariance_mm, axis1=1, axis2=2))
        return error

    def rms_mm(self, left: bool = False) -> float:
        """rms length of the mapping error over the marks found. left: without offset, scale and turn."""
        values = (self.left_mm if left else self.error_mm)[self.matched]
        return float(np.sqrt(np.mean(np.sum(values**2, -1)))) if len(values) else float("nan")

    def covered(self, shape: tuple[int, int]) -> BoolArray:
        """Pixels [rows, columns] that see a mark, also those of marks that were not found, at their places."""
        covered = np.zeros(shape, bool)
        move = self._fit[0] if self.is_enough else np.zeros(4)
        blurs = [one.blur_px for one in self.found if one is not None]
        usual = float(np.median(blurs)) if blurs else 0.5
        to_px = [np.linalg.inv(one.mm_per_px) for one in self.shapes]
        x, y = self.marks.points_mm.T
        moved = np.stack([move[0] + move[2] * x - move[3] * y, move[1] + move[2] * y + move[3] * x], -1)
        for k, (one, here) in enumerate(zip(self.found, self.shapes, strict=True)):
            middle = one.place_px if one is not None else self.expected_px[k] + to_px[k] @ moved[k]
            more = 2 * (one.blur_px if one is not None else usual) + 0.71  # half of a pixel's diagonal
            half = here.reach_px + more
            low = np.maximum(np.floor(middle - half), 0).astype(int)
            high = np.minimum(np.ceil(middle + half) + 1, shape).astype(int)
            if (low >= high).any():
                continue
            row, column = np.mgrid[low[0] : high[0], low[1] : high[1]]
            touched = here.depth_px(row - middle[0], column - middle[1]) > -more
            covered[row[touched], column[touched]] = True
        return covered


def map_fiducials(signal: FloatArray, mirror: BoolArray, chief: ChiefRays, marks: Marks) -> FiducialMap:
    """The marks of a table in a picture [rows, columns], upright.

    mirror: pixels on the mirror. Raises MirroredMarksError where they fit only turned or mirrored, ValueError for
    marks that the camera cannot see.
    """
    points = marks.points_mm
    expected = np.stack(chief.pixel(points[:, 0], points[:, 1]), -1)
    if not np.isfinite(expected).all():
        raise ValueError(f"{marks.source}: marks that lie behind the camera")
    shapes = tuple(MarkShape(mark, _mm_per_px(chief, at)) for mark, at in zip(marks.marks, expected, strict=True))
    keys = list(dict.fromkeys(shape.key for shape in shapes))
    kinds = np.array([keys.index(shape.key) for shape in shapes])
    seen: list[FoundMark] = []
    looks: list[int] = []
    for k in range(len(keys)):
        middle = [shape for shape, kind in zip(shapes, kinds, strict=True) if kind == k]
        there = find_marks(signal, mirror, middle[len(middle) // 2])
        seen += there
        looks += [k] * len(there)
    places = np.array([one.place_px for one in seen]).reshape(-1, 2)
    look = np.array(looks, int)
    pairs = _matched(expected, kinds, places, look, [one.covariance for one in seen])
    alike = _other_orientations(signal.shape, expected, kinds, places, look, seen, len(pairs), chief, marks.source)
    return _mapping(chief, marks, shapes, kinds, expected, seen, look, pairs, alike)


def _mapping(
    chief: ChiefRays,
    marks: Marks,
    shapes: tuple[MarkShape, ...],
    kinds: IntArray,
    expected: FloatArray,
    seen: list[FoundMark],
    look: IntArray,
    pairs: list[tuple[int, int]],
    alike: tuple[str, ...],
) -> FiducialMap:
    found: list[FoundMark | None] = [None] * len(shapes)
    error, covariance = np.full((len(shapes), 2), np.nan), np.full((len(shapes), 2, 2), np.nan)
    shift = np.zeros(2)
    for k, other in pairs:
        one = seen[other]
        found[k] = one
        error[k] = chief.reverse(*one.place_px[:, None])[0][0, :2] - marks.points_mm[k]
        to_mm = _mm_per_px(chief, one.place_px)
        covariance[k] = to_mm @ one.covariance @ to_mm.T
        shift += (one.place_px - expected[k]) / len(pairs)
    free = [k for k in range(len(seen)) if k not in {other for _, other in pairs}]
    near: dict[int, float] = {}
    for k in [k for k, one in enumerate(found) if one is None]:
        alone = [other for other in free if look[other] == kinds[k]]
        away = [float(np.hypot(*(seen[other].place_px - expected[k] - shift))) for other in alone]
        if away and min(away) < max(3 * shapes[k].reach_px, 8.0):
            near[k] = min(away) * shapes[k].scale
            free.remove(alone[int(np.argmin(away))])
    strays = np.array([seen[k].place_px for k in free]).reshape(-1, 2)
    return FiducialMap(marks, shapes, tuple(found), strays, near, expected, error, covariance, alike)


def _mm_per_px(chief: ChiefRays, place: FloatArray) -> FloatArray:
    """d(x, y) / d(row, column) [2, 2] on the mirror at a place [2]."""
    steps = np.array([[0.5, 0], [-0.5, 0], [0, 0.5], [0, -0.5]]) + place
    points = chief.reverse(steps[:, 0], steps[:, 1])[0][:, :2]
    return np.stack([points[0] - points[1], points[2] - points[3]], -1)


def _matched(
    expected: FloatArray, kinds: IntArray, places: FloatArray, look: IntArray, covariances: list[FloatArray]
) -> list[tuple[int, int]]:
    """Pairs (mark, place) that one transform brings together."""
    if len(places) < 2:
        return []
    spread = float(np.sqrt(np.mean(np.sum((expected - expected.mean(0)) ** 2, -1))))
    near = max(NEAR[0] * spread, NEAR[1])
    shift = _shift(expected, kinds, places, look, FAR * spread, near)
    pairs = _assigned(expected + shift, kinds, places, look, near)
    if len(pairs) < 2:
        return []
    limit = AGREE_PX + 5 * float(np.sqrt(np.median([np.trace(covariances[k]) for _, k in pairs])))
    source, target = expected[[a for a, _ in pairs]], places[[b for _, b in pairs]]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of samples that are no transform
        transform, agree = ransac(
            (source, target), SimilarityTransform, min_samples=2, residual_threshold=limit, max_trials=TRIALS, rng=SEED
        )
    if transform is None or agree is None or agree.sum() < 2:
        return []
    return _assigned(_moved(source[agree], target[agree], expected), kinds, places, look, limit)


def _moved(source: FloatArray, target: FloatArray, expected: FloatArray) -> FloatArray:
    """Where the transform that fits pairs of places brings the expected ones [n, 2]."""
    kind = ProjectiveTransform if len(source) >= HOMOGRAPHY and not is_straight(source) else SimilarityTransform
    transform = kind.from_estimate(source, target)
    moved: FloatArray = transform(expected) if transform else expected
    return moved


def _shift(
    expected: FloatArray, kinds: IntArray, places: FloatArray, look: IntArray, far: float, near: float
) -> FloatArray:
    """The shift that brings most marks near to a place of their look; the least one among equals."""
    trees = {int(k): cKDTree(places[look == k]) for k in np.unique(kinds) if (look == k).any()}
    best: tuple[int, float] = (-1, 0.0)
    chosen = np.zeros(2)
    for a in range(len(expected)):
        for b in np.flatnonzero(look == kinds[a])[:60]:
            shift = places[b] - expected[a]
            if np.hypot(*shift) > far:
                continue
            count, total = 0, 0.0
            for k, tree in trees.items():
                away = tree.query(expected[kinds == k] + shift)[0]
                count, total = count + int((away < near).sum()), total + float(np.minimum(away, near).sum())
            if (count, -total) > best:
                best, chosen = (count, -total), shift
    return chosen


def _assigned(
    expected: FloatArray, kinds: IntArray, places: FloatArray, look: IntArray, near: float
) -> list[tuple[int, int]]:
    """Pairs (mark, place), each of both once, nearer than `near`, the least distances in all."""
    away = np.linalg.norm(expected[:, None] - places, axis=-1)
    away = np.where(kinds[:, None] == look, away, np.inf)
    cost = np.minimum(away, near * 10)
    rows, columns = linear_sum_assignment(cost)
    return [(int(a), int(b)) for a, b in zip(rows, columns, strict=True) if away[a, b] <= near]


def _other_orientations(
    shape: tuple[int, int],
    expected: FloatArray,
    kinds: IntArray,
    places: FloatArray,
    look: IntArray,
    seen: list[FoundMark],
    count: int,
    chief: ChiefRays,
    source: str,
) -> tuple[str, ...]:
    """Changes of the picture in which the marks fit as well. Raises MirroredMarksError where one fits better."""
    as_well, better = [], []
    for word, text in CHANGES.items():
        if not text:
            continue
        new_row, new_column = (stored(grid, word) for grid in _grids(shape, word))
        pixel = np.clip(np.rint(places).astype(int), 0, np.array(shape) - 1)
        part = places - pixel
        turn = np.array([[grid[1, 0] - grid[0, 0], grid[0, 1] - grid[0, 0]] for grid in (new_row, new_column)])
        changed = np.stack([new_row[tuple(pixel.T)], new_column[tuple(pixel.T)]], -1) + part @ turn.T
        fit = len(_matched(expected, kinds, changed, look, [turn @ one.covariance @ turn.T for one in seen]))
        if fit >= LEAST_MARKS and fit > count:
            better.append((fit, word, text))
        elif fit >= LEAST_MARKS and fit == count:
            as_well.append(text)
    if better:
        fit, word, text = max(better)
        now = chief.scene.camera.detector.orientation
        raise MirroredMarksError(
            f"{source}: {fit} marks fit with {text}, {count} as the images are: set camera.detector.orientation = "
            f'"{combined(now, word)}" (now "{now}"), or the marks\' x_mm, y_mm are of the mirror seen from behind'
        )
    return tuple(as_well)


def _grids(shape: tuple[int, int], word: str) -> tuple[FloatArray, FloatArray]:
    """Rows and columns [new rows, new columns] of the picture changed by a word."""
    size = upright(np.empty(shape, np.bool_), word).shape
    row, column = np.indices(size)
    return row.astype(float), column.astype(float)
