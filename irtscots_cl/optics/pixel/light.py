"""The light of detector pixels: in closed form where that holds, traced where it does not."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.pixel.response import PixelResponse
from irtscots_cl.optics.pixel.traced_light import TracedLight


@dataclass(frozen=True)
class PixelLight:
    """The light of a scene's pixels. pixels: [n] flat numbers.

    closed_form: [n] whether a pixel's light has a closed form. parts: the light of the pixels with one and of those
    without, for each kind that there is, with the indices [m] of its pixels.
    """

    chief: ChiefRays
    pixels: np.ndarray
    closed_form: np.ndarray
    parts: tuple[tuple[np.ndarray, PixelResponse | TracedLight], ...] = field(repr=False)

    @classmethod
    def of(cls, chief: ChiefRays, pixels: np.ndarray | None = None) -> PixelLight:
        """The light of some pixels (flat numbers), or of all that can see the mirror."""
        return cls.around(PixelResponse.of(chief, pixels))

    @classmethod
    def around(cls, light: PixelResponse) -> PixelLight:
        """The closed form, with traced light where it does not hold."""
        closed = light.valid()
        index, others = np.flatnonzero(closed), np.flatnonzero(~closed)
        parts: list[tuple[np.ndarray, PixelResponse | TracedLight]] = []
        if index.size:
            own = PixelResponse(light.chief, light.pixels[index], light.maps.part(index)) if others.size else light
            parts.append((index, own))
        if others.size:
            parts.append((others, TracedLight.of(light.chief, light.pixels[others])))
        return cls(light.chief, light.pixels, closed, tuple(parts))

    def valid(self) -> np.ndarray:
        """Whether the light of each pixel [n] is known, by either way."""
        known = np.zeros(len(self.pixels), bool)
        for index, part in self.parts:
            known[index] = part.valid()
        return known

    def coverage(self) -> np.ndarray:
        """Share [n] of each pixel's footprint that lies on the mirror."""
        return self._gathered("coverage")

    def means(self, outputs: str) -> np.ndarray:
        """Means [outputs, n] in mm over each pixel's light, of "u", "v", "x", "y"; NaN without any."""
        return self._gathered("means", outputs)

    def extent(self, output: str) -> tuple[np.ndarray, np.ndarray]:
        """Middle [n] of the pixels' light on the screen and its half-extent, along "u" or "v", in mm; not finite if
        there is none."""
        middle, half = self._gathered("extent", output)
        return middle, half

    def light(self, output: str, edges_mm: np.ndarray) -> np.ndarray:
        """Shares [n, lines] of the pixels' areas, times cos^4, between adjacent edges_mm [n, lines + 1] of u or v."""
        share = np.zeros((len(self.pixels), edges_mm.shape[1] - 1))
        for index, part in self.parts:
            share[index] = part.light(output, edges_mm[index])
        return share

    def _gathered(self, name: str, *arguments: str) -> np.ndarray:
        """Values [..., n] of a method of the parts."""
        found = [(index, np.asarray(getattr(part, name)(*arguments))) for index, part in self.parts]
        if len(found) == 1:
            return found[0][1]
        values = np.full((*found[0][1].shape[:-1], len(self.pixels)), np.nan)
        for index, of_part in found:
            values[..., index] = of_part
        return values


def whole_flux_w(chief: ChiefRays) -> float:
    """Flux in W of a pixel on the lens's axis that sees nothing but the mirror and the screen in it: a share of 1."""
    scene = chief.scene
    area = np.pi / 4 * scene.camera.aperture_diameter_mm**2 * chief.camera_model.pixel_area_mm2
    gain = scene.screen.radiance * scene.mirror.reflectance * scene.camera.transmittance
    return float(gain * area / scene.camera.image_distance_mm**2)
