"""Variants of the preset scenes that many tests trace."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from freeform import lopsided_freeform
from height_maps import mapped
from lopsided import lopsided
from real_setup import REAL

from irtscots_cl.scene.asphere import Asphere
from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene, sequential_presets

EXAMPLES = Path(__file__).parents[2] / "examples"
# Presets of published mirrors, tested in tests/scene/test_published_presets.py: too large for tests of every scene
PUBLISHED = (
    "elt-segment", "fsm-on-axis", "gmt-segment", "jwst-segment", "lbt-secondary", "newtonian", "vista-secondary",
)  # fmt: skip
SEQUENTIAL = [name for name in sequential_presets() if name not in PUBLISHED]
CURVATURES = ("convex", "flat", "lopsided-convex", "sideways")  # not concave; names of scene_of


def scene_of(name: str) -> Scene:
    """A preset, an example with a mirror that is no concave conic, the lop-sided scene in which no two lengths are
    equal, or one of REAL with what real set-ups have.

    "lopsided-convex": its mirror bent the other way, before a larger screen. "sideways": devices that look along Y.
    "lopsided-asphere": its mirror with even and odd terms, off the parent's axis. "freeform", "lopsided-freeform":
    their mirrors have polynomials and annular terms. "mapped": a height map on the preset `sphere`.
    """
    if name in REAL:
        return REAL[name]()
    if name in ("convex", "flat", "asphere", "freeform"):
        return load_scene(str(EXAMPLES / f"{name}.toml"))
    if name == "lopsided-convex":
        return with_part(with_part(lopsided(), "mirror", radius_mm=-1500.0), "screen", pitch_mm=20.0, pixels=(69, 51))
    if name == "mapped":
        return mapped()
    if name == "lopsided-asphere":
        return with_part(lopsided(), "mirror", asphere=Asphere({3: 1e-9, 4: 1e-11, 6: -1e-17}))
    if name in MADE:
        return MADE[name]()
    return lopsided() if name == "lopsided" else load_scene(name)


def sideways() -> Scene:
    """A flat mirror at grazing incidence between a camera that looks along -Y and a screen that looks along +Y."""
    camera = Camera(
        position_mm=(-20.0, 1500.0, 300.0), look_at_mm=(-20.0, 0.0, 300.0), aperture_diameter_mm=2.0,
        focal_length_mm=16.0, detector=Detector(pixels=(240, 240), pitch_mm=0.0375),
    )  # fmt: skip
    screen = Screen(position_mm=(20.0, -1500.0, 300.0), look_at_mm=(20.0, 0.0, 300.0), pixels=(280, 80), pitch_mm=5.0)
    terms = ZernikeTerms(radius_mm=300.0, ordering="noll", coefficients_um={5: 1.0, 8: -0.7})
    return Scene("sideways", Mirror(radius_mm=math.inf, diameter_mm=600.0, zernike=(terms,)), screen, camera)


MADE = {"sideways": sideways, "lopsided-freeform": lopsided_freeform}


def with_part(scene: Scene, part: str, **changes) -> Scene:
    """The scene with changed values of its mirror, screen or camera."""
    return replace(scene, **{part: replace(getattr(scene, part), **changes)})


def coarse(scene: Scene | str = "sphere-deviated", pixels: int = 25) -> Scene:
    """A scene or preset with pixels x pixels larger detector pixels behind the same optics."""
    scene = load_scene(scene) if isinstance(scene, str) else scene
    detector = scene.camera.detector
    pitch = round(detector.pitch_mm * detector.pixels[0] / pixels, 12)
    return with_part(scene, "camera", detector=replace(detector, pixels=(pixels, pixels), pitch_mm=pitch))


def rim_view() -> Scene:
    """A camera near the mirror's rim that looks outward at it, away from the vertex; all its light is on the screen."""
    camera = Camera(
        position_mm=(480.0, 0.0, 60.0), look_at_mm=(512.0, 0.0, 31.5), aperture_diameter_mm=0.5, focal_length_mm=8.0,
        detector=Detector(pixels=(15, 15), pitch_mm=0.05),
    )  # fmt: skip
    screen = Screen(position_mm=(680.0, 0.0, 279.0), look_at_mm=(512.0, 0.0, 31.5), pixels=(61, 61), pitch_mm=1.0)
    return Scene("rim", Mirror(radius_mm=4166.747, diameter_mm=1064.0), screen, camera)


def coarse_screen(scene: Scene) -> Scene:
    """The scene with 7 x 7 screen pixels."""
    return with_part(scene, "screen", pixels=(7, 7), pitch_mm=0.6)


def large_segment(pixels: int = 25) -> Scene:
    """A sphere of 8.4 m and 36 m radius: the rays' errors are as small as on the presets, but the mirror is large."""
    scene, distance = load_scene("sphere"), 36000.0
    screen = replace(scene.screen, position_mm=(300.0, 0.0, distance), pixels=(101, 101), pitch_mm=0.5)
    detector = Detector(pixels=(pixels, pixels), pitch_mm=8400 * 16 / distance / (pixels - 2))
    camera = replace(scene.camera, position_mm=(-300.0, 0.0, distance), focus_distance_mm=distance, detector=detector)
    mirror = Mirror(radius_mm=36000.0, diameter_mm=8400.0)
    return replace(scene, name="segment", mirror=mirror, screen=screen, camera=camera)
