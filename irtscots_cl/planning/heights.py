"""The height error to expect of a test, by its parts, before a ray is traced: all from the design."""

from __future__ import annotations

from dataclasses import replace

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.calibration.identification import identify
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.pattern_design.choice import design_patterns
from irtscots_cl.optics.setup import Setup
from irtscots_cl.planning.finding import Finding
from irtscots_cl.system.option_error import on_command_line
from irtscots_cl.tracing.options import ANALYTIC
from irtscots_cl.tracing.trace import trace

MOST_PIXELS = 250_000  # of the detector: more take long
MOST_LINES = 1200  # of the screen, both axes


def expected_heights(setup: Setup) -> list[Finding]:
    """Height errors in nm rms, piston and tilt removed: of the method, of the camera's noise, of the geometry."""
    parts = [
        (_of_method, "height-error-method"),
        (_of_noise, "height-error-noise"),
        (_of_geometry, "height-error-geometry"),
    ]
    found = []
    for part, code in parts:
        try:
            found.append(Finding(code, "info", part(setup)))
        except ValueError as error:
            found.append(Finding(code, "info", f"not known: {on_command_line(error)}"))
    return found


def _of_method(setup: Setup) -> str:
    """Line scans without noise, by closed-form light curves."""
    scene = setup.scene
    if not scene.is_sequential:
        raise ValueError("the scene is more than a mirror and a paraxial camera")
    columns, rows = scene.camera.detector.pixels
    if columns * rows > MOST_PIXELS or sum(scene.screen.pixels) > MOST_LINES:
        raise ValueError("too many pixels for a quick look; `irtscots run --estimator analytic` computes it")
    clean = Setup(replace(
        scene,
        camera=replace(scene.camera, detector=replace(scene.camera.detector, noise=None)),
        screen=replace(scene.screen, response=None),
    ))  # fmt: skip
    stack = trace(clean, estimator=ANALYTIC).images(LineScan(clean.scene))
    heights = {
        name: compare(measure_by(name, stack, clean.nominal), clean.scene).height_error_nm["piston_tilt"].value
        for name in ("paper", "fine")
    }
    words = ", ".join(f"{nm:.3g} nm with --measure {name}" for name, nm in heights.items())
    return f"a line scan without any noise: {words}"


def _of_noise(setup: Setup) -> str:
    """The camera's noise in the best patterns."""
    design = design_patterns(setup)
    best = design.best
    if best is None:
        raise ValueError("no set of patterns can be recommended; see `irtscots design-patterns`")
    table = setup.scene.camera.detector.noise
    whose = "the scene's camera" if table is not None else "a usual camera (the scene says nothing of noise)"
    return f"noise of {whose} with {best.name}: {best.nm_frames:.3g} nm in {design.frames} frames"


def _of_geometry(setup: Setup) -> str:
    """What images cannot know about the geometry."""
    found = identify(setup)
    tilt, power, astigmatism, coma = (f"{nm:.3g}" for nm in found.height_nm)
    text = f"geometry that images leave open: {tilt} nm without piston and tilt, {power} also without power, "
    text += f"{astigmatism} without astigmatism, {coma} without coma"
    if found.plan:
        text += "; `irtscots identify` says what to measure"
    return text
