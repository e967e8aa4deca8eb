"""All that can be said of a scene before a ray is traced: mistakes, what will be measured, how well, at what cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.planning.finding import LEVELS, Finding
from irtscots_cl.planning.light import check_light
from irtscots_cl.planning.mistakes import find_mistakes
from irtscots_cl.planning.obstruction import check_obstruction
from irtscots_cl.planning.sight import Sight
from irtscots_cl.planning.view import check_view
from irtscots_cl.scene.model import Scene
from irtscots_cl.tracing.defaults import RAYS_PER_PIXEL


@dataclass(frozen=True)
class SceneCheck:
    """sight: rays between mirror, camera and screen. findings: the worst first."""

    sight: Sight
    findings: tuple[Finding, ...]

    @property
    def measured(self) -> float:
        """Share of the mirror's area that the test measures."""
        return self.sight.measured

    @property
    def worst(self) -> str:
        """The highest level of the findings; "info" without any."""
        return self.findings[0].level if self.findings else "info"


def check_scene(
    scene: Scene,
    *,
    detail_mm: float | None = None,
    periods: Sequence[float] = (),
    steps: int = 4,
    heights: bool = True,
    device: Device | None = None,
    rays_per_pixel: int = RAYS_PER_PIXEL,
    replicates: int = 8,
) -> SceneCheck:
    """Check a scene.

    detail_mm: shortest period of ripples that is to be measured. periods, steps: of fringes that are to be shown.
    heights: also what height error to expect, a few seconds. device: whose speed is tried for the cost; None for none.
    rays_per_pixel, replicates: of the run whose cost is asked for.
    """
    sight = Sight.of(scene)
    found = look(sight, detail_mm)
    if sight.measured > 0:
        from irtscots_cl.planning.exposure import check_exposure  # imported late: `look`, of each run, wants none

        setup = Setup(scene)
        found += check_exposure(setup.nominal)
        if periods:
            from irtscots_cl.planning.fringes import check_fringes

            found += check_fringes(setup.nominal, periods, steps)
        if heights:
            from irtscots_cl.planning.heights import expected_heights

            found += expected_heights(setup)
        if device is not None:
            from irtscots_cl.planning.cost import check_cost

            found += check_cost(setup, device, rays_per_pixel, replicates)
    return SceneCheck(sight, tuple(sorted(found, key=lambda one: LEVELS.index(one.level))))


def look(sight: Sight, detail_mm: float | None = None) -> list[Finding]:
    """What a few hundred rays tell: mistakes, the mirror's image and its light, devices in the way. Milliseconds."""
    return find_mistakes(sight) + check_view(sight, detail_mm) + check_light(sight) + check_obstruction(sight)
