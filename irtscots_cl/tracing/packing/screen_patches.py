"""The part of a bent screen that each detector pixel sees, as cubics over the grid: for rays that arrive.

A pixel's light covers little of the screen, so a cubic about its middle is as good as the surface itself, and all rays
of a work-item share its coefficients. The cubics are least-squares fits over the chief rays' landing range.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from irtscots_cl.optics.chief_rays import ChiefRays

NODES = np.cos(np.pi * (np.arange(5) + 0.5) / 5)  # Chebyshev's, of the fit along each axis
POWERS = np.array([(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)])
AROUND = 1.0  # screen pixels beyond the landing range
LEFT = {"fp32": 1e-5, "fp64": 1e-10}  # of a screen pixel, by the last step from the tangent plane
MAX_STEPS = 24
LOOKED_AT = 1024  # detector pixels, where steps are counted and the fit is checked
SUSPECT = 0.02  # of a screen pixel: a fit that is worse is told of
CHUNK = 2**14  # detector pixels at a time


class ScreenFitWarning(UserWarning):
    """A bent screen is not smooth over the light of a detector pixel."""


def _monomials(u, v) -> np.ndarray:
    """[..., 10] of points."""
    return np.asarray(u)[..., None] ** POWERS[:, 0] * np.asarray(v)[..., None] ** POWERS[:, 1]


_U, _V = (values.ravel() for values in np.meshgrid(NODES, NODES))
_FIT = np.linalg.pinv(_monomials(_U, _V))
_CHECK = tuple(values.ravel() for values in np.meshgrid(np.linspace(-1, 1, 6), np.linspace(-1, 1, 6)))


@dataclass(frozen=True)
class ScreenPatches:
    """Parts of n detector pixels.

    centre, half: [2, n] middle and half-size on the grid [mm]; coefficient: [3, 10, n] of POWERS of mm from the middle,
    for the pixels' moves x, y, z from the grid [mm].
    """

    centre: np.ndarray
    half: np.ndarray
    coefficient: np.ndarray

    def moves(self, du: np.ndarray, dv: np.ndarray) -> np.ndarray:
        """Moves [3, ..., n] of the places (du, dv) [..., n] from the middles."""
        return np.einsum("kpn,...np->k...n", self.coefficient, _monomials(du, dv))

    def part(self, chosen: np.ndarray) -> ScreenPatches:
        return ScreenPatches(self.centre[:, chosen], self.half[:, chosen], self.coefficient[..., chosen])

    def met(self, goal: np.ndarray, slope: np.ndarray, steps: int) -> np.ndarray:
        """Places [2, n] from the middles that rays meet: as kernels/instrument/screen_bent.cl finds them.

        goal: [2, n] where they cross the plane of the middles, from the middles. slope: [2, n] du/dz, dv/dz.
        """
        first = self.coefficient[:, 1:3]
        matrix = np.moveaxis(np.eye(2)[..., None] + first[:2] - slope[:, None] * first[2], -1, 0)
        at = np.linalg.solve(matrix, goal.T[..., None])[..., 0].T
        linear = np.zeros_like(self.coefficient)
        linear[:, 3:] = self.coefficient[:, 3:]
        bent = ScreenPatches(self.centre, self.half, linear)
        for _ in range(steps):
            x, y, z = bent.moves(*at)
            left = goal - np.stack([x, y]) + slope * z
            at = np.linalg.solve(matrix, left.T[..., None])[..., 0].T
        return at


def screen_patches(chief: ChiefRays, visible_pixels: np.ndarray) -> ScreenPatches:
    """Cubics of the parts of a bent screen that detector pixels (flat numbers [n]) see."""
    centre, half = _parts(chief, visible_pixels)
    coefficient = np.empty((3, 10, len(visible_pixels)))
    scale = half[0] ** POWERS[:, 0, None] * half[1] ** POWERS[:, 1, None]
    for first in range(0, len(visible_pixels), CHUNK):
        part = slice(first, first + CHUNK)
        u = centre[0, part] + half[0, part] * _U[:, None]
        v = centre[1, part] + half[1, part] * _V[:, None]
        coefficient[:, :, part] = np.einsum("pm,kmn->kpn", _FIT, _moves(chief, u, v)) / scale[:, part]
    return ScreenPatches(centre, half, coefficient)


def fill_patches(out: np.ndarray, chief: ChiefRays, visible_pixels: np.ndarray, precision: str) -> None:
    """Write the parts of a bent screen that detector pixels see into their receivers [n].

    Warns by ScreenFitWarning of a surface that is not smooth there. Raises ValueError of one that folds there.
    """
    patches = screen_patches(chief, visible_pixels)
    looked_at = np.unique(np.linspace(0, len(visible_pixels) - 1, LOOKED_AT).astype(int))
    some, slopes = patches.part(looked_at), _slopes(chief, visible_pixels[looked_at])
    left = fit_error(chief, some, slopes)
    if left > SUSPECT:
        warnings.warn(
            f"scene {chief.scene.name}: screen.shape: the screen bends so much over a detector pixel's light that "
            f"adjoint rays miss the place by up to {left:.2g} screen pixels; forward rays do not", ScreenFitWarning,
            stacklevel=3,
        )  # fmt: skip
    out["patch"]["u"], out["patch"]["v"] = patches.centre
    for k, name in enumerate("xyz"):
        out["patch"][name] = patches.coefficient[k].T
    out["patch"]["steps"] = steps_needed(chief, some, slopes, LEFT[precision])


def fit_error(chief: ChiefRays, patches: ScreenPatches, slopes: np.ndarray) -> float:
    """Largest error of the parts, in screen pixels along a ray with slopes [2, n]."""
    du, dv = (half * at[:, None] for half, at in zip(patches.half, _CHECK, strict=True))
    exact = _moves(chief, patches.centre[0] + du, patches.centre[1] + dv)
    x, y, z = np.abs(patches.moves(du, dv) - exact)
    pitch = chief.scene.screen.pitch_xy_mm
    return float(max(((across + np.abs(slope) * z) / p).max() for across, slope, p in zip((x, y), slopes, pitch,
                                                                                         strict=True)))  # fmt: skip


def steps_needed(chief: ChiefRays, patches: ScreenPatches, slopes: np.ndarray, left_px: float) -> int:
    """Steps from the tangent plane that leave at most left_px screen pixels in the parts' corners, found by trial."""
    pitch, most = np.array(chief.scene.screen.pitch_xy_mm)[:, None], np.zeros(MAX_STEPS + 1)
    for corner in ((-1, -1), (-1, 1), (1, -1), (1, 1), (0, 1), (1, 0)):
        at = patches.half * np.array(corner)[:, None]
        moves = patches.moves(*at) - patches.coefficient[:, 0]
        goal = at + moves[:2] - slopes * moves[2]
        with np.errstate(over="ignore", invalid="ignore"):  # where steps lead away
            left = [np.abs((patches.met(goal, slopes, steps) - at) / pitch).max() for steps in range(MAX_STEPS + 1)]
        most = np.maximum(most, left)
    enough = np.flatnonzero(most <= left_px)
    if not len(enough):
        raise ValueError(
            f"scene {chief.scene.name}: screen.shape: rays do not find the bent screen, which turns away from them "
            "over a detector pixel's light; must be flatter, or more of its pixels be behind it"
        )
    return int(enough[0])


