"""Pictures of mirrors with soft edges, whose outline and marks are known to a fraction of a pixel."""

from __future__ import annotations

import numpy as np
from scenes import coarse, with_part
from scipy.ndimage import gaussian_filter

from irtscots_cl.imaging.mark_files import Mark, Marks
from irtscots_cl.measurement.fiducials import MarkShape
from irtscots_cl.measurement.rim_curve import RimCurve
from irtscots_cl.optics.chief_rays import ChiefRays

COARSE, FINE = 5, 40  # parts of a pixel, each way: where nothing changes within it, and where the edge crosses it


def share(shape, inside) -> np.ndarray:
    """Share [rows, columns] of each pixel where inside(row, column) holds."""
    row, column = np.mgrid[: shape[0], : shape[1]].astype(float)
    found = _share(row, column, inside, COARSE)
    padded = np.pad(found, 1, mode="edge")
    around = np.stack([padded[a : a + shape[0], b : b + shape[1]] for a in range(3) for b in range(3)])
    edge = (around.max(0) > 0) & (around.min(0) < 1)
    found[edge] = _share(row[edge], column[edge], inside, FINE)
    return found


def _share(row, column, inside, parts):
    step = np.linspace(-0.5, 0.5, parts + 1)[:-1] + 0.5 / parts
    total = np.zeros(row.shape)
    for down in step:
        for right in step:
            total += inside(row + down, column + right)
    return total / parts**2


def disk(shape, centre, radius, hole=0.0, hole_centre=None) -> np.ndarray:
    """Share of each pixel on a disk with a hole; lengths in pixels."""
    at = centre if hole_centre is None else hole_centre

    def inside(row, column):
        outer = np.hypot(row - centre[0], column - centre[1]) <= radius
        return outer & (np.hypot(row - at[0], column - at[1]) >= hole)

    return share(shape, inside)


def circle(centre, radius, hole=False) -> RimCurve:
    turn = 2 * np.pi * np.arange(2048) / 2048
    return RimCurve(np.stack([centre[0] + radius * np.sin(turn), centre[1] + radius * np.cos(turn)], -1), hole)


def picture(on_mirror, noise=1.0, seed=0, *, blur=0.5, light=100.0, dark=10.0, gradient=0.3, photons=0.0):
    """Counts of a picture with that share of mirror in each pixel.

    gradient: share by which the light falls from left to right, half as much from bottom to top. photons: variance of
    the noise per count, beside noise^2.
    """
    rows, columns = on_mirror.shape
    row, column = np.mgrid[:rows, :columns]
    clean = dark + light * on_mirror * (1 - gradient * column / columns) * (1 - gradient / 2 * row / rows)
    clean = gaussian_filter(clean, blur) if blur else clean
    return clean + np.sqrt(noise**2 + photons * clean) * np.random.default_rng(seed).standard_normal(clean.shape)


def blurred_disk(shape, centre, radius, blur, parts=16) -> np.ndarray:
    """Share of each pixel's light that is a disk's, blurred before the pixels count it."""
    rows, columns = (((np.arange(n * parts) + 0.5) / parts - 0.5) for n in shape)
    fine = (np.hypot(rows[:, None] - centre[0], columns - centre[1]) <= radius).astype(np.float32)
    fine = gaussian_filter(fine, blur * parts) if blur else fine
    return fine.reshape(shape[0], parts, shape[1], parts).mean((1, 3)).astype(float)


class Marked:
    """A coarse off-axis test whose mirror carries marks, seen by a camera of n x n pixels."""

    POINTS = ((-250, 210), (310, 180), (40, -330), (-320, -120), (190, -60), (10, 60), (-60, 330))

    def __init__(self, n=64, diameter_mm=950.0):
        self.n = n
        self.scene = with_part(coarse("off-axis", n), "mirror", diameter_mm=diameter_mm)
        self.chief = ChiefRays(self.scene)
        self.rim = RimCurve.of_design(self.chief, diameter_mm / 2)

    def marks(self, kind="dot", points=POINTS, size_mm=56.0) -> Marks:
        names = "ABCDEFGHIJ"
        return Marks(
            tuple(
                Mark(name=names[k], x_mm=float(x), y_mm=float(y), size_mm=size_mm, kind=kind, width_mm=size_mm / 3)
                for k, (x, y) in enumerate(points)
            ),
            "marks.toml",
        )

    def mm_per_px(self, place) -> np.ndarray:
        steps = np.array([[0.5, 0], [-0.5, 0], [0, 0.5], [0, -0.5]]) + place
        x, y = self.chief.reverse(*steps.T)[0][:, :2].T
        return np.array([[x[0] - x[1], x[2] - x[3]], [y[0] - y[1], y[2] - y[3]]])

    def region(self, shift=(0.0, 0.0)) -> np.ndarray:
        return self.rim.moved(np.array(shift), 1.0, self.rim.centre).coverage((self.n, self.n)) > 0

    def light(self, marks, shift=(0.0, 0.0), turn=0.0, scale=1.0, without=(), moved=None) -> np.ndarray:
        """Share of each pixel that is mirror and no mark. shift: pixels. moved: mm by a mark's number."""
        share_of = disk((self.n, self.n), self.rim.centre + shift, self.rim.radius_px)
        for k, mark in enumerate(marks.marks):
            if k in without:
                continue
            x, y = np.array([mark.x_mm, mark.y_mm]) + np.array((moved or {}).get(k, (0, 0)))
            x, y = scale * (np.cos(turn) * x - np.sin(turn) * y), scale * (np.sin(turn) * x + np.cos(turn) * y)
            at = np.array(self.chief.pixel(x, y)).ravel() + shift
            shape = MarkShape(mark, self.mm_per_px(at))
            near = share((self.n, self.n), lambda r, c, s=shape, p=at: s.depth_px(r - p[0], c - p[1]) > 0)
            share_of = share_of * (1 - near)
        return share_of
