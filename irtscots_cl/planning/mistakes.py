"""Mistakes that people make with a scene's numbers, found by undoing each: the one that makes the light land is it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from irtscots_cl.planning.finding import Finding
from irtscots_cl.planning.sight import Sight
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError

WRONG, RIGHT = 0.9, 0.95  # measured shares of the mirror: below, a mistake is looked for; above, it is found
FEW_PX = 3.0  # of the mirror's image or of its light: fewer are no test
FILLED = 0.1  # of a grid of pixels whose pitch is put right: it has its size for a reason

COARSEST_MM = (5.0, 0.2)  # pitches of a screen and of a detector, binned, that exist

# code, factor on mirror.radius_mm that undoes it, what the number probably is
RADII = (
    ("radius-in-metres", 1000.0, "in metres"),
    ("radius-in-inches", 25.4, "in inches"),
    ("radius-doubled", 0.5, "twice the radius of curvature, as if it were a diameter"),
    ("radius-is-focal-length", 2.0, "the focal length, half of the radius of curvature"),
    ("radius-sign", -1.0, "of the wrong sign: above 0 is concave, below 0 convex"),
)


def find_mistakes(sight: Sight) -> list[Finding]:
    """Mistakes whose undoing lets the camera measure nearly the whole mirror, of which it measures little as it is."""
    if sight.measured >= WRONG and min(*sight.image_px, *sight.spot_px) >= FEW_PX:
        return []
    return [finding for finding, scene in _undone(sight.scene) if works(scene, filled="pitch" in finding.code)]


def works(scene: Scene, filled: bool = False) -> bool:
    """Whether a scene measures nearly the whole mirror. filled: whether image and light must also fill the pixels."""
    try:
        sight = Sight.of(scene)
    except ValueError:
        return False
    if not sight.measured >= RIGHT or min(*sight.image_px, *sight.spot_px) < FEW_PX:
        return False
    if not filled:
        return True
    sizes = ((sight.image_px, scene.camera.detector.pixels), (sight.spot_px, scene.screen.pixels))
    return all(size >= FILLED * count for pair, counts in sizes for size, count in zip(pair, counts, strict=True))


def looks_like(key: str, value: float, what: str, right: float) -> str:
    """What is said of a number with which the light lands once it is put right."""
    return f"{key} = {value:g} looks like a number {what}: with {right:g} the light lands"


def _undone(scene: Scene) -> Iterator[tuple[Finding, Scene]]:
    """What is to be said of each mistake, and the scene without it."""
    mirror, screen, camera = scene.mirror, scene.screen, scene.camera
    detector = camera.detector
    if not mirror.is_flat:
        for code, factor, what in RADII:
            right = mirror.radius_mm * factor
            text = looks_like("mirror.radius_mm", mirror.radius_mm, what, right)
            yield from _one(code, text, scene, mirror={"radius_mm": right})
    place = {"position_mm": screen.position_mm, "look_at_mm": screen.look_at_mm}
    other = {"position_mm": camera.position_mm, "look_at_mm": camera.look_at_mm}
    text = "[screen] and [camera] look interchanged: with each at the other's position the light lands"
    yield from _one("screen-camera-swapped", text, scene, screen=other, camera=place)
    x, y, z = screen.position_mm
    for code, to, what in (
        ("screen-side", (-x, y, z), "on the wrong side"),
        ("screen-axes", (y, x, z), "along the wrong axis"),
    ):
        text = f"screen.position_mm = {list(screen.position_mm)} looks {what}: at {list(to)} the light lands"
        yield from _one(code, text, scene, screen={"position_mm": to})
    text = f"camera.look_at_mm = {list(camera.look_at_mm)}: with [0, 0, 0], the mirror's middle, it is all seen"
    yield from _one("camera-looks-past", text, scene, camera={"look_at_mm": (0.0, 0.0, 0.0)})
    for key, pixels in (("screen", screen.pixels), ("detector", detector.pixels)):
        turned = (pixels[1], pixels[0])
        if turned != pixels:
            name = "screen.pixels" if key == "screen" else "camera.detector.pixels"
            text = f"{name} = {list(pixels)}: columns and rows look interchanged; with {list(turned)} all is seen"
            yield from _one(f"{key}-pixels-swapped", text, scene, **{key: {"pixels": turned}})
    yield from _pitches(scene)


def _pitches(scene: Scene) -> Iterator[tuple[Finding, Scene]]:
    screen, detector = scene.screen, scene.camera.detector
    grids = (
        ("screen", "screen", screen.pitch_xy_mm[0], COARSEST_MM[0]),
        ("detector", "camera.detector", detector.pitch_mm, COARSEST_MM[1]),
    )
    for key, name, pitch, coarsest in grids:
        for factor, what in ((1e-3, "in micrometres"), (1e3, "in metres"), (25.4, "in inches")):
            if pitch * factor > coarsest:
                continue
            text = looks_like(f"{name}.pitch_mm", pitch, what, pitch * factor)
            yield from _one(f"{key}-pitch-unit", text, scene, **{key: {"pitch_mm": pitch * factor}})


def _one(code: str, text: str, scene: Scene, **changes: dict[str, Any]) -> Iterator[tuple[Finding, Scene]]:
    """The finding with its scene, or nothing if the scene would not be allowed."""
    try:
        parts: dict[str, Any] = {}
        for key, values in changes.items():
            if key == "detector":
                parts["camera"] = replace(scene.camera, detector=replace(scene.camera.detector, **values))
            else:
                parts[key] = replace(getattr(scene, key), **values)
        yield Finding(code, "error", text), replace(scene, **parts)
    except SceneError:
        return
