"""All error sources by name."""

from __future__ import annotations

from irtscots_cl.budget.air_gradient import AXES, TemperatureGradient
from irtscots_cl.budget.brightness import TERMS, Brightness
from irtscots_cl.budget.detector import Quantisation, ReadNoise, SceneNoise, has_noise
from irtscots_cl.budget.diffraction import Diffraction
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
        *(ResponsePower(of) for of in ("screen", "detector")),
        DeadPixels(),
        UniformLight(),
    )
}

FORM = ("mirror.radius_relative", "mirror.conic")  # which a flat mirror has not


def known_sources(scene: Scene) -> dict[str, Source]:
    """Sources of a scene by name, without the mirror's Zernike terms (zernike.4_um and so on) and without motion, which
    each number of the geometry can have (vibration.camera.x_mm, drift.camera.x_mm)."""
    of_scene = (SceneNoise(),) if has_noise(scene.camera.detector.noise) else ()
    flat = FORM if scene.mirror.is_flat else ()
    of_geometry = {name: geometry(name, scene) for name in known_parameters(scene) if name not in flat}
    return of_geometry | _FIXED | {source.name: source for source in of_scene}


def source_of(name: str, scene: Scene) -> Source:
    """The source of a name. Raises SceneError for an unknown one."""
    if name in _FIXED:
        return _FIXED[name]
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
    known = [*known_sources(scene), *(prefix + of for prefix in (VIBRATION, DRIFT) for of in known_parameters(scene))]
    raise problem(scene.name, ("budget", "sources", name), f"unknown source; {nearest(name, known)}")


def geometry_sources(sources: list[Source]) -> list[Geometry]:
    """Those of the geometry, which act together."""
    return [source for source in sources if isinstance(source, Geometry)]
