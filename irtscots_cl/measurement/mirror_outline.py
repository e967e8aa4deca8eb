"""The mirror's outline in a picture against the one expected: shift, scale and what is left, with error bars.

The rim is cut into pieces some pixels long; in each the edge is found to a fraction of a pixel (edge_profile). A shift
and a scale of the expected curve are fitted to the pieces, without those that show no edge, or another one.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field

import numpy as np
from skimage.measure import find_contours

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.edge_profile import BLUR, EdgePieces, EdgePixels, fit_edges
from irtscots_cl.measurement.rim_curve import RimCurve

REACH = 3.5  # pixels to each side of the edge, beside the blur
SIDE_PX = 0.75  # of the picture must be there to each side of the edge
PIECES = 96  # of a rim: most
PIECE_PX = 6.0  # length: least
LEAST_PIECES = 6
LEAST_SHARE = 0.3  # of the rim that must be seen
CONTRAST = 0.2  # of the step from dark to bright pixels: pieces with less show no edge
MIXED = 6.0, 0.05  # times the median error, and pixels: pieces with more have something else beside the edge
OUTLIER = 5.0  # standard errors
SAME_EDGE = 0.35  # pixels: pieces that near to the fit are the mirror's, whatever their errors
COARSE = (0.3, 0.15, 0.06, 0.03)  # of the radius: how far from the curve an edge counts, round by round
LEAST_PX = 2.0  # the same, at least
LEAST_RADIUS = 4.0  # pixels: of smaller curves no edge is fitted
KNOWN = 0.9  # share of a piece's pixels that must have a value
NEIGHBOURS = 3  # pieces to each side whose noise is taken for a piece's
SCALES = 0.5, 2.0  # of the expected size: least and most
TRIES = 3  # rounds of the fine fit


class NoOutlineError(ValueError):
    """The picture shows no edge that could be the mirror's. The message is one line."""


@dataclass(frozen=True)
class OutlineFit:
    """Where a picture has an expected curve.

    expected, curve: as expected, and as found (moved and scaled). shift_px: [2] (row, column). scale: 1 for the
    expected size. covariance: [3, 3] of shift row, column in pixels, and scale. residual_px: rms of the pieces from
    the found curve; noise_px: what their noise explains of it. used: pieces [n] that the fit is of; offset_px, error_px
    of theirs from the found curve; place: [n, 2] their middles; height: step of brightness of each. blur_px: of the
    edge. chi_square: over its degrees of freedom; scatter beyond the noise is in the covariance.
    """

    expected: RimCurve = field(repr=False)
    curve: RimCurve = field(repr=False)
    shift_px: FloatArray
    scale: float
    covariance: FloatArray = field(repr=False)
    residual_px: float
    noise_px: float
    chi_square: float
    blur_px: float
    used: BoolArray = field(repr=False)
    offset_px: FloatArray = field(repr=False)
    error_px: FloatArray = field(repr=False)
    height: FloatArray = field(repr=False)
    place: FloatArray = field(repr=False)
    in_picture: BoolArray = field(repr=False)

    @property
    def shift_error_px(self) -> FloatArray:
        """Standard errors [2] of the shift."""
        error: FloatArray = np.sqrt(np.diag(self.covariance)[:2])
        return error

    @property
    def scale_error(self) -> float:
        return float(np.sqrt(self.covariance[2, 2]))

    @property
    def seen(self) -> float:
        """Share of the rim whose edge was found."""
        return float(self.used.mean())

    @property
    def hidden(self) -> BoolArray:
        """Pieces [n] that lie in the picture and show no edge, or one elsewhere."""
        return np.asarray(self.in_picture & ~self.used)


def fit_outline(signal: FloatArray, mask: BoolArray, expected: RimCurve, start: OutlineFit | None = None) -> OutlineFit:
    """The expected curve in a picture.

    signal: [rows, columns], bright on the mirror; NaN where unknown. mask: pixels that are bright. start: a fit of
    another curve of the same mirror, to begin at. Raises NoOutlineError.
    """
    if len(expected.points) < 16 or expected.radius_px < LEAST_RADIUS:
        raise NoOutlineError(
            f"the outline is {2 * expected.radius_px:.3g} pixels wide; must be {2 * LEAST_RADIUS:g} or more"
        )
    if start is not None:
        curve = expected.moved(start.shift_px, start.scale, start.expected.centre)
    else:
        curve = _coarse(signal, mask, expected)
    blur = 0.5 if start is None else start.blur_px
    known = np.isfinite(signal)
    lit, around = signal[mask & known], signal[~mask & known]
    step_of_light = float(np.median(lit)) - (float(np.median(around)) if around.size else 0.0)
    for _ in range(TRIES):
        fit = _fine(signal, expected, curve, blur, step_of_light)
        step = np.abs(fit.curve.points - curve.points).max()
        curve, blur = fit.curve, fit.blur_px
        if step < 0.05:
            break
    if not SCALES[0] < fit.scale < SCALES[1]:
        raise NoOutlineError(f"the bright region has {fit.scale:.2g} times the size of the expected outline")
    return fit


