"""A made-up laboratory with fringes: its files in SOFAST's formats and its images, traced here in metres.

Written from the definitions of the files, with none of the package's code: OpenCV's camera (x right, y down, z
forward), a screen whose frame has x right, y down and z towards the mirror, and a facet whose surface is a quadratic
with a bump.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

HALF = 0.5  # m, of the square facet
COLUMNS, ROWS = 96, 80
PERIODS = (0.9, 3.9, 15.9)


def turn(vector):
    """Rotation matrix of a rotation vector."""
    vector = np.asarray(vector, float)
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def axis_angle(matrix):
    """Rotation vector of a rotation matrix by less than half a turn."""
    angle = np.arccos(np.clip((np.trace(matrix) - 1) / 2, -1, 1))
    off = matrix - matrix.T
    return np.array([off[2, 1], off[0, 2], off[1, 0]]) / (2 * np.sin(angle)) * angle


@dataclass(frozen=True)
class Lab:
    """curvature: (xx, yy, xy) in 1/m. bump: height in m of a Gaussian of 0.06 m at (0.15, -0.1). bend: relative move of
    the screen's points, quadratic in the place. sag: m at the screen's ends. centre: of the facet's file, m."""

    curvature: tuple[float, float, float] = (1 / 80, 1 / 95, 0.0008)
    bump: float = 0.0
    bend: float = 0.0
    sag: float = 0.0
    size: tuple[float, float] = (5.2, 3.1)
    focal: tuple[float, float] = (560.0, 556.0)
    middle: tuple[float, float] = (46.3, 41.2)
    distortion: tuple[float, ...] = (-0.12, 0.9, 3e-4, -8e-4, 0.0)
    distance: float = 8.0  # of the camera from the facet
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    measured: tuple[float, float, float] = (0.1, 0.05, 0.0)

    # --- where things are: the facet's frame has its origin at the facet's centre, z out of its front ---

    @property
    def camera_at(self):
        way = np.array([-0.13, -0.02, 1.0])
        return self.distance * way / np.linalg.norm(way)

    @property
    def camera_axes(self):
        """Rows: the camera's x, y, z in the facet's frame; looking near the facet's centre, rolled a little."""
        z = np.array([0.01, -0.02, 0.0]) - self.camera_at
        z /= np.linalg.norm(z)
        x = np.cross(z, [0.02, 1.0, 0.0])  # y of the picture points down: about -y of the facet
        x = -x if x[0] < 0 else x
        x /= np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z])

    @property
    def screen_at(self):
        way = np.array([0.14, 0.03, 1.0])
        return 8.4 * way / np.linalg.norm(way)

    @property
    def screen_axes(self):
        z = -self.screen_at / np.linalg.norm(self.screen_at)
        x = np.cross([-0.03, -1.0, 0.0], z)
        x /= np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z]) @ turn([0.02, -0.03, 0.01])

    # --- the facet ---

    def height(self, x, y):
        xx, yy, xy = self.curvature
        bump = self.bump * np.exp(-((x - 0.15) ** 2 + (y + 0.1) ** 2) / (2 * 0.06**2))
        return xx * x**2 / 2 + yy * y**2 / 2 + xy * x * y + bump

    def slopes(self, x, y):
        xx, yy, xy = self.curvature
        bump = self.bump * np.exp(-((x - 0.15) ** 2 + (y + 0.1) ** 2) / (2 * 0.06**2)) / 0.06**2
        return xx * x + xy * y - bump * (x - 0.15), yy * y + xy * x - bump * (y + 0.1)

    # --- the screen: place in its frame of the fractions ---

    def on_screen(self, fraction_x, fraction_y):
        a, b = fraction_x - 0.5, fraction_y - 0.5
        x = self.size[0] * (a + self.bend * (a * a - 0.1 + a * b))
        y = self.size[1] * (b + self.bend * (b * b - a * b))
        return np.stack([x, y, self.sag * 4 * a * a], -1)

    # --- rays ---

    def directions(self, column, row):
        """Unit vectors in the facet's frame in which the camera looks at places of the picture."""
        goal = np.stack([(column - self.middle[0]) / self.focal[0], (row - self.middle[1]) / self.focal[1]])
        at = goal.copy()
        k1, k2, p1, p2, k3 = self.distortion
        for _ in range(25):  # fixed-point iteration of OpenCV's formula
            x, y = at
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            moved = [2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y]
            at = (goal - moved) / radial
        way = np.stack([at[0], at[1], np.ones_like(at[0])], -1) @ self.camera_axes
        return way / np.linalg.norm(way, axis=-1, keepdims=True)

    def points(self, way):
        """Points [..., 3] of the facet's surface, in directions [..., 3] from the camera."""
        step = -self.camera_at[2] / way[..., 2]
        for _ in range(8):  # Newton's method
            x, y, z = np.moveaxis(self.camera_at + way * step[..., None], -1, 0)
            by_x, by_y = self.slopes(x, y)
            step = step - (z - self.height(x, y)) / (way[..., 2] - by_x * way[..., 0] - by_y * way[..., 1])
        return self.camera_at + way * step[..., None]

    def seen(self, column, row):
        """Points [..., 3] of the facet, and the fractions (x, y) of the screen, seen by places of the picture."""
        way = self.directions(column, row)
        points = self.points(way)
        by_x, by_y = self.slopes(points[..., 0], points[..., 1])
        normal = np.stack([-by_x, -by_y, np.ones_like(by_x)], -1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        out = way - 2 * np.sum(way * normal, -1, keepdims=True) * normal
        at, along = (points - self.screen_at) @ self.screen_axes.T, out @ self.screen_axes.T
        fraction = np.full((2, *column.shape), 0.5)
        for _ in range(40):  # secant-like: the bend is small, so that its inverse is nearly the identity
            goal = self.on_screen(*fraction)
            reach = (goal[..., 2] - at[..., 2]) / along[..., 2]
            hit = at + along * reach[..., None]
            fraction = fraction + np.stack([(hit - goal)[..., k] / self.size[k] for k in (0, 1)])
        return points, fraction

    # --- files ---

    def write(self, folder, displays=("rectangular2D",), levels=4095, noise=0.0, seed=1):
        """All files of the laboratory and the measurement; the latter's path. levels: of the images' whole numbers."""
        folder = Path(folder)
        self.write_setup(folder, displays)
        row, column = np.mgrid[:ROWS, :COLUMNS].astype(float)
        _, fraction = self.seen(column, row)
        share = self.coverage()
        frames = [
            0.5 + 0.45 * np.cos(2 * np.pi * periods * place - step * np.pi / 2)
            for place in (1 - fraction[1], fraction[0])
            for periods in PERIODS
            for step in range(4)
        ]
        images = np.stack([0.02 + share * 0.9 * frame for frame in frames], -1)
        masks = np.stack([np.full(share.shape, 0.02), 0.02 + 0.9 * share], -1)
        if noise:
            images = images + noise * np.random.default_rng(seed).standard_normal(images.shape)
        path = folder / "measurement.h5"
        with h5py.File(path, "w") as file:
            group = file.create_group("MeasurementSofastFringe")
            group["fringe_images"] = np.rint(np.clip(images, 0, 1) * levels).astype(np.uint16)
            group["mask_images"] = np.rint(masks * levels).astype(np.uint16)
            group["fringe_periods_x"] = group["fringe_periods_y"] = np.array(PERIODS)
            group["dist_optic_screen"] = self.measured_distance()
            group["v_measure_point_facet"] = np.add(self.measured, self.centre)
            group["name"], group["date"] = "a made-up facet", "2024-05-06"
        return path

    def measured_distance(self):
        x, y, _ = self.measured
        return float(np.linalg.norm(self.screen_at - [x, y, self.height(x, y)]))

    def coverage(self, parts=8):
        """Share [rows, columns] of each pixel that sees the facet."""
        step = (np.arange(parts) + 0.5) / parts - 0.5
        share = np.zeros((ROWS, COLUMNS))
        row, column = np.mgrid[:ROWS, :COLUMNS].astype(float)
        for down in step:
            for right in step:
                points = self.points(self.directions(column + right, row + down))
                share += (np.abs(points[..., 0]) < HALF) & (np.abs(points[..., 1]) < HALF)
        return share / parts**2

    def write_setup(self, folder, displays=("rectangular2D",)):
        with h5py.File(folder / "camera.h5", "w") as file:
            matrix = np.array([[self.focal[0], 0, self.middle[0]], [0, self.focal[1], self.middle[1]], [0, 0, 0.125]])
            file["Camera/intrinsic_mat"] = matrix
            file["Camera/distortion_coef"] = np.array(self.distortion)
            file["Camera/image_shape_xy"] = np.array([COLUMNS, ROWS])
            file["Camera/name"] = "a camera"
        for model in displays:
            self.write_display(folder / f"display_{model}.h5", model)
        with h5py.File(folder / "orientation.h5", "w") as file:
            file["SpatialOrientation/r_cam_screen"] = axis_angle(self.screen_axes @ self.camera_axes.T)
            seen = (self.screen_at - self.camera_at) @ self.camera_axes.T
            file["SpatialOrientation/v_cam_screen_cam"] = seen[:, None]
            file["SpatialOrientation/optic_oriented"] = False
        corners = np.array([[1, -1, -1, 1], [-1, -1, 1, 1], [0, 0, 0, 0]]) * HALF + np.array(self.centre)[:, None]
        table = {
            "v_facet_corners": dict(zip("xyz", corners.tolist(), strict=True)),
            "v_centroid_facet": {axis: [value] for axis, value in zip("xyz", self.centre, strict=True)},
        }
        (folder / "facet.json").write_text(json.dumps(table))

    def write_display(self, path, model, nodes=9):
        fraction = np.stack(np.meshgrid(np.linspace(0.005, 0.995, nodes), np.linspace(0.01, 0.99, nodes))).reshape(
            2, -1
        )
        points = self.on_screen(*fraction).T
        with h5py.File(path, "w") as file:
            group = file.create_group("DisplayShape")
            group["name"], group["screen_model"] = f"a screen, {model}", model
            if model == "rectangular2D":
                group["screen_x"], group["screen_y"] = self.size
            else:
                group["xy_screen_fraction"] = fraction
                key, axes = ("xy_screen_coords", 2) if model == "distorted2D" else ("xyz_screen_coords", 3)
                group[key] = points[:axes]
