"""A scene with all that follows from it in float64: each is made once, when it is first asked for."""

from __future__ import annotations

from functools import cached_property

from irtscots_cl.optics.aim import Aim, find_camera_aim, find_mirror_aim
from irtscots_cl.optics.chief_rays import ChiefRays, trace_chief_rays
from irtscots_cl.optics.elements.components import Component, components_of
from irtscots_cl.optics.elements.direct_light import longest_direct_path
from irtscots_cl.optics.elements.emission import Emission, plan_emission
from irtscots_cl.optics.elements.polarisation import polarisation_change
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.pixel.response import PixelResponse
from irtscots_cl.optics.screen_windows import Windows, place_windows
from irtscots_cl.scene.model import Scene


class Setup:
    """Owns what is derived from one scene. Pass it down instead of the scene, so that nothing is derived twice.

    The properties raise ValueError if the scene has more pixels than the memory can hold maps of.
    """

    def __init__(self, scene: Scene):
        self.scene = scene
        self._windows: dict[int, Windows] = {}
        self._emissions: dict[float, Emission] = {}

    @classmethod
    def of(cls, scene: Scene | Setup) -> Setup:
        """A set-up as it is, or a new one of a scene."""
        return scene if isinstance(scene, Setup) else cls(scene)

    @cached_property
    def nominal(self) -> Setup:
        """The set-up with the mirror's design: all that the measuring half may know."""
        nominal = self.scene.nominal()
        return self if nominal == self.scene else Setup(nominal)

    @cached_property
    def chief_rays(self) -> ChiefRays:
        return trace_chief_rays(self.scene)

    @cached_property
    def pixel_response(self) -> PixelResponse:
        return PixelResponse.of(self.chief_rays)

    @cached_property
    def pixel_light(self) -> PixelLight:
        """As pixel_response, with traced light where the closed form does not hold."""
        return PixelLight.around(self.pixel_response)

    @cached_property
    def mirror_aim(self) -> Aim:
        return find_mirror_aim(self.chief_rays)

    @cached_property
    def camera_aim(self) -> Aim:
        return find_camera_aim(self.chief_rays, self.mirror_aim)

    @cached_property
    def components(self) -> tuple[Component, ...]:
        return components_of(self.scene)

    @cached_property
    def longest_direct_path(self) -> int:
        return longest_direct_path(self.chief_rays, self.components)

    @cached_property
    def polarisation_change(self) -> float:
        """Largest relative change of the direct light by its polarisation between interfaces, an estimate."""
        return polarisation_change(self.chief_rays, self.components)

    def emission(self, overfill: float) -> Emission:
        """The non-sequential estimator's, with a mirror's cone of `overfill` times the area."""
        if overfill not in self._emissions:
            measuring = tuple(element.name for element in self.scene.element if element.kind == "detector")
            aim = self.mirror_aim.overfilled(overfill)
            self._emissions[overfill] = plan_emission(self.chief_rays, self.components, measuring, aim)
        return self._emissions[overfill]

    def windows(self, margin: int) -> Windows:
        """Windows widened by margin screen pixels."""
        if margin not in self._windows:
            self._windows[margin] = place_windows(self.chief_rays, margin)
        return self._windows[margin]