def _coarse(signal: FloatArray, mask: BoolArray, expected: RimCurve) -> RimCurve:
    """The curve moved to the picture's edges, to about a pixel: the better of two starts, robustly refined."""
    if not mask.any():
        raise NoOutlineError("no pixel is bright")
    half = float(np.median(signal[mask])) / 2
    edges = [edge for edge in find_contours(np.where(np.isfinite(signal), signal, 0.0), half) if len(edge) >= 8]
    if not edges:
        raise NoOutlineError("no edge of the bright region lies in the picture")
    places = np.concatenate(edges)
    places = places[:: max(len(places) // 8192, 1)]
    row, column = np.nonzero(mask)
    size = float(np.clip(np.sqrt(len(row) / abs(expected.area)), 0.7, 1.4))
    starts = [expected]
    if not expected.hole:
        middle = np.array([row.mean(), column.mean()])
        starts.append(expected.moved(middle - expected.centre, size, expected.centre))
    found = [_drawn(start, places) for start in starts]
    return max(found, key=lambda curve: _agreement(curve, places))


def _drawn(curve: RimCurve, places: FloatArray) -> RimCurve:
    """Moved and scaled to the edge's places [m, 2], those far from it left out more and more."""
    for part in COARSE:
        for _ in range(4):
            near = max(part * curve.radius_px, LEAST_PX)
            distance, number = curve.nearest(places)
            weight = np.clip(1 - (distance / near) ** 2, 0, None) ** 2
            if np.count_nonzero(weight) < 8:
                return curve
            design = _design(curve, number)
            normal = design.T @ (weight[:, None] * design) + 1e-9 * np.eye(3)
            move: FloatArray = np.asarray(np.linalg.solve(normal, design.T @ (weight * -distance)), float)
            curve = curve.moved(move[:2], float(np.clip(1 + move[2] / curve.radius_px, 0.8, 1.25)), curve.centre)
    return curve


def _agreement(curve: RimCurve, places: FloatArray) -> int:
    """Points of the curve with an edge within a pixel and a half."""
    distance, number = curve.nearest(places)
    return len(np.unique(number[np.abs(distance) < 1.5] * 256 // len(curve.points)))


def _design(curve: RimCurve, number: np.ndarray) -> FloatArray:
    """How far points move outwards [m, 3] for a pixel of shift along rows, columns, and a pixel of the radius."""
    normal = curve.outward[number]
    along = np.sum(normal * (curve.points[number] - curve.centre), -1) / curve.radius_px
    return np.concatenate([normal, along[:, None]], -1)


def _fine(signal: FloatArray, expected: RimCurve, curve: RimCurve, blur: float, step_of_light: float) -> OutlineFit:
    """The pieces of a curve that is near the edge, and the expected curve moved to them."""
    count = int(np.clip(curve.length[-1] / PIECE_PX, LEAST_PIECES, PIECES))
    pieces, in_picture, shared = _pieces(signal, curve, count, blur)
    if not pieces.known.any():
        raise NoOutlineError("no part of the expected rim lies in the picture")
    height = np.where(pieces.known, pieces.height, np.nan)
    clear = pieces.known & (np.nan_to_num(height) > CONTRAST * step_of_light)
    clear &= np.nan_to_num(np.abs(pieces.offset), nan=np.inf) < REACH + pieces.blur
    errors = np.nan_to_num(pieces.error, nan=np.inf)
    clear &= errors < max(MIXED[0] * float(np.median(errors[pieces.known])), MIXED[1])
    design = np.stack([shared @ column for column in _design(curve, np.arange(len(curve.points))).T], -1)
    used, move, covariance, chi_square = _robust(pieces, clear, design)
    if used.sum() < LEAST_PIECES or used.mean() < LEAST_SHARE:
        raise NoOutlineError(
            f"{used.mean():.0%} of the expected rim has an edge in the picture; must be {LEAST_SHARE:.0%} or more"
        )
    left = pieces.offset - design @ move
    # from the curve at hand back to the expected one: scales multiply, and the shift is told at the expected centre
    found = curve.moved(move[:2], 1 + move[2] / curve.radius_px, curve.centre)
    scale = float(np.sqrt(abs(found.area / expected.area)))
    to_units = np.diag([1.0, 1.0, scale / curve.radius_px])
    return OutlineFit(
        expected, found, found.centre - expected.centre, scale, to_units @ covariance @ to_units,
        float(np.sqrt(np.mean(left[used] ** 2))), float(np.sqrt(np.mean(pieces.error[used] ** 2))),
        chi_square, pieces.blur, used, left, pieces.error, height, shared @ curve.points, in_picture,
    )  # fmt: skip


def _robust(
    pieces: EdgePieces, clear: BoolArray, design: FloatArray
) -> tuple[BoolArray, FloatArray, FloatArray, float]:
    """The pieces that agree, the move that fits them, its covariance, and their chi-square over its freedom."""
    if clear.sum() < LEAST_PIECES:
        return clear, np.zeros(3), np.eye(3), 1.0
    offset = np.nan_to_num(pieces.offset)
    # the noise of neighbours together: that of a single piece would give weight to those that are quiet by chance
    noise = np.where(clear, pieces.noise, np.nan)
    near = np.stack([np.roll(noise, k) for k in range(-NEIGHBOURS, NEIGHBOURS + 1)])
    with np.errstate(invalid="ignore", divide="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of pieces without any neighbour
        error = pieces.error * np.sqrt(np.nanmean(near**2, axis=0)) / pieces.noise
    error = np.where(clear, np.maximum(np.nan_to_num(error), 1e-6), np.inf)
    move = np.zeros(3)
    scatter = 1.5
    for _ in range(12):  # Tukey's weights, with a scale that comes down to that of the scatter
        left = offset - design @ move
        weight = np.where(clear, np.clip(1 - (left / (4.7 * scatter)) ** 2, 0, None) ** 2, 0.0)
        move = _solved(design, offset, weight)[0]
        scatter = max(1.4826 * float(np.median(np.abs(offset - design @ move)[clear])), 0.01)
    used = clear
    for _ in range(4):
        left = np.abs(offset - design @ move)
        used = clear & ((left < OUTLIER * np.hypot(error, min(scatter, SAME_EDGE))) | (left < SAME_EDGE))
        if used.sum() < LEAST_PIECES:
            return used, move, np.eye(3), 1.0
        floor = _floor((offset - design @ move)[used], error[used])
        move, covariance = _solved(design, offset, np.where(used, 1 / (error**2 + floor**2), 0.0))
    chi_square = float(np.sum(((offset - design @ move) / error)[used] ** 2) / max(used.sum() - 3, 1))
    return used, move, covariance, chi_square


def _floor(left: FloatArray, error: FloatArray) -> float:
    """Scatter of the pieces beyond their noise, in pixels; 0 where it is within that of chi-square."""
    freedom = max(len(left) - 3, 1)
    beyond = float(np.sum(left**2 - error**2) / freedom)
    doubt = 2 * float(np.mean(error**2)) * np.sqrt(2 / freedom)
    return float(np.sqrt(beyond)) if beyond > 2 * doubt else 0.0


def _solved(design: FloatArray, values: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    normal = design.T @ (weight[:, None] * design)
    inverse: FloatArray = np.asarray(np.linalg.pinv(normal, hermitian=True), float)
    return inverse @ (design.T @ (weight * values)), inverse


def _pieces(signal: FloatArray, curve: RimCurve, count: int, blur: float) -> tuple[EdgePieces, BoolArray, FloatArray]:
    """The edge in pieces of the curve; which of them lie in the picture; shares [pieces, points] of the points."""
    reach = REACH + 2 * min(blur, BLUR[1])
    if curve.radius_px < 2 * reach:
        reach = max(curve.radius_px / 2, 2.0)
    row, column = curve.near(signal.shape, reach)
    distance, number = curve.nearest(np.stack([row, column], -1).astype(float))
    length = curve.length
    piece_of = np.minimum((length[:-1] / length[-1] * count).astype(int), count - 1)
    along = 2 * (length[:-1] / length[-1] * count - piece_of) - 1
    shared = np.zeros((count, len(curve.points)))
    shared[piece_of, np.arange(len(piece_of))] = 1.0
    shared /= np.maximum(shared.sum(1, keepdims=True), 1)
    straight = ~(shared @ curve.corner > 0)
    near = (np.abs(distance) <= reach) & straight[piece_of[number]]
    use = near & np.isfinite(signal[row, column])
    edge = EdgePixels(
        signal[row, column][use], piece_of[number[use]], distance[use], along[number[use]], curve.outward[number[use]]
    )
    # a piece that the picture's border cuts has one side only
    last = np.array(signal.shape) - 1
    ends = np.concatenate([curve.points + curve.outward * SIDE_PX, curve.points - curve.outward * SIDE_PX])
    inside = ((ends >= 0) & (ends <= last)).all(-1).reshape(2, -1).all(0)
    there, wanted = (np.bincount(piece_of[number[pixels]], minlength=count) for pixels in (use, near))
    in_picture = (shared @ inside > 0.99) & straight & (there >= KNOWN * wanted)
    found = fit_edges(edge, count, blur)
    keep = found.known & in_picture
    # a disk blurred by the lens and by the pixels is smaller where it is half as bright
    offset = found.offset + shared @ curve.curvature * (found.blur**2 + 1 / 12) / 2
    offset, error, height, noise = (np.where(keep, v, np.nan) for v in (offset, found.error, found.height, found.noise))
    return EdgePieces(offset, error, height, noise, keep, found.blur), in_picture, shared
