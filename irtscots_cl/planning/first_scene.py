"""A first scene for one's own mirror: screen and camera placed so that the light lands, the pattern as large as it."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

import numpy as np

from irtscots_cl.optics.screen_model import screen_frame
from irtscots_cl.planning.sight import Sight
from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.option_error import OptionError

INCH_MM = 25.4
BESIDE_MM = 50.0  # of the camera's and the light's place from the mirror's normal: room for a camera beside a monitor
FILLED = 0.85  # of the detector's smaller side by the mirror's image
MOST_ACROSS = 200  # detector pixels across the mirror: more are binned, which costs no accuracy of the low orders
F_NUMBER = 16.0
LIGHT_MARGIN = 1.15  # the screen's used part over the light
LEAST_PX = 8  # of the light across the screen, for good centroids
MANY_LINES = 300  # of both scans together: from there on fringes take fewer frames
DISTANCES = np.geomspace(0.5, 30.0, 60)  # in mirror diameters, tried for flat and convex mirrors
ROUNDS = 4  # of moving screen and camera apart
SIDES = {"+x": (1.0, 0.0), "-x": (-1.0, 0.0), "+y": (0.0, 1.0), "-y": (0.0, -1.0)}


@dataclass(frozen=True)
class Bench:
    """What is at hand. screen_diagonal_mm, screen_pixels: of the whole monitor. sensor_pixels, sensor_pitch_um: of the
    whole sensor. focal_length_mm: None for one that fits. side: of the mirror's normal, where the screen is."""

    screen_diagonal_mm: float = 27 * INCH_MM
    screen_pixels: tuple[int, int] = (3840, 2160)
    sensor_pixels: tuple[int, int] = (2448, 2048)
    sensor_pitch_um: float = 3.45
    focal_length_mm: float | None = None
    f_number: float = F_NUMBER
    side: str = "+x"

    @property
    def screen_pitch_mm(self) -> float:
        return self.screen_diagonal_mm / math.hypot(*self.screen_pixels)


@dataclass(frozen=True)
class FirstScene:
    """scene: the test. bench: what it is made with. binning: sensor pixels joined along each axis. toml: with comments.
    fringes: whether fringes take fewer frames than lines."""

    scene: Scene
    bench: Bench
    binning: int
    fringes: bool
    toml: str


def design(
    diameter_mm: float,
    radius_mm: float,
    *,
    conic: float = 0.0,
    off_axis_mm: float = 0.0,
    obscuration_mm: float = 0.0,
    name: str = "my-mirror",
    bench: Bench | None = None,
) -> FirstScene:
    """Place screen and camera for a mirror.

    radius_mm: of curvature at the (parent's) vertex, below 0 for a convex mirror, inf for a flat one. Raises ValueError
    if the whole monitor is too small for the light, or a number is not allowed.
    """
    bench = bench or Bench()
    if bench.side not in SIDES:
        raise OptionError(f"--side = {bench.side!r}: must be one of {', '.join(SIDES)}")
    mirror = Mirror(radius_mm=radius_mm, diameter_mm=diameter_mm, conic=conic, off_axis_mm=off_axis_mm,
                    obscuration_mm=obscuration_mm)  # fmt: skip
    scene = _placed(mirror, bench, name)
    factor = max(1, math.ceil(max(Sight.of(scene).image_px) / MOST_ACROSS))
    scene = _binned(scene, factor)
    sight = Sight.of(scene)
    fringes = sum(scene.screen.pixels) > MANY_LINES
    return FirstScene(scene, bench, factor, fringes, _commented(scene, bench, factor, fringes, sight))


def _placed(mirror: Mirror, bench: Bench, name: str) -> Scene:
    """The scene with the screen's used part where the light lands. Raises ValueError if the monitor is too small."""
    pitch = bench.screen_pitch_mm
    limit = [count * pitch for count in bench.screen_pixels]
    best = math.inf
    for distance in _distances(mirror):
        try:
            scene, sight = _apart(mirror, bench, name, distance)
        except ValueError:
            continue
        size = [LIGHT_MARGIN * px * pitch for px in sight.spot_px]
        if all(one <= most for one, most in zip(size, limit, strict=True)):
            return _around(scene, sight)
        over = max(one / most for one, most in zip(size, limit, strict=True))
        best = min(best, over) if math.isfinite(over) else best
    raise OptionError(
        f"--screen-diagonal = {bench.screen_diagonal_mm / INCH_MM:.3g} inch: the light of this mirror needs one of "
        f"about {best * bench.screen_diagonal_mm / INCH_MM:.3g} inch"
    )


def _distances(mirror: Mirror) -> list[float]:
    """Distances from the mirror that are tried, the best first, in mm."""
    if mirror.radius_mm < 0 or mirror.is_flat:
        return [float(d) for d in DISTANCES * mirror.diameter_mm]
    # where the mirror's normals gather: between the tangential and the sagittal radius of curvature
    h2 = mirror.radius_mm**2 - mirror.conic * mirror.off_axis_mm**2
    tangential, sagittal = h2**1.5 / mirror.radius_mm**2, math.sqrt(h2)
    return [(tangential + sagittal) / 2 * factor for factor in (1.0, 0.98, 1.02, 0.95, 1.05)]


