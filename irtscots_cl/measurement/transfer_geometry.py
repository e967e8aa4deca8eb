"""What the instrument transfer function needs of a detector pixel: where its light comes from, to first order.

A ray of a pixel's light is told by its point on the pixel (s, t in half pixels along column and row) and on the
camera's aperture (a, b in radii). The mirror point and the place on the screen change with these four numbers
(optics/pixel/ray_map.py): the mirror points of a pixel are a parallelogram, widened by the aperture's disk where the
camera is not focused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.light_profiles import sampling_error
from irtscots_cl.measurement.surface_heights import triangulated
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.pixel.ray_map import RayMap
from irtscots_cl.optics.setup import Setup

STEP_MM = 1e-3  # on the screen, for derivatives
LINE_STEP = 0.01  # of the lines' distance, for those of line sampling
WHOLE = 1 - 1e-9  # least share of a pixel's footprint on the mirror: a pixel on the rim is another instrument


def whole_pixels(setup: Setup) -> BoolArray:
    """Pixels [rows, columns] whose whole footprint lies on the mirror and whose light comes from the screen."""
    footprint = setup.chief_rays.footprint
    whole: BoolArray = (footprint.coverage >= WHOLE) & np.isfinite(footprint.u_mm + footprint.v_mm)
    return whole


@dataclass(frozen=True)
class TransferGeometry:
    """Of n pixels of a design.

    x_mm, y_mm: [n] the mirror point in the middle. pixel: [n, 2, 2] its change by a whole pixel along column and row,
    in x and y [mm]. aperture: [n, 2, 2] that by a and b. light: [n, 2, 4] change of the place u, v on the screen by
    s, t, a, b [mm]. slopes: [n, 2, 2] change of the slopes in x, y by u, v [rad/mm]. number: [n] flat, of the pixels.
    """

    setup: Setup = field(repr=False)
    number: IntArray
    x_mm: FloatArray
    y_mm: FloatArray
    pixel: FloatArray = field(repr=False)
    aperture: FloatArray = field(repr=False)
    light: FloatArray = field(repr=False)
    slopes: FloatArray = field(repr=False)

    @classmethod
    def of(cls, setup: Setup, number: IntArray) -> TransferGeometry:
        """number: [n] flat numbers of pixels that see mirror and screen."""
        chief = setup.chief_rays
        maps = RayMap.of(chief, *np.divmod(number, chief.shape[1]))
        x, y, u, v = (maps.term(output) for output in "xyuv")
        derivative = {o: np.stack([maps.term(o, m) for m in "stab"], -1) for o in "xyuv"}
        mirror = np.stack([derivative["x"], derivative["y"]], -1)  # [n, 4, 2]
        z = chief.surface.sag(x, y)
        first = triangulated(chief, x, y, z, u, v)
        moved = (triangulated(chief, x, y, z, u + du, v + dv) for du, dv in ((STEP_MM, 0.0), (0.0, STEP_MM)))
        slopes = np.stack([np.stack([a - b for a, b in zip(m, first, strict=True)], -1) for m in moved], -1) / STEP_MM
        light = np.stack([derivative["u"], derivative["v"]], 1)
        return cls(setup, number, x, y, 2 * mirror[:, :2], mirror[:, 2:], light, slopes)

    def part(self, chosen: slice) -> TransferGeometry:
        """Some of the pixels."""
        arrays = (self.x_mm, self.y_mm, self.pixel, self.aperture, self.light, self.slopes)
        return TransferGeometry(self.setup, self.number[chosen], *(values[chosen] for values in arrays))

    def turns(self, k_per_mm: FloatArray) -> FloatArray:
        """Phases [n, m, 2] by which waves k [m, 2] rad/mm turn from pixel to pixel along column and row."""
        turned: FloatArray = np.einsum("ndx,mx->nmd", self.pixel, k_per_mm)
        return turned

    def waves(self, turns: FloatArray) -> FloatArray:
        """Waves [n, m, 2] rad/mm by their turns [n, m, 2] from pixel to pixel: what `turns` undoes."""
        found: FloatArray = np.einsum("nxd,nmd->nmx", np.linalg.inv(self.pixel), turns)
        return found

    @cached_property
    def line_gain(self) -> FloatArray:
        """How much the centroids u, v of the line scans' light curves move with the light, [n, 2]: 1 but for sampling.

        NaN where the light has no model.
        """
        lines, light = LineScan(self.setup.scene), PixelLight.of(self.setup.chief_rays, self.number)
        gain = []
        for axis, output in zip("xy", "uv", strict=True):
            positions, step = lines.positions_mm(axis), LINE_STEP * lines.spacing_mm(axis)
            centre = light.means(output)[0]
            errors = [
                sampling_error(positions, light, output, centre + sign * step, line_width=lines.line_width)
                for sign in (1.0, -1.0)
            ]
            gain.append(1 + (errors[0] - errors[1]) / (2 * step))
        return np.stack(gain, -1)
