"""What is made of a test's height maps: means over exposures and turns of the mirror, and compensators fitted away.

Errors of the instrument turn against the mirror; the mirror's own figure stays. A compensator is a number of the
geometry that is adjusted until the heights are smallest: its map is taken out by least squares over the mirror, beside
piston and tilt, to first order.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from irtscots_cl.budget.averaging import left_by_exposures
from irtscots_cl.budget.geometry import geometry, geometry_derivatives
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Source
from irtscots_cl.budget.turned_maps import TurnedMaps
from irtscots_cl.calibration.consequences import OF_SURFACE
from irtscots_cl.calibration.parameters import known_parameters, zernike_noll
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.row_products import dots_of_rows, sums_of_rows, without_rows
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.validation import nearest, problem

ALIKE = 1e-6  # of the largest singular value: compensators that do the same
NOTHING_MM = 1e-10  # rms per usual value: a compensator that does nothing but rounding


@dataclass(frozen=True)
class Procedure:
    """compensators: names of the geometry. exposures: of each measurement. turns: of the mirror, over a full circle."""

    design: MeasuredDesign = field(repr=False)
    compensators: tuple[str, ...] = ()
    exposures: int = 1
    turns: int = 1

    @classmethod
    def of(cls, design: MeasuredDesign, budget: Budget) -> Procedure:
        """Raises SceneError for an unknown compensator, or turns of a mirror that is not the same one when turned."""
        scene = design.setup.scene
        for name in budget.compensators:
            try:
                geometry(name, scene)
            except ValueError:
                text = f"must be a number of the geometry; {nearest(name, [*known_parameters(scene)])}"
                raise problem(scene.name, ("budget", "compensators"), text, name) from None
        mirror = scene.mirror
        if budget.mirror_turns > 1 and (mirror.off_axis_mm or mirror.polynomial):
            what = f"mirror.off_axis_mm = {mirror.off_axis_mm:g}" if mirror.off_axis_mm else "a [[mirror.polynomial]]"
            text = f"must be 1 with {what}: only a mirror of revolution is the same design when turned"
            raise problem(scene.name, ("budget", "mirror_turns"), text, budget.mirror_turns)
        found = cls(design, budget.compensators, budget.exposures, budget.mirror_turns)
        if found.turns > 1 and (alone := found._turned.alone):
            text = (
                "must turn the mirror's outline, as far as it is seen, into itself: what "
                f"{alone} of {design.count} pixels see of the mirror is not seen after every turn"
            )
            raise problem(scene.name, ("budget", "mirror_turns"), text, found.turns)
        return found

    def on(self, design: MeasuredDesign) -> Procedure:
        """The same on other pixels."""
        return Procedure(design, self.compensators, self.exposures, self.turns)

    @cached_property
    def _turned(self) -> TurnedMaps:
        return TurnedMaps(self.design.seen, self.design.setup.chief_rays.surface.aperture_radius_mm, self.turns)

    def of_parameter(self, source: Source, heights: FloatArray) -> FloatArray:
        """What is left of height maps [..., n] that a source makes the same in every measurement."""
        if self.turns > 1 and not is_figure(source):
            heights = self._turned.mean(heights[None])
        return self.fitted(heights)

    def of_draws(self, source: Source, heights: FloatArray) -> FloatArray:
        """What is left of a process's draws [draws, n], as many: of each mean, the draws of its turns are others."""
        if source.kind.stays:
            return self.of_parameter(source, heights)
        heights = heights * left_by_exposures(self.exposures)
        if self.turns > 1:
            heights = self._turned.mean(np.stack([np.roll(heights, -k, axis=0) for k in range(self.turns)]))
        return self.fitted(heights)

    def of_trial(self, heights: FloatArray, figure: FloatArray | None) -> FloatArray:
        """The map [n] of measurements [turns or 1, n] with everything on. figure: [n] with the mirror's own alone."""
        if self.turns == 1:
            return self.fitted(heights[0])
        if figure is None:
            return self.fitted(self._turned.mean(heights))
        return self.fitted(figure + self._turned.mean(heights - figure))

    @cached_property
    def _maps(self) -> FloatArray:
        """Height maps [compensators, n] of a usual value each."""
        design = self.design
        sources = [geometry(name, design.setup.scene) for name in self.compensators]
        heights = design.response.heights_mm(geometry_derivatives(design, self.compensators))
        maps = [
            one if is_figure(source) or self.turns == 1 else self._turned.mean(one[None])
            for source, one in zip(sources, heights, strict=True)
        ]
        found = np.stack(maps) * np.array([source.usual for source in sources])[:, None]
        return found[np.sqrt(np.mean(found**2, axis=1)) > NOTHING_MM]

    def fitted(self, heights: FloatArray, used: BoolArray | None = None) -> FloatArray:
        """Heights [..., n] without what the compensators take of them. used: [n] pixels of the fit, by default all."""
        if not self.compensators or not len(self._maps):
            return heights
        maps = self._maps
        pixels = slice(None) if used is None else used
        flat = np.ascontiguousarray(np.linalg.qr(self.design.response.basis[pixels, :3])[0].T)
        own, there = without_rows(maps[:, pixels], flat), without_rows(heights[..., pixels], flat)
        size = np.sqrt(np.mean(own**2, axis=1))
        size[size < NOTHING_MM] = np.inf  # only tilt: nothing to fit
        inverse = np.ascontiguousarray(np.linalg.pinv((own / size[:, None]).T, rcond=ALIKE))
        found: FloatArray = heights - sums_of_rows(dots_of_rows(there, inverse), maps / size[:, None])
        return found

    @property
    def text(self) -> str:
        """What is done, in words; "" for nothing."""
        said = []
        if self.exposures > 1:
            said.append(f"mean of {self.exposures} exposures")
        if self.turns > 1:
            said.append(f"mean of {self.turns} turns of the mirror")
        if self.compensators:
            said.append(f"{', '.join(self.compensators)} fitted away")
        return "; ".join(said)


def is_figure(source: Source) -> bool:
    """Whether a source is the mirror's own figure, which turns with it."""
    return source.name in OF_SURFACE or zernike_noll(source.name) is not None
