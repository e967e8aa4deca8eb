"""Aims of the forward estimator's rays: the whole mirror, or only the part that sends light into the camera.

A screen pixel lights the whole mirror, but only part of the mirror sends this light into the camera's aperture. Both
aims are ellipses in direction cosines in the pixel's plane, where Lambertian light is uniform. All rays have the
same weight: every ellipse aimed at the camera has the same share of the area of the ellipse that covers the mirror.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.frame import Frame
from irtscots_cl.optics.aperture_rims import RIM
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.screen_facets import ScreenFacets
from irtscots_cl.optics.surface import Surface

RIM_POINTS = 32  # of the mirror, to fit its ellipse
MARGIN = 1e-4  # of the mirror's ellipse, because the rim between the rim points is not an exact ellipse
RINGS = 12  # of RIM_POINTS each, over a convex mirror that hides part of its rim
BULGE_MARGIN = 0.02  # of its ellipse, for what stands out between these points
POINTS_AT_A_TIME = 2**15  # of the mirror, seen from one screen pixel each: their arrays stay in the cache
SLACK = 0.25  # screen pixels added to the chief rays' range that can light a detector pixel; doubled if too small
MAX_SLACK = 8.0
CHECK_RAYS = 2**15  # from the camera, to check that the aim covers all directions they find
FLATTEST = 1e-5  # ratio of an ellipse's axes below which the shorter one is widened
PAIRS = 2**18  # of a screen and a detector pixel, processed at a time: limits the memory


@dataclass(frozen=True)
class Aim:
    """Ellipses of n screen pixels in direction cosines (l, m): centre [n, 2] + root [n, 2, 2] times the unit disk.

    root is lower triangular. share: their area divided by the area of the ellipses that cover the mirror.
    """

    centre: np.ndarray
    root: np.ndarray
    share: float

    @property
    def area(self) -> np.ndarray:
        return np.pi * self.root[:, 0, 0] * self.root[:, 1, 1]

    def overfilled(self, overfill: float) -> Aim:
        """The same ellipses with `overfill` times the area."""
        return Aim(self.centre, self.root * np.sqrt(overfill), self.share)

    def holds(self, pixel: np.ndarray, cosines: np.ndarray) -> np.ndarray:
        """Whether directions [k, 2] of the screen pixels [k] lie within their ellipses [k]."""
        return _radius_in_ellipse(self.root, self.centre, pixel, cosines) <= 1.0


def find_mirror_aim(chief: ChiefRays) -> Aim:
    """The smallest ellipses that cover the mirror from every point of the screen pixel."""
    facets = ScreenFacets.of(chief)
    rim, bulge = mirror_rings(chief.surface, 1)[0], _bulge(chief)
    half, parts = np.broadcast_to(facets.half_diagonal, facets.u.shape), []
    count = len(facets.u)
    for k in np.array_split(np.arange(count), count * (len(rim) + len(bulge)) // POINTS_AT_A_TIME + 1):
        rays = facets.from_pixels(rim, k)
        distance = np.linalg.norm(rays, axis=-1)
        within = facets.cosines(facets.from_pixels(bulge, k), k) if len(bulge) else None
        parts.append(_covering(facets.across(rays / distance[..., None], k), distance, half[k], within))
    return Aim(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)), 1.0)


def mirror_rings(surface: Surface, rings: int) -> np.ndarray:
    """Points [rings, RIM_POINTS, 3] of the mirror on circles of equal steps in radius, the rim first."""
    angle = np.arange(RIM_POINTS) * (2 * np.pi / RIM_POINTS)
    radius = surface.aperture_radius_mm * np.arange(rings, 0, -1) / rings
    x, y = np.multiply.outer(radius, np.cos(angle)), np.multiply.outer(radius, np.sin(angle))
    return np.stack([x, y, surface.sag(x, y)], -1)


def _bulge(chief: ChiefRays) -> np.ndarray:
    """Points [k, 3] of the mirror that can stand out beyond its rim, seen from some part of the screen; mostly none.

    A convex mirror hides a part of its rim from a point below the tangent plane there. Of all points of a plane screen
    its corners are the lowest.
    """
    surface, none = chief.surface, np.zeros((0, 3))
    if surface.quadric.q_yy >= 0 and not surface.design:
        return none
    rim = mirror_rings(surface, 1)[0]
    slope_x, slope_y = surface.gradient(rim[:, 0], rim[:, 1])
    normals = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], -1)
    to = screen_corners(chief)[:, None] - rim
    above = np.sum(to * normals, -1) / np.linalg.norm(to, axis=-1)
    return none if (above > BULGE_MARGIN).all() else mirror_rings(surface, RINGS)[1:].reshape(-1, 3)


def screen_corners(chief: ChiefRays) -> np.ndarray:
    """World points [4, 3] of the corners of the screen's pixel grid."""
    screen = chief.scene.screen
    half_u, half_v = (n * p / 2 for n, p in zip(screen.pixels, screen.pitch_xy_mm, strict=True))
    middle_u, middle_v = screen.centre_offset_mm
    u, v = np.array([-1, 1, -1, 1]) * half_u + middle_u, np.array([-1, -1, 1, 1]) * half_v + middle_v
    return chief.screen_model.to_world(u, v)