def _apart(mirror: Mirror, bench: Bench, name: str, distance: float) -> tuple[Scene, Sight]:
    """Camera and screen so far apart that the camera stands beside the part of the screen that is used."""
    beside = BESIDE_MM
    for _ in range(ROUNDS):
        scene = _facing(mirror, bench, name, distance, beside)
        sight = Sight.of(scene)
        axis = 0 if bench.side[1] == "x" else 1
        half = LIGHT_MARGIN * sight.spot_px[axis] * bench.screen_pitch_mm / 2
        if 2 * beside >= half + BESIDE_MM / 2:
            return scene, sight
        beside = 0.6 * half + BESIDE_MM / 2
    raise ValueError("the camera cannot stand beside the light")


def _facing(mirror: Mirror, bench: Bench, name: str, distance: float, beside: float) -> Scene:
    """Camera and screen side by side at a distance, on either side of the mirror's normal; a small screen."""
    x, y = (round(beside * part, 2) + 0.0 for part in SIDES[bench.side])
    pitch = bench.sensor_pitch_um * 1e-3
    small = min(bench.sensor_pixels) * pitch
    # the image is about focal length / distance of the mirror
    focal = bench.focal_length_mm or _standard(FILLED * small * distance / mirror.diameter_mm)
    focal = min(focal, distance / 3)
    camera = Camera(
        position_mm=(0.0 - x, 0.0 - y, round(distance, 3)), aperture_diameter_mm=round(focal / bench.f_number, 4),
        focal_length_mm=focal, detector=Detector(pixels=bench.sensor_pixels, pitch_mm=round(pitch, 9)),
    )  # fmt: skip
    screen = Screen(position_mm=(x, y, round(distance, 3)), pixels=(2, 2), pitch_mm=round(bench.screen_pitch_mm, 6),
                    look_at_mm=(x, y, 0.0))  # fmt: skip
    return Scene(name=name, mirror=mirror, screen=screen, camera=camera)


DEFAULTS = {  # lines of a scene file that say nothing new
    "off_axis_mm = 0.0", "obscuration_mm = 0.0", "reflectance = 1.0", "radiance = 1.0", 'emission = "lambertian"',
    "centre_offset_mm = [0.0, 0.0]", "clocking_deg = 0.0", "transmittance = 1.0", 'lens = "paraxial"', "roll_deg = 0.0",
    "aperture_offset_mm = [0.0, 0.0]", 'orientation = "upright"', "conic = 0.0",
}  # fmt: skip
LENSES_MM = (6.0, 8.0, 12.0, 16.0, 25.0, 35.0, 50.0, 75.0, 100.0)


def _standard(focal_mm: float) -> float:
    """The longest lens of a catalogue that is no longer than this; a shorter one as it is."""
    fitting = [lens for lens in LENSES_MM if lens <= focal_mm]
    return fitting[-1] if fitting else round(focal_mm, 2)


def _around(scene: Scene, sight: Sight) -> Scene:
    """The scene whose screen is as large as the light, and where it lands."""
    screen, frame = scene.screen, screen_frame(scene.screen)
    place = frame.to_world(*screen.places_mm(*sight.spot_centre_px))
    pixels = tuple(2 * math.ceil(max(LIGHT_MARGIN * px + 2, LEAST_PX) / 2) for px in sight.spot_px)
    x, y, z = (round(float(v), 2) + 0.0 for v in place)
    return replace(scene, screen=replace(screen, position_mm=(x, y, z), look_at_mm=(x, y, 0.0), pixels=pixels))


def _binned(scene: Scene, factor: int) -> Scene:
    detector = scene.camera.detector
    pixels = (detector.pixels[0] // factor, detector.pixels[1] // factor)
    detector = replace(detector, pixels=pixels, pitch_mm=round(detector.pitch_mm * factor, 9))
    return replace(scene, camera=replace(scene.camera, detector=detector))


def _commented(scene: Scene, bench: Bench, factor: int, fringes: bool, sight: Sight) -> str:
    """TOML text of the scene with what was chosen and why."""
    columns, rows = bench.screen_pixels
    wide, high = (px * bench.screen_pitch_mm for px in sight.spot_px)
    way = (
        "Fringes take fewer frames than lines here: irtscots design-patterns FILE chooses them"
        if fringes
        else f"A line scan takes {sum(scene.screen.pixels)} frames; irtscots design-patterns FILE compares fringes"
    )
    head = [
        f"# {scene.name}: a first test of this mirror. Lengths in mm.",
        f"# Monitor: {bench.screen_diagonal_mm / INCH_MM:.3g} inch, {columns} x {rows} pixels of "
        f"{bench.screen_pitch_mm:.4g} mm;",
        f"# the light covers {wide:.1f} x {high:.1f} mm of it, and [screen] is the part that is used.",
        f"# {way}.",
        f"# Camera: pixels of {bench.sensor_pitch_um:g} um, {factor} x {factor} binned; the mirror is "
        f"{max(sight.image_px):.0f} pixels across.",
        "# Next: irtscots check FILE; irtscots run FILE --smoothing --rays-per-pixel 64",
        "",
    ]
    notes = {
        "radius_mm": "of curvature at the vertex; concave above 0",
        "conic": "-1 for a paraboloid, 0 for a sphere",
        "diameter_mm": "",
        "position_mm": "x, y across the mirror, z along its normal, from its vertex",
        "pixels": "columns, rows",
        "aperture_diameter_mm": f"the lens at f/{bench.f_number:g}",
    }
    lines = []
    for line in scene.to_toml().splitlines():
        if line in DEFAULTS:
            continue
        key = re.match(r"(\w+) = ", line)
        note = notes.get(key[1], "") if key else ""
        lines.append(f"{line:<34} # {note}" if note else line)
    return "\n".join([*head, *lines]) + "\n"
