"""Cases: quantities that must stay the same, or change exactly, when a test is mirrored, turned or scaled."""

from __future__ import annotations

import dataclasses
import warnings
from functools import partial

import numpy as np

from irtscots_cl.maths.zernike.indices import index_to_nm
from irtscots_cl.optics.screen_model import screen_frame
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.stability.checks import Bench, Case, Finding, Limit, count, finding
from irtscots_cl.stability.conics import lines_through, points_on
from irtscots_cl.stability.paths import LANDING, PIXELS, adjoint_probe, landing_errors, random_words, scene_of
from irtscots_cl.tracing.checks.precision import RoundingWarning
from irtscots_cl.tracing.checks.probes import MeetProbe
from irtscots_cl.tracing.trace import trace

RAYS = 256
TRACED = 512  # rays per pixel of a whole trace


def _base(off_axis_mm: float = 900.0) -> Scene:
    """A deviated conic, a turned camera and a tilted screen: nothing symmetrical."""
    terms = ZernikeTerms(600.0, "noll", {4: 0.3, 5: 0.6, 7: 0.2, 9: 0.1})
    mirror = Mirror(radius_mm=4166.747, conic=-0.7, off_axis_mm=off_axis_mm, diameter_mm=1064.0, obscuration_mm=200.0,
                    zernike=(terms,))  # fmt: skip
    bent = {"screen": {"look_at_mm": (100.0, -30.0, 0.0)}, "camera": {"look_at_mm": (20.0, 40.0, 0.0)}}
    return scene_of(mirror, (-150.0, 40.0, 4200.0), (140.0, -30.0, 4250.0), 0.2, **bent)


def mirrored_in_y(scene: Scene) -> Scene:
    """The mirror image of a test: every y and every sine term is negated."""
    zernike = tuple(
        dataclasses.replace(terms, coefficients_um={
            j: -c if index_to_nm(j, terms.ordering)[1] < 0 else c for j, c in terms.coefficients_um.items()})
        for terms in scene.mirror.zernike
    )  # fmt: skip

    def flipped(device, **changes):
        x, y, z = device.position_mm
        lx, ly, lz = device.look_at_mm
        return dataclasses.replace(device, position_mm=(x, -y, z), look_at_mm=(lx, -ly, lz), **changes)

    u, v = scene.screen.centre_offset_mm
    mirror = dataclasses.replace(scene.mirror, zernike=zernike)
    screen = flipped(scene.screen, centre_offset_mm=(u, -v))
    return dataclasses.replace(scene, mirror=mirror, screen=screen, camera=flipped(scene.camera))


def scaled(scene: Scene, factor: float) -> Scene:
    """The same test with every length multiplied by factor."""

    def grown(part, *names):
        values = {name: getattr(part, name) for name in names}
        return {name: tuple(factor * c for c in v) if isinstance(v, tuple) else factor * v
                for name, v in values.items() if v is not None}  # fmt: skip

    mirror, screen, camera = scene.mirror, scene.screen, scene.camera
    zernike = tuple(
        ZernikeTerms(terms.radius_mm * factor, terms.ordering,
                     {j: c * factor for j, c in terms.coefficients_um.items()}) for terms in mirror.zernike
    )  # fmt: skip
    lengths = grown(mirror, "radius_mm", "diameter_mm", "off_axis_mm", "obscuration_mm")
    place = ("position_mm", "look_at_mm")
    detector = dataclasses.replace(camera.detector, **grown(camera.detector, "pitch_mm"))
    optics = grown(camera, *place, "aperture_diameter_mm", "focal_length_mm", "focus_distance_mm")
    return dataclasses.replace(
        scene,
        mirror=dataclasses.replace(mirror, zernike=zernike, **lengths),
        screen=dataclasses.replace(screen, **grown(screen, *place, "pitch_mm", "centre_offset_mm")),
        camera=dataclasses.replace(camera, detector=detector, **optics),
    )