def covering_ellipses(frame: Frame, rim: np.ndarray, x: np.ndarray, y: np.ndarray, half_pixel: float):
    """Ellipses that cover the points of a rim [k, 3] from screen pixels at (x, y) [n]: centres [n, 2], roots [n, 2, 2].

    frame: of a flat screen. half_pixel: half of its pixels' diagonal in mm. A rim that is seen nearly edge-on gets a
    wider ellipse.
    """
    rays = rim - frame.to_world(x, y)[:, None, :]
    distance = np.linalg.norm(rays, axis=-1)
    return _covering((rays / distance[..., None]) @ frame.axes[:2].T, distance, half_pixel)


def _covering(
    cosines: np.ndarray, distance: np.ndarray, half_pixel: float | np.ndarray, within: np.ndarray | None = None
):
    """Centres [n, 2] and roots [n, 2, 2] of ellipses around directions [n, k, 2] to points at distances [n, k].

    within: [n, m, 2] directions to points within their rim that may stand out beyond it and are covered, too.
    """
    centre = cosines.mean(1)
    spread = cosines - centre[:, None, :]
    # Points at equal angles on an ellipse's rim have half its shape matrix as covariance.
    shape = 2 * np.einsum("nki,nkj->nij", spread, spread) / cosines.shape[1]
    flat = np.trace(shape, axis1=1, axis2=2) * FLATTEST
    l, lm, m = shape[:, 0, 0], shape[:, 0, 1], shape[:, 1, 1]
    root = _cholesky(*np.where(l * m - lm * lm < flat**2, [l + flat, lm, m + flat], [l, lm, m]))
    reach = _lengths(root, spread).max(1)
    if within is not None:
        beyond = _lengths(root, within - centre[:, None, :]).max(1)
        reach = np.maximum(reach, beyond * (1 + BULGE_MARGIN))
    return centre, _widened(root * (reach * (1 + MARGIN))[:, None, None], half_pixel / distance.min(1))


def _cholesky(l: np.ndarray, lm: np.ndarray, m: np.ndarray) -> np.ndarray:
    """Lower triangular roots [n, 2, 2] of the matrices [[l, lm], [lm, m]] [n]."""
    root = np.zeros((len(l), 2, 2))
    root[:, 0, 0] = np.sqrt(l)
    root[:, 1, 0] = lm / root[:, 0, 0]
    root[:, 1, 1] = np.sqrt(m - root[:, 1, 0] ** 2)
    return root