def _moves(chief: ChiefRays, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Moves [3, ...] of the pixels at the places u, v [...] of the grid, from there."""
    x, y, z = np.moveaxis(chief.screen_model.surface.points(u, v), -1, 0)
    return np.stack([x - u, y - v, z])


def _parts(chief: ChiefRays, visible_pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles and half-sizes [2, n] in mm of what detector pixels see on the screen, or nearest to it."""
    screen = chief.scene.screen
    size, pitch = np.array(screen.pixels)[:, None], np.array(screen.pitch_xy_mm)[:, None]
    low, high = (edge.reshape(-1, 2)[visible_pixels].T for edge in chief.landing_range())
    low, high = np.where(np.isfinite(low), low, -0.5), np.where(np.isfinite(high), high, size - 0.5)
    low, high = (np.clip(edge, -0.5, size - 0.5) for edge in (low - AROUND, high + AROUND))
    middle = ((low + high) / 2 - (size - 1) / 2) * pitch + np.array(screen.centre_offset_mm)[:, None]
    return middle, np.maximum((high - low) / 2, AROUND) * pitch


def _slopes(chief: ChiefRays, visible_pixels: np.ndarray) -> np.ndarray:
    """Slopes [2, n] du/dz, dv/dz at the screen of the steepest rays of detector pixels; 0 where none arrives."""
    points, u, v = chief.rims.at(visible_pixels)
    way = (chief.screen_model.to_world(u, v) - points) @ chief.screen_frame.axes.T
    slopes = np.moveaxis(way[..., :2] / way[..., 2:], -1, 0)  # [2, n, rim]
    steepest = np.argmax(np.nan_to_num(np.abs(slopes)), -1)[..., None]
    return np.nan_to_num(np.take_along_axis(slopes, steepest, -1)[..., 0])
