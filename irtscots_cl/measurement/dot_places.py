"""Places on the screen at the images of dots, and a map between them that says how far it interpolates.

A dot's image is found as a bright blob; its pixels, weighed by their light, see the dot's centre on average. So the
dot's centre less the weighted mean of the design's places over a blob is how far the mirror sends light from where the
design would: a small, smooth difference, which is interpolated between the dots.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import convolve
from scipy.spatial import Delaunay, QhullError, cKDTree
from skimage.filters import threshold_otsu
from skimage.measure import label, regionprops
from skimage.morphology import dilation
from skimage.segmentation import expand_labels

from irtscots_cl.maths.arrays import BoolArray, FloatArray

LEAST_PIXELS = 4  # of a blob above the threshold
LEAST_DOTS = 6  # for a map
CONTRAST = 8.0  # standard errors of a sample: the brightest of a blob at least
ROOM = 0.5  # of a blob's radius above the threshold, and a pixel: so far its light goes on around it
NEAR = 0.5  # of the dots' pitch: a blob further from every dot, by the design, is none of them
_SECOND = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0])  # differences that leave noise alone (Immerkaer 1996)
_SECOND_NOISE = 6.0 * 0.6745  # of unit noise: root of its squares' sum, times the median of |normal|


@dataclass(frozen=True)
class DotPlaces:
    """Of n dots: row, column of their images' centres on the upright grid; u_mm, v_mm, their centres on the screen's
    grid; by design: design_u_mm, design_v_mm where the same pixels would see; standard errors in mm, of noise alone: a
    dot tells the mean over its image. radius_px: of the images."""

    row: FloatArray = field(repr=False)
    column: FloatArray = field(repr=False)
    u_mm: FloatArray = field(repr=False)
    v_mm: FloatArray = field(repr=False)
    design_u_mm: FloatArray = field(repr=False)
    design_v_mm: FloatArray = field(repr=False)
    u_error_mm: FloatArray = field(repr=False)
    v_error_mm: FloatArray = field(repr=False)
    radius_px: FloatArray = field(repr=False)

    def __len__(self) -> int:
        return len(self.row)

    @classmethod
    def joined(cls, parts: list[DotPlaces]) -> DotPlaces:
        """Those of several frames."""
        names = ("row", "column", "u_mm", "v_mm", "design_u_mm", "design_v_mm", "u_error_mm", "v_error_mm",
                 "radius_px")  # fmt: skip
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def image_noise(image: FloatArray, mask: BoolArray) -> float:
    """Standard error of a sample from differences of neighbours in which smooth light cancels.

    Source: J. Immerkaer, Comput. Vis. Image Underst. 64, 300 (1996), with a median for its mean.
    """
    inner = convolve(mask.astype(float), np.ones((3, 3)), mode="constant") > 8.5
    if not inner.any():
        return float("nan")
    second = convolve(np.where(mask, np.nan_to_num(image), 0.0), _SECOND, mode="constant")
    return float(np.median(np.abs(second[inner])) / _SECOND_NOISE)


def find_dots(
    share: FloatArray,
    mask: BoolArray,
    centres_mm: tuple[FloatArray, FloatArray],
    design_mm: tuple[FloatArray, FloatArray],
) -> tuple[DotPlaces, int]:
    """The dots of one frame, and how many blobs were seen that are whole or not.

    share: [rows, columns] upright, 0 where black and 1 where white is seen. mask: pixels on the mirror. centres_mm: of
    the dots' columns and rows on the screen's grid. design_mm: where the pixels would see, were the mirror the design.
    Blobs that the mirror's edge cuts off, and those nearer to no dot than half a pitch, are left out.
    """
    known = mask & np.isfinite(share) & np.isfinite(design_mm[0]) & np.isfinite(design_mm[1])
    noise = image_noise(share, known)
    values = np.where(known, share, 0.0)
    varies = known.any() and np.ptp(values[known]) > 0
    blobs = label(known & (values > threshold_otsu(values[known]))) if varies else np.zeros(known.shape, int)
    area = screen_area(design_mm)
    known &= np.isfinite(area)
    found, seen, taken = [], 0, set()
    for region in regionprops(blobs, intensity_image=values):
        if region.area < LEAST_PIXELS or region.intensity_max < CONTRAST * noise:
            continue
        seen += 1
        one = expand_labels(blobs, 1.0 + ROOM * region.equivalent_diameter_area / 2) == region.label
        if (dilation(one, np.ones((3, 3), bool)) & ~known).any():
            continue
        place = _centre(one, values, noise, design_mm, area)
        which = _dot(place[2:4], centres_mm)
        if which is None or which in taken:
            continue
        taken.add(which)
        found.append(
            [*place[:2], centres_mm[0][which[0]], centres_mm[1][which[1]], *place[2:], np.sqrt(one.sum() / np.pi)]
        )
    columns = np.array(found, float).reshape(-1, 9).T
    return DotPlaces(*columns), seen


def _centre(
    one: BoolArray, values: FloatArray, noise: float, design_mm: tuple[FloatArray, FloatArray], area: FloatArray
) -> tuple[float, ...]:
    """Row, column, design u, v and errors of u, v of a blob's pixels by their light, each as much as its area."""
    rows, columns = np.nonzero(one)
    weight = values[one] * area[one]
    total = weight.sum()
    u, v = (place[one] for place in design_mm)
    row, column, mean_u, mean_v = (float((weight * a).sum() / total) for a in (rows, columns, u, v))
    errors = (noise * np.sqrt(np.square((a - m) * area[one]).sum()) / total for a, m in ((u, mean_u), (v, mean_v)))
    return row, column, mean_u, mean_v, *map(float, errors)