def _mirrored(bench: Bench) -> list[Finding]:
    """The complements of the words for the pixel's y and the aperture's angle give the negative numbers."""
    scene, words = _base(), random_words(PIXELS**2, RAYS)
    image = words.reshape(PIXELS, PIXELS, RAYS, 4)[::-1].reshape(PIXELS**2, RAYS, 4).copy()  # pixel rows upside down
    image[..., [1, 3]] = ~image[..., [1, 3]]
    here, there = (adjoint_probe(s, bench, w)[0] for s, w in ((scene, words), (mirrored_in_y(scene), image)))
    there = {name: values.reshape(*values.shape[:-1], PIXELS, PIXELS, RAYS)[..., ::-1, :, :].reshape(values.shape)
             for name, values in vars(there).items()}  # fmt: skip
    hit = here.on_mirror
    wrong = (here.on_mirror != there["on_mirror"]) | (here.weight != there["weight"])
    wrong |= hit & ((here.landing[0] != there["landing"][0]) | (here.landing[1] != -there["landing"][1]))
    return [count("rays whose mirror image differs in a bit", wrong.sum(), hit.size, "rounding knows no handedness")]


def _turned(bench: Bench) -> list[Finding]:
    """Lines and devices turned by 90 degrees about the axis of a mirror of revolution: the light turns too."""
    mirror = Mirror(radius_mm=4166.747, conic=-0.7, diameter_mm=1064.0)
    points = points_on(mirror, RAYS, np.random.default_rng(1))
    scene = scene_of(mirror, (-150.0, 40.0, 4200.0), (140.0, -30.0, 4250.0), 0.2)
    away = points - np.array(scene.camera.position_mm)[:, None]
    lines = lines_through(points, away[:2] / away[2], bench.precision)
    x, y, z = scene.screen.position_mm
    turned = dataclasses.replace(scene, screen=dataclasses.replace(scene.screen, position_mm=(-y, x, z)))
    around = np.stack([-lines[1], lines[0], -lines[3], lines[2]])
    found = []
    for case, given in ((scene, lines), (turned, around)):
        landing = MeetProbe(bench.device, case, bench.precision)(given).landing.astype(float)
        found.append(screen_frame(case.screen).to_world(*landing))
    back = np.stack([found[1][:, 1], -found[1][:, 0], found[1][:, 2]], -1)
    apart = np.linalg.norm(back - found[0], axis=1) / scene.screen.pitch_mm
    limit = LANDING[bench.precision]
    return [finding("landing point, turned back", apart, dataclasses.replace(limit, value=2 * limit.value))]


def _scaled_by_power(factor: float, bench: Bench) -> list[Finding]:
    """A power of two changes only exponents: every count is the same, and the flux grows with the square."""
    scene = _base()
    options = {"device": bench.device, "precision": bench.precision, "rays_per_pixel": TRACED, "replicates": 2}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RoundingWarning)  # a larger mirror's heights are rounded more coarsely
        here, there = trace(scene, **options), trace(scaled(scene, factor), **options)
    ratio = there.flux_w().sum() / here.flux_w().sum() / factor**2 - 1
    rounding = Limit(1e-14, "of 1", "float64 rounding: flux is radiance times area times solid angle")
    merge_descriptions = int(np.sum(here.counts != there.counts)) + (here.ledger != there.ledger)
    return [
        count("counts that differ", merge_descriptions, here.counts.size, "a power of two rounds nothing"),
        finding("flux over the factor's square", [ratio], rounding),
    ]


def _scaled(factor: float, bench: Bench) -> list[Finding]:
    scene = scaled(_base(), factor)
    errors, wrong = landing_errors(scene, bench, random_words(PIXELS**2, 3))
    return [
        finding("landing point", np.hypot(*errors), LANDING[bench.precision]),
        count("on the mirror and towards the screen or not", wrong.sum(), len(wrong), "every ray has one fate"),
    ]


CASES = (
    Case("mirrored, turned, scaled", "mirrored in y", _mirrored),
    Case("mirrored, turned, scaled", "turned by 90 degrees about the axis", _turned),
    *(Case("mirrored, turned, scaled", f"scaled by a power of two, {factor:g}", partial(_scaled_by_power, factor))
      for factor in (2.0**-10, 2.0**10)),
    *(Case("mirrored, turned, scaled", f"scaled by {factor:g}", partial(_scaled, factor)) for factor in (1e-3, 1e3)),
)  # fmt: skip
