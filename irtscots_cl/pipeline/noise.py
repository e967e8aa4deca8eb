"""Simulate the effects of a real camera and screen on images. Only runs with noise import it."""

from __future__ import annotations

from dataclasses import replace

from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.recording import check_recording, has_noise, line_scan, record
from irtscots_cl.optics.setup import Setup
from irtscots_cl.report.noise_facts import noise_facts
from irtscots_cl.report.types import NoiseFacts
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.screen_response import ScreenResponse
from irtscots_cl.system.option_error import OptionError
from irtscots_cl.tracing.options import ANALYTIC, NONSEQUENTIAL
from irtscots_cl.tracing.results.transport import LineLight, Transport


def set_up_noise(
    setup: Setup, noise: DetectorNoise | None, response: ScreenResponse | None, parts: bool, **trace_options
) -> tuple[Setup, bool]:
    """The set-up with that noise and response in place of its own (None keeps its own), and whether it has any noise.

    parts, trace_options: as of `simulate`. Raises as check_noise does.
    """
    scene = setup.scene
    if noise is not None:
        scene = replace(scene, camera=replace(scene.camera, detector=replace(scene.camera.detector, noise=noise)))
    if response is not None:
        scene = replace(scene, screen=replace(scene.screen, response=response))
    return setup if scene is setup.scene else Setup(scene), check_noise(scene, parts, **trace_options)


def check_noise(
    scene: Scene,
    parts: bool = False,
    *,
    estimator: str = "adjoint",
    smoothing: bool = False,
    replicates: int = 8,
    **_others,
) -> bool:
    """Whether the scene's camera or screen has noise; ValueError if it cannot be simulated so, before rays are traced.

    parts to replicates: as of `simulate`.
    """
    if not has_noise(scene):
        return False
    if parts:
        raise OptionError("--parts: must be left out with noise: the terms are those of images without any")
    response = scene.screen.response
    if response is not None and response.needs_map and (smoothing or estimator in (ANALYTIC, NONSEQUENTIAL)):
        way = "--smoothing" if smoothing else f"--estimator {estimator}"
        raise OptionError(
            f"scene {scene.name}: screen.response: uneven brightness and dead pixels need the light of each screen "
            f"pixel, which {way} does not give; must be traced by adjoint without --smoothing, or by forward"
        )
    check_recording(scene, 1 if estimator == ANALYTIC else replicates)
    return True


def noisy_images(transport: Transport | LineLight) -> tuple[ImageStack, dict[str, NoiseFacts]]:
    """The images of a trace as its scene's screen shows and its camera records them, and the report's word of it."""
    scene = transport.scene
    clean = transport.images(line_scan(scene))
    recorded = record(clean, scene)
    return recorded, {"noise": noise_facts(scene, clean, recorded)}