def screen_area(design_mm: tuple[FloatArray, FloatArray]) -> FloatArray:
    """How much of the screen [rows, columns] the pixels see each, in mm^2, by differences of their places."""
    (u_row, u_column), (v_row, v_column) = (np.gradient(place) for place in design_mm)
    area: FloatArray = np.abs(u_row * v_column - u_column * v_row)
    return area


def _dot(place_mm: tuple[float, ...], centres_mm: tuple[FloatArray, FloatArray]) -> tuple[int, int] | None:
    """Number along x and y of the dot next to a place; None where none is near."""
    found = []
    for place, centres in zip(place_mm, centres_mm, strict=True):
        k = int(np.argmin(np.abs(centres - place)))
        pitch = centres[1] - centres[0] if len(centres) > 1 else np.inf
        if abs(centres[k] - place) > NEAR * pitch:
            return None
        found.append(k)
    return found[0], found[1]


@dataclass(frozen=True)
class DotMap:
    """Maps [rows, columns] between the dots, NaN beyond the outermost ones: places and standard errors in mm, and
    distance_px of a pixel to the next dot's image. tested_mm: rms differences (u, v) of dots from what the others say
    of them, beyond their noise."""

    u_mm: FloatArray = field(repr=False)
    v_mm: FloatArray = field(repr=False)
    u_error_mm: FloatArray = field(repr=False)
    v_error_mm: FloatArray = field(repr=False)
    distance_px: FloatArray = field(repr=False)
    tested_mm: tuple[float, float]


def interpolated(dots: DotPlaces, design_mm: tuple[FloatArray, FloatArray]) -> DotMap:
    """Places of all pixels between the dots: the design's, less its differences at the dots, linear between them.

    The standard errors hold the dots' own and, growing with the distance, what leaving out each dot in turn
    shows that interpolation misses; half the radius of a dot's image is the least distance.
    Raises ValueError for too few dots.
    """
    points = np.stack([dots.row, dots.column], -1)
    if len(dots) < LEAST_DOTS:
        raise ValueError(f"dots: {len(dots)} found whole and matched; a map needs at least {LEAST_DOTS}")
    shape = design_mm[0].shape
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), -1).reshape(-1, 2).astype(float)
    tree = cKDTree(points)
    distance = tree.query(grid)[0]
    spacing = float(np.median(tree.query(points, k=2)[0][:, 1]))
    blurred = float(np.median(dots.radius_px)) / 2
    try:
        weights, corners = _barycentric(points, grid)
    except QhullError:
        raise ValueError("dots: those found lie on one line; a map needs them in rows and columns") from None
    maps, errors, tested = [], [], []
    for own, by_design, error, design in (
        (dots.u_mm, dots.design_u_mm, dots.u_error_mm, design_mm[0]),
        (dots.v_mm, dots.design_v_mm, dots.v_error_mm, design_mm[1]),
    ):
        difference = own - by_design
        missed, reach = _left_out(points, difference, error)
        between = missed * np.maximum(distance, blurred) / max(reach, spacing / 2)
        noise = np.sqrt((np.square(weights) * np.square(error)[corners]).sum(1))
        maps.append((design.ravel() + (weights * difference[corners]).sum(1)).reshape(shape))
        errors.append(np.hypot(noise, between).reshape(shape))
        tested.append(missed)
    inside = np.isfinite(weights).all(1)
    far = np.where(inside, distance, np.nan).reshape(shape)
    return DotMap(maps[0], maps[1], errors[0], errors[1], far, (tested[0], tested[1]))


def _barycentric(points: FloatArray, at: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Weights [m, 3], NaN outside, and numbers [m, 3] of the points around places [m, 2]."""
    mesh = Delaunay(points)
    simplex = mesh.find_simplex(at)
    transform = mesh.transform[simplex]
    first = np.einsum("nij,nj->ni", transform[:, :2], at - transform[:, 2])
    weights = np.concatenate([first, 1 - first.sum(1, keepdims=True)], axis=1)
    weights[simplex < 0] = np.nan
    return weights, mesh.simplices[simplex]


def _left_out(points: FloatArray, values: FloatArray, error: FloatArray) -> tuple[float, float]:
    """Rms by which values differ from what the other points say there, beyond noise; and the rms distance over which
    that was. 0 and 0 where no point lies between others."""
    square, noise, reach = [], [], []
    for k in range(len(points)):
        others = np.delete(np.arange(len(points)), k)
        try:
            weights, corners = _barycentric(points[others], points[k : k + 1])
        except QhullError:
            continue
        if np.isfinite(weights).all():
            used = others[corners[0]]
            square.append((values[k] - weights[0] @ values[used]) ** 2)
            noise.append(error[k] ** 2 + np.square(weights[0]) @ np.square(error[used]))
            reach.append(np.square(points[used] - points[k]).sum(1).min())
    if not square:
        return 0.0, 0.0
    return float(np.sqrt(max(np.mean(square) - np.mean(noise), 0.0))), float(np.sqrt(np.mean(reach)))
