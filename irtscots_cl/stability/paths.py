"""Cases: whole paths from the camera's aperture over the mirror to the screen, for unusual positions of devices."""

from __future__ import annotations

from functools import partial
from math import cos, radians, sin

import numpy as np

from irtscots_cl.opencl.program import BLOCK
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.stability.checks import Bench, Case, Finding, Limit, count, finding
from irtscots_cl.stability.exact import NUMBERS, adjoint_landing, error
from irtscots_cl.tracing.checks.probes import AdjointPaths, PathProbe, uniform_centred
from irtscots_cl.tracing.packing.sources import receivers

PIXELS = 8  # detector pixels across; all are probed
RAYS = 6  # of each pixel
SEED = 12

LANDING = {
    "fp32": Limit(0.005, "lines", "1/200 of a screen line: 1 um in 0.2 mm, 0.1 urad of the mirror's slope"),
    "fp64": Limit(1e-8, "lines", "1/10^5 of a good centroid's noise: a reference for fp32 and others"),
}


def scene_of(mirror: Mirror, camera_mm, screen_mm, pitch_mm: float, **devices) -> Scene:
    """A test whose detector just covers the mirror. devices: further values of screen and camera."""
    distance = float(np.linalg.norm(camera_mm))
    focal, pixels = distance / 20, (PIXELS, PIXELS)
    image_mm = mirror.diameter_mm * focal / (distance - focal)
    detector = Detector(pixels=pixels, pitch_mm=image_mm / PIXELS)
    return Scene(
        name="probe",
        mirror=mirror,
        screen=Screen(position_mm=screen_mm, pixels=(64, 64), pitch_mm=pitch_mm, **devices.get("screen", {})),
        camera=Camera(
            position_mm=camera_mm,
            aperture_diameter_mm=distance / 4000,
            focal_length_mm=focal,
            detector=detector,
            **devices.get("camera", {}),
        ),
    )


