"""Cases: where lines meet all kinds of conics, and the normal there."""

from __future__ import annotations

from functools import partial

import numpy as np

from irtscots_cl.opencl.structs import PRECISIONS
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene
from irtscots_cl.stability.checks import Bench, Case, Finding, Limit, count, finding
from irtscots_cl.stability.exact import ExactMirror
from irtscots_cl.tracing.checks.probes import MeetProbe

RAYS = 256
SEED = 11

# Relative to the mirror's diameter, across the ray. Along the surface the error is 1 / cos(incidence) times as large.
POINT = {
    "fp32": Limit(2.5e-7, "diameters", "1/4000 of a footprint where 1000 detector pixels cross the mirror"),
    "fp64": Limit(1e-15, "diameters", "five roundings: a reference for fp32 and others"),
}
NORMAL = {
    "fp32": Limit(0.1, "urad", "of a single ray what ray noise does to the mean of thousands in a good test"),
    "fp64": Limit(1e-9, "urad", "1 fm of height over a metre: a reference for fp32 and others"),
}
# radius, conic, off-axis distance, diameter [mm]
MIRRORS: dict[str, tuple[float, float, float, float]] = {
    "sphere": (4166.747, 0.0, 0.0, 1064.0),
    "paraboloid, k = -1": (4166.747, -1.0, 0.0, 1064.0),
    "k = -1 - 1e-7": (4166.747, -1.0 - 1e-7, 0.0, 1064.0),
    "k = -1 + 1e-7": (4166.747, -1.0 + 1e-7, 0.0, 1064.0),
    "hyperboloid, k = -2.5": (4166.747, -2.5, 0.0, 1064.0),
    "hyperboloid, k = -1000": (4166.747, -1000.0, 0.0, 1064.0),
    "oblate ellipsoid, k = 3": (4166.747, 3.0, 0.0, 1064.0),
    "plane, radius 1e12 mm": (1e12, 0.0, 0.0, 1064.0),
    "sphere f/0.3": (638.4, 0.0, 0.0, 1064.0),
    "paraboloid f/0.3": (638.4, -1.0, 0.0, 1064.0),
    "off-axis ellipsoid": (4166.747, -0.7154, 1087.74, 1064.0),
    "ellipsoid off axis to the parent's edge": (4166.747, -0.5, 5350.0, 1064.0),
    "sphere off axis to the parent's edge": (1000.0, 0.0, 990.0, 19.9),
    "oblate ellipsoid off axis to the parent's edge": (1000.0, 0.2, 900.0, 25.0),
    "off-axis hyperboloid": (1000.0, -3.0, 3000.0, 900.0),
    "flat": (float("inf"), 0.0, 0.0, 1064.0),
    "convex sphere": (-3000.0, 0.0, 0.0, 1064.0),
    "convex sphere f/0.3": (-638.4, 0.0, 0.0, 1064.0),
    "convex hyperboloid, k = -2.5": (-4166.747, -2.5, 0.0, 1064.0),
    "off-axis convex paraboloid": (-4166.747, -1.0, 1087.74, 1064.0),
}
# Mirrors whose parent has another half that lines could meet: a second sheet, or the part above its widest circle.
HALVES: dict[str, tuple[float, float, float, float]] = {
    "hyperboloid, k = -100": (100.0, -100.0, 0.0, 100.0),
    "off-axis hyperboloid": (100.0, -30.0, 60.0, 90.0),
    "sphere": (100.0, 0.0, 0.0, 120.0),
    "oblate ellipsoid": (100.0, 2.0, 0.0, 60.0),
    "off-axis sphere": (100.0, 0.0, 20.0, 100.0),
    "convex hyperboloid, k = -100": (-100.0, -100.0, 0.0, 100.0),
    "convex sphere": (-100.0, 0.0, 0.0, 120.0),
    "off-axis convex hyperboloid": (-100.0, -30.0, 60.0, 90.0),
}


def mirror_scene(mirror: Mirror, distance_mm: float = 4000.0, arm: float = 0.05) -> Scene:
    """A test of the mirror: screen and camera above it, to either side by `arm` times their distance."""
    side = arm * distance_mm
    detector = Detector(pixels=(16, 16), pitch_mm=0.1)
    return Scene(
        name="probe",
        mirror=mirror,
        screen=Screen(position_mm=(side, 0.0, distance_mm), pixels=(16, 16), pitch_mm=0.2),
        camera=Camera(
            position_mm=(-side, 0.0, distance_mm), aperture_diameter_mm=1.0, focal_length_mm=16.0, detector=detector
        ),
    )