def _lengths(root: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Lengths [n, k] of the vectors [n, k, 2] in ellipses [n]: 1 on their rims."""
    first = vectors[..., 0] / root[:, 0, 0, None]
    second = (vectors[..., 1] - root[:, 1, 0, None] * first) / root[:, 1, 1, None]
    return np.sqrt(first * first + second * second)


def find_camera_aim(chief: ChiefRays, whole: Aim) -> Aim:
    """Ellipses of equal shares of the mirror's that hold every direction in which light reaches the camera.

    whole: the aim of find_mirror_aim, returned where the camera sees nearly all of the mirror lit by one screen pixel.
    The ellipses hold what the chief rays say, and are checked with rays from all over the aperture.
    """
    slack = SLACK
    while slack <= MAX_SLACK:
        aim = _around_footprints(chief, whole, slack)
        if aim.share >= 1.0:
            return whole
        if aim.holds(*_directions_from_camera(chief)).all():
            return aim
        slack *= 2
    return whole


def _around_footprints(chief: ChiefRays, whole: Aim, slack: float) -> Aim:
    """Ellipses around the footprints of the detector pixels that a screen pixel lights, of equal shares of `whole`."""
    count = len(whole.centre)
    sums = np.zeros((6, count))
    for screen, cosines in _footprint_directions(chief, whole, slack):
        l, m = cosines.T
        for k, value in enumerate((np.ones_like(l), l, m, l * l, l * m, m * m)):
            sums[k] += np.bincount(screen, value, count)
    lit = sums[0] > 0
    n, l, m, ll, lm, mm = sums[:, lit]
    mean = np.stack([l, m], -1) / n[:, None]
    covariance = np.stack([ll, lm, lm, mm], -1).reshape(-1, 2, 2) / n[:, None, None] - mean[:, :, None] * mean[:, None]
    centre, root = np.zeros_like(whole.centre), whole.root.copy()
    centre[lit], root[lit] = mean, np.linalg.cholesky(covariance)
    reach = np.zeros(count)
    for screen, cosines in _footprint_directions(chief, whole, slack):
        np.maximum.at(reach, screen, _radius_in_ellipse(root, centre, screen, cosines))
    root[lit] = _widened(root[lit] * reach[lit, None, None], _blur(chief))
    of_whole = np.prod(root.diagonal(axis1=1, axis2=2), 1) / np.prod(whole.root.diagonal(axis1=1, axis2=2), 1)
    share = float(of_whole[lit].max(initial=0.0))
    return Aim(whole.centre + centre, root * np.sqrt(share / of_whole)[:, None, None], share)


def _footprint_directions(chief: ChiefRays, whole: Aim, slack: float):
    """Screen pixels [k] and directions [k, 2], from the centre of `whole`, to corners of the footprints they light."""
    columns, rows = chief.scene.screen.pixels
    corner, sees, screen, facets = chief.corners[0], chief.sees_mirror, chief.scene.screen, ScreenFacets.of(chief)
    pitch = np.array(screen.pitch_xy_mm)
    four = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[:-1, 1:], corner[1:, 1:]], 2)[sees]
    margin_mm = float(np.hypot(*pitch)) / 2 + slack * pitch.max()
    centre, to_aperture, reach = _landing(chief, margin_mm)
    known = np.isfinite(reach) & np.isfinite(four).all((1, 2))
    four, centre, to_aperture, reach = four[known], centre[known], to_aperture[known], reach[known]
    lowest, highest = (edge[sees][known] for edge in chief.landing_range())
    first = np.ceil(np.clip(lowest - 0.5 - slack, 0, [columns, rows])).astype(int)
    last = np.floor(np.clip(highest + 0.5 + slack, -1, [columns - 1, rows - 1])).astype(int)
    pixels = np.stack([facets.u, facets.v], -1)
    widest = np.maximum(last - first + 1, 0).max(0, initial=0)
    step = np.stack(np.meshgrid(*(np.arange(n) for n in widest), indexing="ij"), -1).reshape(-1, 2)
    for part in np.array_split(np.arange(len(first)), len(first) * len(step) // PAIRS + 1):
        at = first[part, None] + step
        away = (pixels[0] + at * pitch - centre[part, None]) @ to_aperture[part].transpose(0, 2, 1)
        lit = (np.linalg.norm(away, axis=-1) <= reach[part, None]) & (at <= last[part, None]).all(-1)
        detector, k = np.nonzero(lit)
        screen = at[detector, k, 1] * columns + at[detector, k, 0]
        cosines = facets.cosines(facets.from_pixels(four[part[detector]], screen), screen)
        yield np.repeat(screen, 4), (cosines - whole.centre[screen, None]).reshape(-1, 2)


def _landing(chief: ChiefRays, margin_mm: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The place on the screen that the light of each of n detector pixels that see the mirror comes from, by its local
    linear map.

    Near a caustic this map says little, and landing_range says more. Returns centre [n, 2] in mm; to_aperture [n, 2,
    2], the map from there to the camera's aperture, in its radii; reach [n], also in radii: screen pixels whose centres
    are closer light the pixel. reach is widened by margin_mm.
    """
    sees = chief.sees_mirror
    rim = np.stack(chief.rims.at(np.flatnonzero(sees))[1:], -1)
    centre = rim.mean(-2)
    linear = np.einsum("...ku,ka->...ua", rim, RIM) * (2 / len(RIM))  # [n, (u, v), (a, b)], a, b in radii
    left = np.linalg.norm(rim - centre[..., None, :] - RIM @ linear.swapaxes(-1, -2), axis=-1).max(-1)
    corners = np.stack(chief.corners[1:], -1)
    four = np.stack([part[sees] for part in (corners[:-1, :-1], corners[1:, :-1], corners[:-1, 1:], corners[1:, 1:])])
    spread = np.linalg.norm(four - centre, axis=-1).max(0)
    known = np.isfinite(linear).all((-1, -2)) & (np.abs(np.linalg.det(np.nan_to_num(linear))) > 0)
    to_aperture = np.linalg.inv(np.where(known[..., None, None], linear, np.eye(2)))
    reach = 1 + np.linalg.norm(to_aperture, 2, axis=(-2, -1)) * (margin_mm + spread + left)
    return centre, to_aperture, np.where(known, reach, np.nan)


def _blur(chief: ChiefRays) -> float:
    """How far directions extend beyond those from a pixel's centre to footprints: half a pixel plus aperture blur."""
    mirror, _, _ = chief.rims.at(np.flatnonzero(chief.sees_mirror))
    screen, facets = chief.scene.screen, ScreenFacets.of(chief)
    blur = np.nanmax(np.linalg.norm(mirror - np.nanmean(mirror, -2, keepdims=True), axis=-1), initial=0.0)
    distance = np.nanmin(np.linalg.norm(mirror - np.array(screen.position_mm), axis=-1))
    reach = np.linalg.norm(np.array(screen.pixels) * screen.pitch_xy_mm) / 2 + np.linalg.norm(screen.centre_offset_mm)
    if not facets.is_flat:
        reach = np.linalg.norm(facets.points - np.array(screen.position_mm), axis=-1).max()
    return float((np.max(facets.half_diagonal) + blur) / max(distance - reach, distance / 2))


def _directions_from_camera(chief: ChiefRays) -> tuple[np.ndarray, np.ndarray]:
    """Screen pixels [k] and directions [k, 2] of light that enters the camera, from reverse rays; half of them pass
    through the aperture's rim."""
    random, (rows, columns) = np.random.default_rng(0), chief.shape
    row, column = random.random((2, CHECK_RAYS)) * [[rows], [columns]] - 0.5
    angle = random.random(CHECK_RAYS) * 2 * np.pi
    radius = chief.scene.camera.aperture_diameter_mm / 2 * np.sqrt(random.random(CHECK_RAYS))
    radius[::2] = chief.scene.camera.aperture_diameter_mm / 2
    points, u, v = chief.reverse(row, column, radius * np.cos(angle), radius * np.sin(angle))
    screen, facets = chief.scene.screen, ScreenFacets.of(chief)
    with np.errstate(invalid="ignore"):
        at = [np.floor((w - offset) / pitch + count / 2) for w, offset, pitch, count in
              zip((u, v), screen.centre_offset_mm, screen.pitch_xy_mm, screen.pixels, strict=True)]  # fmt: skip
        use = chief.surface.contains(points[:, 0], points[:, 1], 0.0)
        use &= (at[0] >= 0) & (at[0] < screen.pixels[0]) & (at[1] >= 0) & (at[1] < screen.pixels[1])
    rays = points[use] - chief.screen_model.seen_from(points[use], u[use], v[use])
    pixel = (at[1][use] * screen.pixels[0] + at[0][use]).astype(int)
    return pixel, facets.cosines(rays, pixel)


def _radius_in_ellipse(root: np.ndarray, centre: np.ndarray, pixel: np.ndarray, cosines: np.ndarray) -> np.ndarray:
    """Relative radius of directions [k, 2] in the ellipses of the pixels [k]: 1 on their rim."""
    l, m = (cosines - centre[pixel]).T
    first = l / root[pixel, 0, 0]
    return np.hypot(first, (m - root[pixel, 1, 0] * first) / root[pixel, 1, 1])


def _widened(root: np.ndarray, by: np.ndarray | float) -> np.ndarray:
    """Ellipses [n, 2, 2] enlarged to contain all points within that distance of them."""
    area = root[:, 0, 0] * root[:, 1, 1]  # product of both half-axes, whose squares add up to `squares`
    squares = np.sum(root**2, (1, 2))
    shortest = area / np.sqrt((squares + np.sqrt(np.maximum(squares**2 - 4 * area**2, 0.0))) / 2)
    return root * (1 + by / shortest)[:, None, None]
