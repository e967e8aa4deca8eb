"""The mirror in a picture against its design: rim and hole, each pixel's share on it, and what is in the way."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import binary_dilation, uniform_filter1d
from skimage.measure import label

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.mirror_outline import LEAST_RADIUS, NoOutlineError, OutlineFit, fit_outline
from irtscots_cl.measurement.quality import OK, WARNING, Check
from irtscots_cl.measurement.rim_curve import POINTS, RimCurve
from irtscots_cl.optics.chief_rays import ChiefRays

if TYPE_CHECKING:
    from irtscots_cl.optics.outline import Outline

SHIFT_PX = 0.3  # from which on a difference between picture and design is named, if it is certain
SIGMAS = 5.0  # 6e-7 for Gaussian noise
SHAPE_PX = 0.3  # rms distance of the edge from the moved rim
HIDDEN = 0.05  # share of the rim without an edge
SPOT = 4, 5e-4  # pixels, and share of the mirror, of a dark or bright spot that is named
CLEAR_PX = 1.5  # from the edge, beside twice the blur, where a pixel is dark or bright for another reason
FALL = 0.6  # of the middle's brightness at a part of the rim, from which on vignetting is named
RIM_PART = 8  # of the rim: over which its brightness is averaged
SOFT_PX = 2.0  # blur of the edge
WHOLE = 1 - 1e-9  # share of a pixel from which on it is wholly on the mirror
SIDES = ("right", "upper right", "top", "upper left", "left", "lower left", "bottom", "lower right")


@dataclass(frozen=True)
class MirrorOutline:
    """The mirror's outline in a picture, upright. hole: of its central hole, None without one, or where its edge was
    not found (why_no_hole). mm_per_px: [2, 2], the mirror's x, y for rows, columns in its middle. coverage: [rows,
    columns] share of each pixel on the mirror, by the outlines found."""

    rim: OutlineFit
    hole: OutlineFit | None
    why_no_hole: str
    mm_per_px: FloatArray = field(repr=False)
    coverage: FloatArray = field(repr=False)

    @property
    def shift_mm(self) -> FloatArray:
        """How far the mirror lies from its place in the design, along its x and y [2]."""
        shift: FloatArray = self.mm_per_px @ self.rim.shift_px
        return shift

    @property
    def shift_error_mm(self) -> FloatArray:
        """Standard errors [2] of shift_mm."""
        spread = self.mm_per_px @ self.rim.covariance[:2, :2] @ self.mm_per_px.T
        error: FloatArray = np.sqrt(np.diag(spread))
        return error

    @property
    def whole(self) -> BoolArray:
        """Pixels [rows, columns] that lie wholly on the mirror."""
        return np.asarray(self.coverage >= WHOLE)

    @property
    def cut(self) -> BoolArray:
        """Pixels [rows, columns] that the edge crosses."""
        return np.asarray((self.coverage > 0) & (self.coverage < WHOLE))


def find_outline(
    signal: FloatArray,
    lit: BoolArray,
    chief: ChiefRays,
    rim: RimCurve | None = None,
    start: MirrorOutline | None = None,
) -> MirrorOutline:
    """The mirror of a design in a picture.

    signal: [rows, columns] upright, bright on the mirror. lit: bright pixels. rim: the expected outline of a mirror
    that is no round disk. start: an outline found before, to begin at. Raises NoOutlineError.
    """
    hole, why = None, ""
    expected, inner = _expected(chief) if rim is None else (rim, None)
    if len(expected.points) < len(expected.outward):
        raise NoOutlineError("the design's rim lies behind the camera")
    found = fit_outline(signal, lit, expected, None if start is None else start.rim)
    if inner is not None:
        try:
            if inner.radius_px < LEAST_RADIUS:
                raise NoOutlineError(f"the hole is {2 * inner.radius_px:.2g} pixels wide")
            hole = fit_outline(signal, lit, inner, None if start is None else start.hole)
        except NoOutlineError as error:
            why = str(error)
            hole = None
    coverage = found.curve.coverage(signal.shape)
    if hole is not None:
        coverage *= hole.curve.coverage(signal.shape)
    return MirrorOutline(found, hole, why, _mm_per_px(chief, found.expected.centre), coverage)


def _expected(chief: ChiefRays) -> tuple[RimCurve, RimCurve | None]:
    """Rim of the design's mirror and its hole's. Raises NoOutlineError for one in several pieces."""
    surface = chief.surface
    if surface.outline is not None:
        return _of_outline(chief, surface.outline)
    inner = None
    if surface.obscuration_radius_mm > 0:
        inner = RimCurve.of_design(chief, surface.obscuration_radius_mm, hole=True)
    return RimCurve.of_design(chief, surface.aperture_radius_mm), inner


def _of_outline(chief: ChiefRays, outline: Outline) -> tuple[RimCurve, RimCurve | None]:
    from irtscots_cl.optics.outline_curves import edge_curves  # imported late: few mirrors are no disks

    if outline.has_grid:
        raise NoOutlineError("the design's outline is a picture (mirror.outline.file)")
    if outline.strips:
        raise NoOutlineError("spiders cut the design's outline (mirror.outline.spider)")
    curves = edge_curves(chief.surface, POINTS)
    rims, holes = ([curve for curve, hole in curves if hole is wanted] for wanted in (False, True))
    if len(rims) != 1 or len(holes) > 1:
        raise NoOutlineError(f"the design's mirror has {len(rims)} pieces and {len(holes)} holes; must be one with one")
    return RimCurve.along(chief, rims[0]), RimCurve.along(chief, holes[0], hole=True) if holes else None


def _mm_per_px(chief: ChiefRays, centre: FloatArray) -> FloatArray:
    half = 0.5
    steps = np.array([[half, 0], [-half, 0], [0, half], [0, -half]]) + centre
    points = chief.reverse(steps[:, 0], steps[:, 1])[0][:, :2]
    return np.stack([points[0] - points[1], points[2] - points[3]], -1)


def outline_checks(
    found: MirrorOutline, signal: FloatArray, lit: BoolArray, marked: BoolArray | None = None
) -> list[Check]:
    """What picture and design disagree in. marked: pixels [rows, columns] that are dark for a known reason."""
    known = np.zeros(lit.shape, bool) if marked is None else marked
    checks = [_shift(found), _size(found), _shape(found)]
    if found.hole is not None:
        checks.append(_hole(found, found.hole))
    elif found.why_no_hole:
        text = f"the central hole's edge was not found: {found.why_no_hole}"
        small = "wide" in found.why_no_hole
        checks.append(Check("obscuration", OK if small else WARNING, 0.0, 0.0, 0.0, text))
    return [*checks, _dark(found, lit, known), _other_light(found, lit), _vignetting(found, signal)]


def _shift(found: MirrorOutline) -> Check:
    rim = found.rim
    size = float(np.hypot(*rim.shift_px))
    limit = max(SHIFT_PX, SIGMAS * float(rim.shift_error_px.max()))
    (row, column), (x, y), errors = rim.shift_px, found.shift_mm, found.shift_error_mm
    told = (
        f"{row:+.3f} rows, {column:+.3f} columns (+- {rim.shift_error_px.max():.3f} pixels) from its place in the "
        f"design: {x:+.3g}, {y:+.3g} mm (+- {errors.max():.2g} mm) on the mirror"
    )
    if size <= limit:
        return Check("outline shift", OK, size, limit, 1e-6, f"the mirror's outline lies {told}")
    text = f"the mirror's outline lies {told}; the camera's direction or position, or the mirror's place, differs"
    return Check("outline shift", WARNING, size, limit, 1e-6, text)


def _size(found: MirrorOutline) -> Check:
    rim = found.rim
    value, error = (rim.scale - 1) * rim.expected.radius_px, rim.scale_error * rim.expected.radius_px
    limit = max(SHIFT_PX, SIGMAS * error)
    told = f"{rim.scale:.5f} +- {rim.scale_error:.5f} times the design's size"
    if abs(value) <= limit:
        return Check("outline size", OK, abs(value), limit, 1e-6, f"the mirror's outline has {told}")
    text = (
        f"the mirror's outline has {told}, {value:+.2f} pixels in radius: the mirror's diameter, its distance, the "
        "camera's focal length or the detector's pitch differs"
    )
    return Check("outline size", WARNING, abs(value), limit, 1e-6, text)


def _shape(found: MirrorOutline) -> Check:
    rim = found.rim
    hidden = float(rim.hidden.sum() / max(rim.in_picture.sum(), 1))
    outside = 1 - float(rim.in_picture.mean())
    if hidden > HIDDEN:
        text = (
            f"{hidden:.0%} of the mirror's rim in the picture shows no edge where it should ({_where(rim, rim.hidden)})"
            ": something in front of it, another object beside it, or a rim that is not the design's"
        )
        return Check("outline shape", WARNING, hidden, HIDDEN, 1e-6, text)
    if rim.residual_px > max(SHAPE_PX, 3 * rim.noise_px):
        text = (
            f"the mirror's edge lies {rim.residual_px:.2f} pixels rms from the design's rim, moved and scaled "
            f"(noise: {rim.noise_px:.2g}): the rim's shape, the camera's distortion or its obliquity differs"
        )
        return Check("outline shape", WARNING, rim.residual_px, SHAPE_PX, 1e-6, text)
    if rim.blur_px > SOFT_PX:
        text = f"the mirror's edge is blurred by {rim.blur_px:.2g} pixels: the camera is not in focus there"
        return Check("outline shape", WARNING, rim.blur_px, SOFT_PX, 1e-6, text)
    more = f"; {outside:.0%} of the rim is outside the picture or at a corner, not judged" if outside > 0.01 else ""
    text = f"the mirror's edge follows the design's rim to {rim.residual_px:.2g} pixels rms (noise: {rim.noise_px:.2g})"
    return Check("outline shape", OK, rim.residual_px, SHAPE_PX, 1e-6, text + more)


def _where(rim: OutlineFit, pieces: BoolArray) -> str:
    """Where on the rim most of the pieces lie, in words, as the upright picture is seen with +y at the top."""
    sides = _side(rim)
    counts = np.bincount(sides[pieces], minlength=len(SIDES))
    named = [SIDES[k] for k in np.argsort(-counts, kind="stable")[:3] if counts[k] >= max(counts.max() / 2, 1)]
    return ", ".join(named)


def _side(rim: OutlineFit) -> np.ndarray:
    row, column = (rim.place - rim.curve.centre).T
    side: np.ndarray = np.rint(np.arctan2(row, column) / (2 * np.pi / len(SIDES))).astype(int) % len(SIDES)
    return side


def _hole(found: MirrorOutline, hole: OutlineFit) -> Check:
    """The hole against the rim: a mirror moved as a whole moves both."""
    rim = found.rim
    # where the hole would be, had it moved with the rim
    moved = rim.curve.centre + rim.scale * (hole.expected.centre - rim.expected.centre)
    off = hole.curve.centre - moved
    error = float(np.hypot(rim.shift_error_px, hole.shift_error_px).max())
    size, limit = float(np.hypot(*off)), max(SHIFT_PX, SIGMAS * error)
    x, y = found.mm_per_px @ off
    told = f"{size:.2f} +- {error:.2f} pixels ({x:+.3g}, {y:+.3g} mm) from the middle of the rim"
    grown = (hole.scale / rim.scale - 1) * hole.expected.radius_px
    grown_limit = max(SHIFT_PX, SIGMAS * float(np.hypot(hole.scale_error, rim.scale_error)) * hole.expected.radius_px)
    if size > limit:
        text = f"the central hole is decentred, {told}: the obscuration is not in the design's place"
        return Check("obscuration", WARNING, size, limit, 1e-6, text)
    if abs(grown) > grown_limit:
        text = (
            f"the central hole has {hole.scale / rim.scale:.4f} times the design's size: mirror.obscuration_mm differs"
        )
        return Check("obscuration", WARNING, abs(grown), grown_limit, 1e-6, text)
    return Check("obscuration", OK, size, limit, 1e-6, f"the central hole lies {told}")


def _clear(found: MirrorOutline) -> float:
    return CLEAR_PX + 2 * found.rim.blur_px


def _near_edges(found: MirrorOutline, shape: tuple[int, int]) -> BoolArray:
    near = np.zeros(shape, bool)
    for fit in (found.rim, found.hole):
        if fit is not None:
            near[fit.curve.near(shape, _clear(found))] = True
    return near


def _spots(mask: BoolArray, mirror_pixels: float) -> tuple[np.ndarray, list[int]]:
    """Numbers [rows, columns] of connected places, and those that are large enough to be named, the largest first."""
    numbers = label(mask, connectivity=2)
    sizes = np.bincount(numbers.ravel())
    sizes[0] = 0
    least = max(SPOT[0], SPOT[1] * mirror_pixels)
    return numbers, [int(k) for k in np.argsort(-sizes) if sizes[k] >= least]


def _dark(found: MirrorOutline, lit: BoolArray, known: BoolArray) -> Check:
    inside = found.whole & ~_near_edges(found, lit.shape)
    if found.hole is None and found.why_no_hole:
        inside &= ~_around(found, lit.shape)
    dark = inside & ~lit & ~known
    total = int(inside.sum())
    numbers, large = _spots(dark, total)
    share = float(sum(np.count_nonzero(numbers == k) for k in large) / max(total, 1))
    if not large:
        return Check("dark parts", OK, 0.0, 0.0, 1e-6, "no part of the mirror is dark")
    told = [_dark_words(found, numbers == k) for k in large[:4]]
    more = f"; and {len(large) - 4} more" if len(large) > 4 else ""
    text = f"{share:.1%} of the mirror is dark: {'; '.join(told)}{more}"
    return Check("dark parts", WARNING, share, 0.0, 1e-6, text)


def _around(found: MirrorOutline, shape: tuple[int, int]) -> BoolArray:
    """Pixels near the middle, where a hole whose edge was not found may be."""
    row, column = np.indices(shape)
    away = np.hypot(row - found.rim.curve.centre[0], column - found.rim.curve.centre[1])
    return np.asarray(away < 0.35 * found.rim.curve.radius_px)


def _dark_words(found: MirrorOutline, spot: BoolArray) -> str:
    """What a dark place looks like: where it is, and whether it comes from the rim."""
    rim, size = found.rim, np.count_nonzero(spot)
    row, column = (float(v.mean()) for v in np.nonzero(spot))
    at = f"{size} pixels about row {row:.0f}, column {column:.0f}"
    places = np.stack(np.nonzero(spot), -1).astype(float)
    distance, number = rim.curve.nearest(places)
    reaches = number[distance < _clear(found) + 2.0]
    if not reaches.size:
        return f"{at}, inside: dirt, a mark, or light that misses the screen"
    # the touched part of the rim: two parts far from each other are those of something that crosses the mirror
    touched = np.zeros(64, bool)
    touched[reaches * 64 // len(rim.curve.points)] = True
    touched = np.asarray(binary_dilation(np.tile(touched, 3), iterations=2)[64:128])
    ends = int(np.count_nonzero(touched & ~np.roll(touched, 1)))
    if ends >= 2:
        return f"{at}, from rim to rim: a cable, an arm or a bar across the mirror"
    return f"{at}, in from the rim: a hand, a clamp, a shadow, or light that misses the screen"


def _other_light(found: MirrorOutline, lit: BoolArray) -> Check:
    off = (found.coverage == 0) & ~_near_edges(found, lit.shape)
    if found.rim.expected.hole is False and found.hole is None and found.why_no_hole:
        off &= ~_around(found, lit.shape)
    numbers, large = _spots(lit & off, float(found.whole.sum()))
    if not large:
        return Check("other light", OK, 0.0, 0.0, 1e-6, "nothing beside the mirror is bright")
    size = [int(np.count_nonzero(numbers == k)) for k in large]
    told = []
    for k, pixels in zip(large[:3], size, strict=False):
        row, column = (float(v.mean()) for v in np.nonzero(numbers == k))
        told.append(f"{pixels} pixels about row {row:.0f}, column {column:.0f}")
    text = (
        f"{len(large)} bright {'place' if len(large) == 1 else 'places'} beside the mirror: {'; '.join(told)}; not used"
    )
    return Check("other light", WARNING, float(sum(size)), 0.0, 1e-6, text)


def _vignetting(found: MirrorOutline, signal: FloatArray) -> Check:
    rim = found.rim
    inner = found.whole & np.isfinite(signal)
    if not inner.any():
        return Check("vignetting", OK, 1.0, FALL, 1e-6, "no pixel lies wholly on the mirror")
    middle = float(np.median(signal[inner]))
    bright = np.where(rim.used, rim.height, np.nan)
    known = np.isfinite(bright)
    wide = max(len(bright) // RIM_PART, 1)
    top = uniform_filter1d(np.nan_to_num(bright), wide, mode="wrap")
    bottom = uniform_filter1d(known.astype(float), wide, mode="wrap")
    mean = np.where(bottom > 0.5, top / np.maximum(bottom, 0.5), np.inf)
    worst = int(np.argmin(mean))
    value = float(mean[worst]) / middle if middle > 0 else 1.0
    if value >= FALL:
        return Check("vignetting", OK, value, FALL, 1e-6, f"the rim has at least {value:.2f} of the median brightness")
    side = SIDES[_side(rim)[worst]]
    text = (
        f"at the rim ({side}) the mirror has {value:.2f} of its median brightness: vignetting in the camera, or light "
        "that misses the screen"
    )
    return Check("vignetting", WARNING, value, FALL, 1e-6, text)