def points_on(mirror: Mirror, n: int, random: np.random.Generator) -> np.ndarray:
    """Points [3, n] of the design surface, uniform over the aperture; every eighth lies close to the rim."""
    angle, area = 2 * np.pi * random.random(n), random.random(n)
    area[::8] = 0.99999
    radius = mirror.diameter_mm / 2 * np.sqrt(area)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    quadric = Surface.of(mirror).quadric
    return np.stack([x, y, quadric.meet(x, y, 0.0, 0.0)])


def lines_through(points: np.ndarray, slopes: np.ndarray, precision: str) -> np.ndarray:
    """Lines [4, n] (x0, y0, p, q) through points [3, n] with slopes (p, q) [2, n], in that precision."""
    x, y, z = points
    return np.stack([x - slopes[0] * z, y - slopes[1] * z, *slopes]).astype(PRECISIONS[precision])


def _bundles(mirror: Mirror, points: np.ndarray, random: np.random.Generator) -> dict[str, np.ndarray]:
    """Slopes (p, q) [2, n] of lines through points [3, n]: parallel to z, from near the centre of curvature, random."""
    n = points.shape[1]
    height = min(abs(mirror.radius_mm), 1e4)
    source = np.array([[0.05 * height], [0.0], [height]])
    away = points - source
    return {
        "parallel to the axis": np.zeros((2, n)),
        "from near the centre of curvature": away[:2] / away[2],
        "inclined up to 45 degrees": random.uniform(-1, 1, (2, n)),
    }


def _meet(mirror: tuple[float, float, float, float], bench: Bench) -> list[Finding]:
    made = Mirror(**dict(zip(("radius_mm", "conic", "off_axis_mm", "diameter_mm"), mirror, strict=True)))
    probe, exact = MeetProbe(bench.device, mirror_scene(made), bench.precision), ExactMirror(made)
    random, found = np.random.default_rng(SEED), []
    for name, slopes in _bundles(made, points := points_on(made, RAYS, random), random).items():
        lines = lines_through(points, slopes, bench.precision)
        right, met = exact.meet(lines), probe(lines)
        found += compare(right, met, made, bench.precision, f"{name}: ")
    return found


def compare(right, met, mirror: Mirror, precision: str, prefix: str = "") -> list[Finding]:
    """Errors of points and normals of the lines that hit the mirror exactly, and wrong decisions about hits.

    A wrong decision at the rim, within the point's own limit, is no error.
    """
    hit = right.on_mirror
    with np.errstate(invalid="ignore"):
        radius = np.hypot(*(c.astype(float) for c in right.point[:2]))
    near_rim = np.abs(radius - mirror.diameter_mm / 2) < POINT[precision].value * mirror.diameter_mm / right.cosine
    wrong = np.sum((met.on_mirror != hit) & ~near_rim)
    return [
        finding(f"{prefix}point", right.point_error(met.point)[hit] / mirror.diameter_mm, POINT[precision]),
        finding(f"{prefix}normal", (right.normal_error(met.normal) * right.cosine)[hit] * 1e6, NORMAL[precision]),
        count(f"{prefix}on the mirror or not", wrong, len(hit), "every ray has one fate"),
    ]


def _other_half(mirror: tuple[float, float, float, float], bench: Bench) -> list[Finding]:
    """Steep and grazing lines through and around the parent's other half: only the mirror's own half may be met."""
    made = Mirror(**dict(zip(("radius_mm", "conic", "off_axis_mm", "diameter_mm"), mirror, strict=True)))
    probe, random, n = MeetProbe(bench.device, mirror_scene(made), bench.precision), np.random.default_rng(SEED), 4096
    slope, angle = 10 ** random.uniform(-1, 3, n), 2 * np.pi * random.random(n)
    points = np.stack([*random.uniform(-0.5, 0.5, (2, n)) * made.diameter_mm,
                       random.uniform(-2, 2, n) * abs(made.radius_mm)])  # fmt: skip
    lines = lines_through(points, slope * np.stack([np.cos(angle), np.sin(angle)]), bench.precision)
    met = probe(lines)
    right = ExactMirror(made).meet(lines[:, met.on_mirror])
    from_rim = np.abs(np.hypot(*met.point[:2, met.on_mirror]) - made.diameter_mm / 2)
    wrong = ~right.on_mirror & (from_rim > 1e-3 * made.diameter_mm)  # closer to the rim, a tangent line may hit or miss
    return [count("hits where the mirror is not", int(wrong.sum()), n, "the far sheet or upper half is no mirror")]


CASES = (
    *(Case("conics", name, partial(_meet, mirror)) for name, mirror in MIRRORS.items()),
    *(Case("the parent's other half", name, partial(_other_half, mirror)) for name, mirror in HALVES.items()),
)
