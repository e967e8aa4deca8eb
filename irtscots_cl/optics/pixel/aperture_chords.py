"""Chords through the camera's aperture: how a pixel's light moves along one axis of the screen as it moves over them.

From the ray through the aperture's centre and the eight through its rim. Over the aperture an output is f0 + p a + q b
+ aa a^2 + ab a b + bb b^2, a and b in its radii, so the eight have the first harmonic (p, q), the second ((aa - bb) /
2, ab / 2) and the mean f0 + (aa + bb) / 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.optics.aperture_rims import RIM
from irtscots_cl.optics.chief_rays import ChiefRays

PIXELS_AT_A_TIME = 2**13
_ANGLES = np.arange(len(RIM)) * (2 * np.pi / len(RIM))
# the terms a, b, aa, ab, bb of an output from its nine values, the centre's first
_TERMS = np.zeros((1 + len(RIM), 5))
_TERMS[1:, 0], _TERMS[1:, 1] = (wave(_ANGLES) / 4 for wave in (np.cos, np.sin))
_TERMS[1:, 2], _TERMS[1:, 4] = (1 / 8 + sign * np.cos(2 * _ANGLES) / 4 for sign in (1, -1))
_TERMS[0, [2, 4]], _TERMS[1:, 3] = -1.0, np.sin(2 * _ANGLES) / 2


@dataclass(frozen=True)
class Chords:
    """Chords of n pixels, at their centres, for the screen's x (k = 0) and y (k = 1).

    normal: [2 (a, b), n, k] unit direction on the aperture along which the landing point moves along that axis of the
    screen alone, so that the screen's other edges cut off either a whole chord or nothing. The others are per aperture
    radius along it: slope, bend: [n, k] linear and quadratic term of the landing point [mm]; growth: [n, k] relative,
    of cos^4; mirror: [2 (x, y), n, k] move of the mirror point [mm]. All zero for a pixel some of whose rays miss.
    """

    normal: FloatArray
    slope: FloatArray
    bend: FloatArray
    growth: FloatArray
    mirror: FloatArray

    @classmethod
    def of(cls, chief: ChiefRays, pixels: IntArray) -> Chords:
        """Chords of pixels (flat numbers) near the mirror."""
        found = cls(*(np.empty((*shape, len(pixels), 2)) for shape in ((2,), (), (), (), (2,))))
        for first in range(0, len(pixels), PIXELS_AT_A_TIME):
            part = slice(first, first + PIXELS_AT_A_TIME)
            found._fill(part, _terms(chief, pixels[part]), *_growth(chief, pixels[part]))
        return found

    def _fill(self, part: slice, terms: FloatArray, growth_a: FloatArray, growth_b: FloatArray) -> None:
        """Set some pixels' chords. terms: as of _terms. growth_a, growth_b: [n] of the weight over the aperture."""
        for k in range(2):
            p, q, aa, ab, bb = terms[k]
            a, b = terms[1 - k, 1], -terms[1 - k, 0]  # along it the other coordinate is constant
            still = a * a + b * b == 0
            a, b = np.where(still, p, a), np.where(still, q, b)
            length = np.copysign(np.hypot(a, b), p * a + q * b)
            with np.errstate(invalid="ignore", divide="ignore"):
                a, b = np.nan_to_num(a / length), np.nan_to_num(b / length)
            slope = p * a + q * b
            seen = np.isfinite(slope)
            self.normal[0, part, k], self.normal[1, part, k] = np.where(seen, a, 0.0), np.where(seen, b, 0.0)
            self.slope[part, k] = np.where(seen, slope, 0.0)
            self.bend[part, k] = np.where(seen, aa * a * a + ab * a * b + bb * b * b, 0.0)
            self.growth[part, k] = np.where(seen, growth_a * a + growth_b * b, 0.0)
            for axis in range(2):
                move = terms[2 + axis, 0] * a + terms[2 + axis, 1] * b
                self.mirror[axis, part, k] = np.where(seen, move, 0.0)


def _terms(chief: ChiefRays, pixels: IntArray) -> FloatArray:
    """Terms [4, 5, n] of the outputs u, v, x, y."""
    points, u, v = chief.rims.at(pixels)
    centre, centre_u, centre_v = chief.reverse(*np.divmod(pixels, chief.shape[1]))
    values = np.empty((4, len(pixels), 1 + len(RIM)))
    for output, (middle, rim) in enumerate(
        ((centre_u, u), (centre_v, v), *((centre[:, k], points[..., k]) for k in range(2)))
    ):
        values[output, :, 0], values[output, :, 1:] = middle, rim
    return np.moveaxis(values @ _TERMS, -1, 1)


def _growth(chief: ChiefRays, pixels: IntArray) -> tuple[FloatArray, FloatArray]:
    """Relative growth [n] of the weight cos^4 of the pixels' light per aperture radius along a and along b."""
    camera = chief.scene.camera
    x, y = (v / camera.image_distance_mm for v in chief.camera_model.image_point(*np.divmod(pixels, chief.shape[1])))
    cosine2 = 1 / (1 + x**2 + y**2)
    reach = camera.aperture_diameter_mm / 2 / camera.focus_mm
    return 4 * x * cosine2 * reach, 4 * y * cosine2 * reach
