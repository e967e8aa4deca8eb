"""The planes in which a screen's pixels lie, and directions of light to them, in float64. World frame, mm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.optics.chief_rays import ChiefRays

STEP = 0.5  # of a pixel, for derivatives


@dataclass(frozen=True)
class ScreenFacets:
    """Of the screen's pixels, row by row [n].

    u, v: their places on the grid. axes: [3, 3] of all of them, or [n, 3, 3]: rows x (along the grid's u), y, z (the
    normal away from the mirror; behind a glass that of where they seem to be from the mirror's vertex). side_u, side_v:
    [n, 3] edges, or None for a flat screen.
    """

    chief: ChiefRays
    u: np.ndarray
    v: np.ndarray
    axes: np.ndarray
    side_u: np.ndarray | None = None
    side_v: np.ndarray | None = None

    @classmethod
    def of(cls, chief: ChiefRays) -> ScreenFacets:
        u, v = pixel_centres(chief)
        if chief.screen_model.surface is None:
            return cls(chief, u, v, chief.screen_frame.axes)
        along_u, along_v = chief.screen_model.tangents(*chief.screen_model.seen_places(np.zeros(3), u, v))
        normal = np.cross(along_u, along_v)
        x, z = (vector / np.linalg.norm(vector, axis=-1, keepdims=True) for vector in (along_u, normal))
        sides = (p * along for p, along in zip(chief.scene.screen.pitch_xy_mm, chief.screen_model.tangents(u, v),
                                               strict=True))  # fmt: skip
        return cls(chief, u, v, np.stack([x, np.cross(z, x), z], 1), *sides)

    @property
    def is_flat(self) -> bool:
        return self.side_u is None

    @property
    def points(self) -> np.ndarray:
        """Centres [n, 3]."""
        return self.chief.screen_model.to_world(self.u, self.v)

    @property
    def half_diagonal(self) -> float | np.ndarray:
        """Half of the pixels' diagonals: of all of them, or [n]."""
        if self.side_u is None or self.side_v is None:
            x, y = self.chief.scene.screen.pitch_xy_mm
            return float(x * np.sqrt(0.5) if x == y else np.hypot(x, y) / 2)
        diagonals = (np.linalg.norm(self.side_u + sign * self.side_v, axis=-1) for sign in (-1, 1))
        return np.maximum(*diagonals) / 2

    def from_pixels(self, points: np.ndarray, pixel: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Vectors [n, k, 3] from pixels [n] to points that broadcast to that, as light outside a cover glass goes."""
        u, v = self.u[pixel, None], self.v[pixel, None]
        return points - self.chief.screen_model.seen_from(points, u, v)

    def across(self, vectors: np.ndarray, pixel: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Components [n, ..., 2] of vectors [n, ..., 3] in the planes of the pixels [n]: of unit ones their cosines."""
        if self.axes.ndim == 2:
            return vectors @ self.axes[:2].T
        return np.einsum("n...k,nak->n...a", vectors, self.axes[pixel, :2])

    def cosines(self, rays: np.ndarray, pixel: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Direction cosines [n, ..., 2] of vectors [n, ..., 3] in the planes of the pixels [n]."""
        return self.across(rays, pixel) / np.linalg.norm(rays, axis=-1, keepdims=True)

    def sees(self, points: np.ndarray) -> bool:
        """Whether all pixels have all points [k, 3] before them: as far as rays go that leave them."""
        at, normals = self.points, self.axes[..., 2, :]
        if self.is_flat:
            at, normals = self.chief.screen_frame.position_mm[None], normals[None]
        return bool((points @ normals.T - np.sum(at * normals, -1) < 0).all())

    def seen_sides(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Edges [n, 3] of a bent screen's pixels along u and v, as light in directions [n, 3] has them.

        Behind a glass these are the edges of the image that the glass makes of the pixel: a part of the screen that
        bends towards the viewer is seen larger.
        """
        assert self.side_u is not None and self.side_v is not None
        if self.chief.screen_model.glass is None:
            return self.side_u, self.side_v
        steps = [p * STEP for p in self.chief.scene.screen.pitch_xy_mm]
        sides = []
        for by_u, by_v in ((steps[0], 0.0), (0.0, steps[1])):
            ends = [self._image(self.u + s * by_u, self.v + s * by_v, directions) for s in (-1, 1)]
            sides.append((ends[1] - ends[0]) / (2 * STEP))
        return sides[0], sides[1]

    def _image(self, u: np.ndarray, v: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """World points [n, 3] from where light of the places (u, v) [n] seems to come behind the glass."""
        model = self.chief.screen_model
        far = 1e9  # mm: light of one direction
        return model.seen_from(model.to_world(u, v) + far * directions, u, v)


def pixel_centres(chief: ChiefRays) -> tuple[np.ndarray, np.ndarray]:
    """Places u, v [rows * columns] of the screen's pixels on its grid [mm]."""
    screen = chief.scene.screen
    columns, rows = screen.pixels
    row, column = np.divmod(np.arange(rows * columns), columns)
    return screen.places_mm(column, row)
