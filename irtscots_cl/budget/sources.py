"""All error sources by name."""

from __future__ import annotations

from irtscots_cl.budget.brightness import TERMS, Brightness
from irtscots_cl.budget.geometry import PREFIXES, Geometry, geometry
from irtscots_cl.budget.noise import PhotonNoise, PlaceNoise
from irtscots_cl.budget.source import Source
from irtscots_cl.calibration.parameters import known_parameters
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import nearest, problem

_FIXED: dict[str, Source] = {
    source.name: source for source in (*(Brightness(term) for term in TERMS), PlaceNoise(), PhotonNoise())
}


def known_sources(scene: Scene) -> dict[str, Source]:
    """All sources of a scene by name, without the mirror's Zernike terms, which are zernike.4_um and so on."""
    return {name: geometry(name, scene) for name in known_parameters(scene)} | _FIXED


def source_of(name: str, scene: Scene) -> Source:
    """The source of a name. Raises SceneError for an unknown one."""
    if name in _FIXED:
        return _FIXED[name]
    if name.startswith(PREFIXES):
        try:
            return geometry(name, scene)
        except ValueError:
            pass
    raise problem(scene.name, ("budget", "sources", name), f"unknown source; {nearest(name, known_sources(scene))}")


def geometry_sources(sources: list[Source]) -> list[Geometry]:
    """Those of the geometry, which act together."""
    return [source for source in sources if isinstance(source, Geometry)]
