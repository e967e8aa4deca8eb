"""The mirror's surface in float64 on the host: sag, slopes and where lines meet it. Mirror frame, mm.

The device kernels have their own single-precision versions (kernels/mirror/surface_*.cl, kernels/mirror/mirror_*.cl).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.maths.zernike.indices import index_to_nm
from irtscots_cl.maths.zernike.series import RadialSeries, evaluate_series, radial_series
from irtscots_cl.system import interruption

# polynomials overflow far outside the mirror; a ray parallel to z = 0 has no point there
_BESIDE = np.errstate(over="ignore", invalid="ignore", divide="ignore")


@dataclass(frozen=True)
class Surface:
    """Design quadric plus an optional Zernike deviation along z, inside a circular or annular aperture.

    deviation: series of Zernike terms in mm over the disk of radius deviation_radius_mm, or None.
    """

    quadric: Quadric
    aperture_radius_mm: float
    obscuration_radius_mm: float = 0.0
    deviation: RadialSeries | None = None
    deviation_radius_mm: float = 1.0

    @classmethod
    def of(cls, mirror) -> Surface:
        """Surface of a scene's mirror (irtscots_cl.scene.Mirror)."""
        coefficients: dict[tuple[int, int], float] = {}
        for terms in mirror.zernike:
            for index, value_um in terms.coefficients_um.items():
                nm = index_to_nm(index, terms.ordering)
                coefficients[nm] = coefficients.get(nm, 0.0) + value_um * 1e-3
        coefficients = {nm: value for nm, value in coefficients.items() if value != 0}
        return cls(
            Quadric.conic(mirror.radius_mm, mirror.conic, mirror.off_axis_mm),
            mirror.diameter_mm / 2,
            mirror.obscuration_mm / 2,
            radial_series(coefficients) if coefficients else None,
            mirror.zernike[0].radius_mm if coefficients else 1.0,
        )

    def contains(self, x_mm, y_mm, margin_mm: float = 0.0) -> np.ndarray:
        """Whether points lie in the aperture, widened by margin_mm at its rim and at the hole's."""
        radius = np.hypot(x_mm, y_mm)
        return (radius <= self.aperture_radius_mm + margin_mm) & (radius >= self.obscuration_radius_mm - margin_mm)

    @_BESIDE
    def deviation_at(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Deviation from the design [mm] and its slopes dz/dx, dz/dy at points of any one shape."""
        if self.deviation is None:
            zero = np.zeros(np.broadcast_shapes(np.shape(x_mm), np.shape(y_mm)))
            return zero, zero, zero
        scale = 1.0 / self.deviation_radius_mm
        height, slope_x, slope_y = evaluate_series(self.deviation, x_mm * scale, y_mm * scale)
        return height, slope_x * scale, slope_y * scale

    def sag(self, x_mm, y_mm) -> np.ndarray:
        """Height of the surface above z = 0 [mm]."""
        return self.quadric.meet(x_mm, y_mm, 0.0, 0.0) + self.deviation_at(x_mm, y_mm)[0]

    def gradient(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray]:
        """Slopes dz/dx, dz/dy of the surface."""
        design = self.quadric.gradient(x_mm, y_mm, self.quadric.meet(x_mm, y_mm, 0.0, 0.0))
        _, slope_x, slope_y = self.deviation_at(x_mm, y_mm)
        return design[0] + slope_x, design[1] + slope_y

    @_BESIDE
    def meet(self, points_mm, directions, newton_steps: int = 2) -> tuple[np.ndarray, np.ndarray]:
        """Follow rays from world points [..., 3] along directions [..., 3] to the surface.

        Returns the points [..., 3] (NaN where a ray misses the surface; the aperture is ignored) and the
        directions after reflection [..., 3] (not normalised).
        """
        p, q = directions[..., 0] / directions[..., 2], directions[..., 1] / directions[..., 2]
        x0, y0 = points_mm[..., 0] - points_mm[..., 2] * p, points_mm[..., 1] - points_mm[..., 2] * q
        base = z = self.quadric.meet(x0, y0, p, q)
        x, y = x0 + p * z, y0 + q * z
        interruption.check()  # maps of a large detector take seconds
        slope_x, slope_y = self.quadric.gradient(x, y, z)
        # polynomials grow fast outside their disk: from 2 % outside, beyond any mirror, use the design surface
        defined = np.hypot(x, y) <= 1.02 * self.deviation_radius_mm
        for _ in range(newton_steps if self.deviation is not None else 0):
            height = np.where(defined, self.deviation_at(x, y)[0], 0.0)
            z = base + height / (1.0 - p * slope_x - q * slope_y)
            x, y = x0 + p * z, y0 + q * z
        interruption.check()
        slope_x, slope_y = self.gradient(x, y)
        interruption.check()
        normal = np.stack([-slope_x, -slope_y, np.ones_like(z)], -1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        interruption.check()
        outgoing = directions - 2.0 * np.sum(directions * normal, -1, keepdims=True) * normal
        return np.stack([x, y, z], -1), outgoing