def adjoint_probe(scene: Scene, bench: Bench, words: np.ndarray) -> tuple[AdjointPaths, np.ndarray]:
    """The device's paths from every detector pixel with words [pixels, rays, 4], and their image points [2, n].

    The image points are exact numbers: the pixel's centre plus the words' position in the pixel, without rounding.
    """
    chief, n = ChiefRays(scene), words.shape[1]
    pixels = np.arange(words.shape[0])
    sources = receivers(chief, pixels, np.zeros((len(pixels), 2), int), bench.precision)
    padded = np.zeros((len(pixels), -(-n // BLOCK) * BLOCK, 4), np.uint32)
    padded[:, :n] = words
    paths = PathProbe(bench.device, scene, bench.precision, "adjoint")(
        np.repeat(sources, padded.shape[1]), padded.reshape(-1, 4)
    )
    keep = np.tile(np.arange(padded.shape[1]) < n, len(pixels))
    paths = AdjointPaths(*(values[..., keep] for values in vars(paths).values()))
    row, column = np.divmod(np.repeat(pixels, n), scene.camera.detector.pixels[0])
    of_pixel = uniform_centred(words.reshape(-1, 4)[:, :2])
    columns, rows = scene.camera.detector.pixels
    pitch = NUMBERS.exact(scene.camera.detector.pitch_mm)[()]
    place = np.stack([column - (columns - 1) / 2 + of_pixel[:, 0], row - (rows - 1) / 2 + of_pixel[:, 1]])
    return paths, NUMBERS.exact(place) * pitch  # the sums above are exact: 24-bit fractions plus whole numbers


def random_words(pixels: int, rays: int, seed: int = SEED) -> np.ndarray:
    """Words [pixels, rays, 4] uint32, uniform."""
    return np.random.default_rng(seed).integers(0, 2**32, (pixels, rays, 4), dtype=np.uint32)


def landing_errors(scene: Scene, bench: Bench, words: np.ndarray):
    """Landing errors [2, n] in lines, of the rays that hit the mirror exactly, and the rays with a wrong fate."""
    paths, image = adjoint_probe(scene, bench, words)
    radius = NUMBERS.exact(scene.camera.aperture_diameter_mm)[()] / 2
    landing, met, ahead = adjoint_landing(scene, image, [NUMBERS.exact(c) * radius for c in paths.disk])
    wrong = paths.on_mirror != met.on_mirror
    with np.errstate(invalid="ignore"):
        rim = np.hypot(*(c.astype(float) for c in met.point[:2])) - scene.mirror.diameter_mm / 2
    wrong &= ~(np.abs(rim) < 1e-6 * scene.mirror.diameter_mm / met.cosine)
    wrong |= met.on_mirror & (paths.ahead != ahead)
    errors = np.stack([error(found, right) for found, right in zip(paths.landing, landing, strict=True)])
    return errors[:, met.on_mirror] / scene.screen.pitch_mm, wrong


def _land(scene: Scene, bench: Bench) -> list[Finding]:
    errors, wrong = landing_errors(scene, bench, random_words(PIXELS**2, RAYS))
    return [
        finding("landing point", np.hypot(*errors), LANDING[bench.precision]),
        count("on the mirror and towards the screen or not", wrong.sum(), len(wrong), "every ray has one fate"),
    ]


def _places() -> dict[str, Scene]:
    """Scenes by name. Unless stated otherwise, lines are 50 urad wide seen from the mirror, as in the presets."""
    sphere = Mirror(radius_mm=4166.747, diameter_mm=1064.0)
    near, far = 3000.0 / 1.5, 3000.0 / 0.5  # foci of k = -0.25: R / (1 + e) and R / (1 - e), e = 1/2
    ellipsoid = Mirror(radius_mm=3000.0, conic=-0.25, diameter_mm=1000.0)
    shallow = Mirror(radius_mm=1e5, diameter_mm=1000.0)
    small = Mirror(radius_mm=50.0, diameter_mm=20.0)
    plane, flat = (Mirror(radius_mm=radius, diameter_mm=300.0) for radius in (1e12, float("inf")))
    convex = Mirror(radius_mm=-3000.0, conic=-2.0, diameter_mm=300.0)
    along_y = {"screen": {"look_at_mm": (20.0, 0.0, 100.0)}, "camera": {"look_at_mm": (-20.0, 0.0, 100.0)}}
    bent = {"screen": {"look_at_mm": (800.0, -300.0, 0.0)}, "camera": {"look_at_mm": (50.0, 20.0, 0.0)}}
    on_axis = (0.0, 0.0, 4166.747)
    slight, strong = (
        Mirror(radius_mm=4166.747, conic=-0.7, off_axis_mm=900.0, diameter_mm=1064.0, obscuration_mm=200.0,
               zernike=(ZernikeTerms(532.0, "noll", {5: size, 11: -size, 17: size / 2}),))
        for size in (1e-5, 1.0)
    )  # fmt: skip
    return {
        "camera and screen at an ellipsoid's foci": scene_of(ellipsoid, (0.0, 0.0, near), (0.0, 0.0, far), 0.3),
        "the same, exchanged": scene_of(ellipsoid, (0.0, 0.0, far), (0.0, 0.0, near), 0.1),
        "both at the centre of curvature": scene_of(sphere, on_axis, on_axis, 0.2),
        "both on the axis, apart": scene_of(sphere, (0.0, 0.0, 5200.0), (0.0, 0.0, 3500.0), 0.2),
        "3 degrees to either side": scene_of(sphere, *_sides(4166.747, 3), 0.2),
        "a turned camera and a tilted screen": scene_of(sphere, *_sides(4166.747, 3), 0.2, **bent),
        "a slight deviation, 0.01 nm": scene_of(slight, *_sides(4300.0, 2), 0.2),
        "a deviation of 1 um": scene_of(strong, *_sides(4300.0, 2), 0.2),
        "100 m away": scene_of(shallow, *_sides(1e5, 0.1), 5.0),
        "100 m away, lines of 1 mm": scene_of(shallow, *_sides(1e5, 0.1), 1.0),
        "50 mm away": scene_of(small, *_sides(50.0, 10), 0.0025),
        "a plane mirror": scene_of(plane, *_sides(2000.0, 10), 0.1),
        "a flat mirror": scene_of(flat, *_sides(2000.0, 10), 0.1),
        "a convex mirror": scene_of(convex, *_sides(1000.0, 20), 0.1),
        "both look along Y": scene_of(flat, (-20.0, 600.0, 100.0), (20.0, -600.0, 100.0), 0.1, **along_y),
        "60 degrees to either side": scene_of(plane, *_sides(2000.0, 60), 0.1),
        "85 degrees to either side": scene_of(plane, *_sides(2000.0, 85), 0.1),
        "88.9 degrees to either side": scene_of(plane, *_sides(2e4, 88.9), 1.0),
    }


def _sides(distance_mm: float, degrees: float):
    """Camera and screen positions at an angle from the normal to either side."""
    x, z = distance_mm * sin(radians(degrees)), distance_mm * cos(radians(degrees))
    return (-x, 0.0, z), (x, 0.0, z)


CASES = tuple(Case("devices in awkward places", name, partial(_land, scene)) for name, scene in _places().items())
