"""Scatter from the mirror and from the camera's lens: light, map and height (paper, section 3.3, figure 10)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from irtscots_cl.analysis.stray_light import StrayLight, stray_light
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import Harvey, tis_of_roughness
from irtscots_cl.studies.drawing import maps
from irtscots_cl.studies.traces import CENTRE, SEED, SharedTraces, over_runs
from irtscots_cl.studies.verdicts import StudyResult, exact, row
from irtscots_cl.tracing.results.paths import PathLight
from irtscots_cl.tracing.trace import trace, trace_paths

TITLE = "Scattered light (figure 10)"
SIGMA_NM, WAVELENGTH_NM = 2.0, 500.0
LOBE = {"l": 0.01, "s": -1.5}  # of Harvey's model; the paper does not state its lobe
PRINTED_TIS, PRINTED_RATIO, PRINTED_HEIGHT_NM = 0.0025, 1e-8, 3.8e-10
LINE = 10  # of 21, the middle one
RAYS, QUICK_RAYS, REPLICATES = 400_000, 40_000, 8
BLOCK = 4  # pixels about the centre, over which the scattered irradiance is averaged


def study(traces: SharedTraces) -> StudyResult:
    tis = float(tis_of_roughness(SIGMA_NM, WAVELENGTH_NM))
    clean, dirty = (Harvey(tis=factor * tis, **LOBE) for factor in (1, 10))
    light, lens = _traced(traces, _dull_mirror(clean)), _traced(traces, _dull_lens(clean))
    expected = float(clean.bsdf(0.0)) * _line_solid_angle(light.scene)
    effect, dirtier, of_lens = (_effect(each) for each in (light, _traced(traces, _dull_mirror(dirty)), lens))
    pattern, (of_all, of_line) = LineScan(light.scene), _specular(light)
    specular, scattered = (light.only(kind).images(pattern).x.image(LINE) for kind in ("direct", "scatter"))
    under_line = _scattered(light)
    return StudyResult((
        row("TIS of 2 nm rms at 500 nm", exact(tis), paper=PRINTED_TIS, closeness=0.02),
        row("b0 of the lobe with that TIS [1/sr]", exact(float(clean.bsdf(0.0)))),
        row("light scattered under one line, over the pixel's specular light under all", _over(under_line, of_all),
            paper=PRINTED_RATIO, expected=expected, allowed=0.02 * expected, closeness=0.5),
        row("the same over that under the line itself", _over(under_line, of_line),
            expected=expected * of_all / of_line, allowed=0.02 * expected * of_all / of_line),
        row("scattered over specular flux, the whole screen lit", exact(effect.of_direct)),
        row("its effect on the height [nm]", effect.height_nm, paper=PRINTED_HEIGHT_NM,
            inconsistent="light of all lines on a pixel pulls its centroid to the screen's middle, by the ratio above"),
        row("the same, a mirror with ten times the TIS [nm]", dirtier.height_nm),
        row("the same lobe at the front of a camera's lens: scattered over direct flux", exact(of_lens.of_direct)),
        row("its effect on the height [nm]", of_lens.height_nm),
    ), (
        f"{light.rays_total:,} rays, Philox, seed {SEED}, non-sequential; scattered rays are aimed at the camera "
        "(next-event estimation) or drawn from the lobe, each with the weight of the BSDF over the density of both",
        f"Harvey lobe with L = {LOBE['l']}, S = {LOBE['s']}: the paper states only the TIS; expected: b0 times the "
        "solid angle of a line (2 % allowed: the lobe falls over the line's length); under the line itself a pixel "
        "gets a quarter of its specular light, as the line shows a quarter of the aperture",
        "roughness is taken as an rms (Rq); the paper's 2 nm is an Ra, whose Rq is 1.1 to 1.25 times that",
        "height: measured with the scattered light and without, piston and tilt removed",
        "lens: the singlet of the preset sphere-singlet, its front with the TIS of the clean mirror; "
        f"{lens.rays_total:,} rays",
    ), {"fig10.png": maps([("one line, specular", specular / specular.max()),
                           ("its scattered light", scattered / specular.max())], "irradiance over the brightest",
                          columns=2)})  # fmt: skip


def _dull_mirror(lobe: Harvey) -> Scene:
    scene = load_scene("sphere")
    return replace(scene, mirror=replace(scene.mirror, scatter=lobe))


def _dull_lens(lobe: Harvey) -> Scene:
    scene = load_scene("sphere-singlet")
    front, *others = scene.element
    return replace(scene, element=(replace(front, scatter=lobe), *others))


def _effect(light: PathLight) -> StrayLight:
    return next(stray for stray in stray_light(light) if stray.kind == "scatter")


def _traced(traces: SharedTraces, scene: Scene) -> PathLight:
    rays = QUICK_RAYS if traces.quick else RAYS
    return trace_paths(scene, device=traces.device, rays_per_pixel=rays, replicates=REPLICATES, seed=SEED,
                       progress=traces.progress, keeper=traces.keeper)  # fmt: skip


def _line_solid_angle(scene: Scene) -> float:
    """Solid angle of one line of the screen, seen from the mirror's vertex [sr]."""
    return scene.screen.pitch_mm**2 * scene.screen.pixels[1] / float(np.linalg.norm(scene.screen.position_mm)) ** 2


def _scattered(light: PathLight) -> Estimate:
    """Flux [W] scattered from the line onto a pixel near the detector's centre."""
    step = np.arange(-BLOCK, BLOCK + 1)
    block = (CENTRE + step[:, None] * 125 + step).ravel()
    return over_runs(light.only("scatter").images(LineScan(light.scene)).x.flux_w[:, block, LINE].mean(1))


def _specular(light: PathLight) -> tuple[float, float]:
    """Specular flux [W] on the centre pixel from all lines of the screen together, and from the line alone."""
    scene = load_scene(light.scene.name)
    scan = trace(scene, estimator="analytic").images(LineScan(scene)).x
    curve = scan.mean_w()[np.searchsorted(scan.pixels, CENTRE)]
    return float(curve.sum()), float(scan.image(LINE).ravel()[CENTRE])


def _over(part: Estimate, whole: float) -> Estimate:
    return Estimate(part.value / whole, part.standard_error / whole)
