"""The quadric form of a mirror: sag, gradient, where lines meet it. Lengths in mm, float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray


@dataclass(frozen=True)
class Quadric:
    """Surface q_xx x^2 + q_yy y^2 + q_zz z^2 + 2 q_xz x z - 2 z = 0 [1/mm]: through the origin, normal +Z there.

    Every conic of revolution, on axis or not, has this form in the frame of one of its points.
    """

    q_xx: float
    q_yy: float
    q_zz: float
    q_xz: float = 0.0

    @classmethod
    def conic(cls, radius_mm: float, conic: float = 0.0, off_axis_mm: float = 0.0) -> Quadric:
        """Conic of vertex radius radius_mm, seen from its point at off_axis_mm from the axis.

        Below 0 the radius makes it convex, inf a plane. The segment's frame has +Z along the normal and +X away from
        the parent's axis.
        """
        c = 1.0 / radius_mm
        parent = np.diag([c, c, (1.0 + conic) * c])
        root = np.sqrt(1.0 - (1.0 + conic) * (c * off_axis_mm) ** 2)  # half the gradient's z at the point, negated
        gradient = np.hypot(c * off_axis_mm, root)
        sine, cosine = c * off_axis_mm / gradient, root / gradient  # of the normal's tilt towards the axis
        x, z = np.array([cosine, 0.0, sine]), np.array([-sine, 0.0, cosine])
        return cls(
            float(x @ parent @ x / gradient),
            float(c / gradient),
            float(z @ parent @ z / gradient),
            float(x @ parent @ z / gradient),
        )

    def meet(
        self, x0: FloatArray | float, y0: FloatArray | float, p: FloatArray | float, q: FloatArray | float
    ) -> FloatArray:
        """Height z where the lines (x0 + p z, y0 + q z, z) meet the surface nearest the origin; NaN if they miss.

        Only points of the parent whose normal has an upward component count: not those above its widest circle or on
        the second sheet of a hyperboloid.
        """
        a = self.q_xx * p * p + self.q_yy * q * q + self.q_zz + 2.0 * self.q_xz * p
        b = 1.0 - (self.q_xx * x0 * p + self.q_yy * y0 * q + self.q_xz * x0)
        c = self.q_xx * x0 * x0 + self.q_yy * y0 * y0
        with np.errstate(invalid="ignore", divide="ignore"):
            z = c / (b + np.sqrt(b * b - a * c))
            return np.where(self.q_zz * z + self.q_xz * (x0 + p * z) < 1.0, z, np.nan)

    def gradient(self, x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Slopes dz/dx, dz/dy of the surface at its points (x, y, z)."""
        down = 1.0 - self.q_zz * z - self.q_xz * x
        return (self.q_xx * x + self.q_xz * z) / down, self.q_yy * y / down
