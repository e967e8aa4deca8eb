"""All error sources by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from irtscots_cl.budget.air_gradient import AXES, TemperatureGradient
from irtscots_cl.budget.brightness import TERMS, Brightness
from irtscots_cl.budget.detector import Quantisation, ReadNoise, SceneNoise, has_noise
from irtscots_cl.budget.diffraction import Diffraction
from irtscots_cl.budget.efficiency import Efficiency
from irtscots_cl.budget.geometry import PREFIXES, Geometry, geometry
from irtscots_cl.budget.motion import DRIFT, VIBRATION, Drift, Vibration
from irtscots_cl.budget.noise import PhotonNoise, PlaceNoise
from irtscots_cl.budget.response_curve import ResponsePower
from irtscots_cl.budget.screen_light import BrightnessDrift, DeadPixels, FrameBrightness, PixelBrightness
from irtscots_cl.budget.source import Source
from irtscots_cl.budget.stray_light import UniformLight
from irtscots_cl.budget.turbulence import Turbulence
from irtscots_cl.calibration.parameters import known_parameters
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import nearest, problem

if TYPE_CHECKING:
    from irtscots_cl.imaging.stray_files import StrayMaps
    from irtscots_cl.scene.height_map import MirrorMap

_FIXED: dict[str, Source] = {
    source.name: source
    for source in (
        *(Brightness(term) for term in TERMS),
        PixelBrightness(),
        FrameBrightness(),
        BrightnessDrift(),
        PlaceNoise(),
        PhotonNoise(),
        *(TemperatureGradient(axis) for axis in AXES),
        Turbulence(),
        Diffraction(),
        ReadNoise(),
        Quantisation(),
        *(Efficiency(axis) for axis in "xy"),
        *(ResponsePower(of) for of in ("screen", "detector")),
        DeadPixels(),
        UniformLight(),
    )
}

STRAY = ("stray.ghosts", "stray.scatter")  # of a file: budget/stray_paths.py
FORM = ("mirror.radius_relative", "mirror.conic")  # which a flat mirror has not


def known_sources(
    scene: Scene, stray: Mapping[str, StrayMaps] | None = None, maps: Sequence[MirrorMap] = ()
) -> dict[str, Source]:
    """Sources of a scene by name, without the mirror's Zernike terms (zernike.4_um and so on) and without motion, which
    each number of the geometry can have (vibration.camera.x_mm, drift.camera.x_mm).

    stray: maps of the budget's file of stray light, by kind; None without one. maps: tables of the mirror's maps.
    """
    of_scene = (SceneNoise(),) if has_noise(scene.camera.detector.noise) else ()
    flat = FORM if scene.mirror.is_flat else ()
    of_geometry = {name: geometry(name, scene) for name in known_parameters(scene) if name not in flat}
    known = of_geometry | _FIXED | {source.name: source for source in of_scene}
    if stray:
        from irtscots_cl.budget.stray_paths import known_stray  # imported late: few budgets have such a file

        known |= known_stray(stray)
    if maps:
        from irtscots_cl.budget.mirror_map import known_maps  # imported late: few mirrors have maps

        known |= known_maps(maps)
    return known


def source_of(
    name: str, scene: Scene, stray: Mapping[str, StrayMaps] | None = None, maps: Sequence[MirrorMap] = ()
) -> Source:
    """The source of a name. stray, maps: as of known_sources.

    Raises SceneError for an unknown one, or one of stray light that no file has.
    """
    if name in _FIXED:
        return _FIXED[name]
    if name in STRAY:
        from irtscots_cl.budget.stray_paths import stray_source

        return stray_source(name, scene, stray)
    if maps:
        from irtscots_cl.budget.mirror_map import known_maps

        if name in (on_mount := known_maps(maps)):
            return on_mount[name]
    if name == SceneNoise.name and has_noise(scene.camera.detector.noise):
        return SceneNoise()
    moving = next((prefix for prefix in (VIBRATION, DRIFT) if name.startswith(prefix)), "")
    of = name.removeprefix(moving)
    if of.startswith(PREFIXES) and not (of in FORM and scene.mirror.is_flat):
        try:
            found = geometry(of, scene)
        except ValueError:
            pass
        else:
            return {VIBRATION: Vibration, DRIFT: Drift}[moving](found) if moving else found
    motion = (prefix + of for prefix in (VIBRATION, DRIFT) for of in known_parameters(scene))
    known = [*known_sources(scene, maps=maps), *STRAY, *motion]
    raise problem(scene.name, ("budget", "sources", name), f"unknown source; {nearest(name, known)}")


def geometry_sources(sources: list[Source]) -> list[Geometry]:
    """Those of the geometry, which act together."""
    return [source for source in sources if isinstance(source, Geometry)]
