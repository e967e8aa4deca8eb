"""The non-sequential estimator beside the sequential ones, closed forms and an independent tracer.

FAILURE_CHANCE, of the whole file, is split among its statistical statements.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from lopsided import lopsided
from scipy import stats
from significance import poisson_ratio_p, sidak_p, sidak_z

from irtscots_cl import nonsequential
from irtscots_cl.analytic import trace_analytic
from irtscots_cl.element import Element
from irtscots_cl.nonsequential import trace_paths
from irtscots_cl.paths import KINDS
from irtscots_cl.patterns import LineScan
from irtscots_cl.presets import load_scene
from irtscots_cl.tracer import trace

FAILURE_CHANCE = 1e-6
STATEMENTS = 64  # at most, each of which fails by chance with CHANCE
CHANCE = FAILURE_CHANCE / STATEMENTS
Z = sidak_z(1, CHANCE)  # of a single statement: 5.7

DIRECT, GHOST, SCATTER = range(len(KINDS))
RAYS = {"sphere": 2**17, "sphere-deviated": 2**17, "lopsided": 2**17, "off-axis": 1024}  # 5e7 to 1.1e8 in all


def scene_of(name):
    return lopsided() if name == "lopsided" else load_scene(name)


# --- the sequential estimators' pictures --------------------------------------------------------------------


@dataclass(frozen=True)
class Pair:
    """Bins [lines, detector pixels] of a scan by both estimators: ray counts, and the flux of one ray of a bin [W]."""

    paths: np.ndarray
    forward: np.ndarray
    unit_w: np.ndarray


@cache
def light_of(name, device):
    """The scene's light by the non-sequential and by the forward estimator, from different random numbers."""
    scene, rays = scene_of(name), RAYS[name]
    paths = trace_paths(scene, device=device, rays_per_pixel=rays, replicates=1, seed=31)
    return paths, trace(scene, device=device, estimator="forward", rays_per_pixel=rays, replicates=1, seed=32)


@cache
def pair(name, axis, device) -> Pair:
    """Counts of both. The forward estimator keeps windows only: beside them it has no light at all."""
    paths, forward = light_of(name, device)
    columns, summed = forward.scene.screen.pixels[0], {"x": 1, "y": 2}[axis]
    flux = paths.images_w[0, DIRECT, :columns] if axis == "x" else paths.images_w[0, DIRECT, columns:]
    windows = forward.windows
    line = windows.origins[:, "xy".index(axis), None] + np.arange((windows.columns, windows.rows)["xy".index(axis)])
    counts, unit_w = np.zeros(flux.shape, np.int64), np.full(flux.shape, forward.unit_w.mean())
    counts[line, windows.pixels[:, None]] = forward.counts[0].sum(summed)
    unit = np.broadcast_to(forward.unit_w, forward.counts.shape[1:]).mean(summed)  # over a window: equal to 1 %
    unit_w[line, windows.pixels[:, None]] = unit
    unit_w = unit_w / forward.rays.sum()
    return Pair(np.rint(flux / unit_w).astype(np.int64), counts, unit_w)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("name", RAYS)
def test_every_bin_agrees_with_the_forward_estimator(device, name, axis):
    """Given a bin's sum each count is binomial with share 1/2: both spend the same rays with the same aim."""
    bins = pair(name, axis, device)
    lit = bins.paths + bins.forward > 0
    p = poisson_ratio_p(bins.paths[lit], bins.forward[lit], 0.5)
    assert lit.sum() > 10_000
    assert p.min() > sidak_p(len(p), CHANCE)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("name", RAYS)
def test_pools_of_bins_agree_with_the_forward_estimator(device, name, axis):
    """Lines, pixels, rows and columns of the detector, where a small difference of many bins adds up; and all flux."""
    bins, (columns, rows) = pair(name, axis, device), scene_of(name).camera.detector.pixels
    difference = ((bins.paths - bins.forward) * 1.0).reshape(-1, rows, columns)
    total = ((bins.paths + bins.forward) * 1.0).reshape(-1, rows, columns)
    z = []
    for pooled in ((1, 2), 0, (0, 1), (0, 2), 1, 2):
        of, variance = difference.sum(pooled), total.sum(pooled)
        z.append((of[variance >= 50] / np.sqrt(variance[variance >= 50])).ravel())
    z = np.concatenate(z)
    assert len(z) > 300
    assert np.abs(z).max() < sidak_z(len(z), CHANCE)  # pools overlap: Sidak's limit is then on the safe side
    assert abs(difference.sum() / math.sqrt(total.sum())) < Z


@pytest.mark.parametrize("name", RAYS)
def test_the_flux_in_watts_is_the_forward_estimators(device, name):
    """The same light in both scans, in the path's flux, and in the other estimator's unit, from counts of rays."""
    paths, forward = light_of(name, device)
    (direct,) = (path for path in paths.paths if path.kind == "direct")
    columns = forward.scene.screen.pixels[0]
    for lines in (paths.images_w[0, DIRECT, :columns], paths.images_w[0, DIRECT, columns:]):
        # weights are whole multiples of 2^-22 of the largest: rounding
        assert lines.sum() == pytest.approx(direct.flux_w, rel=1e-6, abs=0)
    assert direct.rays == paths.ends["detected"]
    flux_w, counts = forward.flux_w().sum(), int(forward.counts.sum())
    assert abs(direct.flux_w - flux_w) < Z * flux_w * math.sqrt(1 / counts + 1 / direct.rays)
    assert not paths.images_w[:, [GHOST, SCATTER]].any()


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("name", ["sphere", "sphere-deviated"])
def test_light_curves_are_the_analytic_ones(device, name, axis):
    """Every sample with 25 rays or more: the rays' noise alone is between them. Analytic flux is in watts too."""
    scene, bins = scene_of(name), pair(name, axis, device)
    expected = LineScan(scene).images(trace_analytic(scene))
    scan = getattr(expected, axis)
    curves = scan.mean_w()
    images = getattr(LineScan(scene).images(light_of(name, device)[0]), axis)
    found = images.mean_w()[scan.pixels[:, None], scan.lines]
    unit_w = bins.unit_w[scan.lines, scan.pixels[:, None]]
    enough = curves > 25 * unit_w
    count, mean = (w[enough] / unit_w[enough] for w in (found, curves))
    assert len(mean) > 10_000
    count = np.rint(count)
    p = 2 * np.minimum(stats.poisson.cdf(count, mean), stats.poisson.sf(count - 1, mean))
    assert p.min() > sidak_p(len(p), CHANCE)
    lower, upper = stats.chi2.isf([1 - CHANCE / 2, CHANCE / 2], len(mean))
    # counts of 25 and more have heavier tails than normal ones, by 1 / count of the variance: 1 %
    assert 0.99 * lower < ((count - mean) ** 2 / mean).sum() < 1.01 * upper


# --- a plane-parallel plate and a wedge ---------------------------------------------------------------------

PLATE = "screen > window.back > window.front > mirror > lens > detector"
PLATE_GHOST = PLATE.replace(" > mirror", " (r) > window.back (r) > window.front > mirror")
PLATE_SECOND = PLATE_GHOST.replace(" > mirror", " (r) > window.back (r) > window.front > mirror")


def wide(scene):
    """With an aperture that takes all light of the mirror: nothing is left to chance but the interfaces."""
    return replace(scene, camera=replace(scene.camera, aperture_diameter_mm=20.0))


@cache
def plate(device, least_chance):
    return trace_paths(
        wide(load_scene("sphere-window")), device=device, rays_per_pixel=2**16, seed=41, least_chance=least_chance
    )


@cache
def bare_flux_w(device):
    """The same rays without the plate."""
    light = trace_paths(wide(load_scene("sphere")), device=device, rays_per_pixel=2**16, seed=41)
    return light.paths[0].flux_w, light.paths[0].rays / light.ends["launched"]


def flux_of(light, name) -> tuple[float, float]:
    """Flux of a path and its standard error, from the count of its rays: they weigh the same within 1 %."""
    (path,) = (path for path in light.paths if path.name == name)
    return path.flux_w, path.flux_w * math.sqrt((1 - path.rays / light.ends["launched"]) / path.rays)


def plate_mean(of_reflectance, index=1.52, sine=532.0 / 4166.747):
    """Mean of a function of the interface's reflectance over the light that the mirror takes: uniform in the square of
    the sine of its angle to the plate's normal. Unpolarised light: constant to the third power of the angle."""
    squares = (np.arange(1000) + 0.5) / 1000 * sine**2
    cosine_in, cosine_out = np.sqrt(1 - squares), np.sqrt(1 - squares / index**2)
    s = (cosine_in - index * cosine_out) / (cosine_in + index * cosine_out)
    p = (cosine_out - index * cosine_in) / (cosine_out + index * cosine_in)
    return float(np.mean(of_reflectance((s**2 + p**2) / 2)))


def test_the_reflectance_of_the_plates_faces():
    """((n - 1) / (n + 1))^2 at small angles, and (1 - R) / (1 + R) = 2 n / (n^2 + 1) through both faces."""
    assert plate_mean(lambda r: r) == pytest.approx((0.52 / 2.52) ** 2, rel=1e-4, abs=0)  # the angle's fourth power
    assert plate_mean(lambda r: (1 - r) / (1 + r)) == pytest.approx(3.04 / (1.52**2 + 1), rel=1e-5, abs=0)


@pytest.mark.parametrize("least_chance", [0.0, 0.1, 0.5])
def test_light_through_a_plate_and_its_ghosts(device, least_chance):
    """(1 - R)^2 of the light passes straight, (1 - R)^2 R^2 after two reflections, R^4 of that after four."""
    light, (bare_w, share) = plate(device, least_chance), bare_flux_w(device)
    rim = 2e-5  # of the bare flux: the plate moves rays by 0.05 mm, some off the mirror and as many onto it
    for name, expected in (
        (PLATE, plate_mean(lambda r: (1 - r) ** 2)),
        (PLATE_GHOST, plate_mean(lambda r: (1 - r) ** 2 * r**2)),
        (PLATE_SECOND, plate_mean(lambda r: (1 - r) ** 2 * r**4)),
    ):
        flux_w, error_w = flux_of(light, name)
        assert abs(flux_w / bare_w - expected) < Z * error_w / bare_w + rim * expected, name
    assert share > 0.95  # nothing but the plate decides


def test_the_plates_transmittance_with_all_its_reflections(device):
    """(1 - R)^2 (1 + R^2 + R^4 + ...) = (1 - R) / (1 + R), to 3e-4."""
    light, (bare_w, _) = plate(device, 0.1), bare_flux_w(device)
    total_w = sum(path.flux_w for path in light.paths)
    expected, error = plate_mean(lambda r: (1 - r) / (1 + r)), flux_of(light, PLATE)[1] / bare_w
    assert Z * error < 3e-4  # so this holds to 3e-4 or better
    assert abs(total_w / bare_w - expected) < 3e-4
    assert light.images_w.sum((1, 2, 3)).mean() == pytest.approx(2 * total_w, rel=1e-5, abs=0)  # rounding, both scans


def wedge(angle_rad, index):
    """The sphere's middle through a wedge in front of the camera, whose back face is turned about its y axis."""
    scene = load_scene("sphere")
    at = np.array(scene.camera.position_mm)
    z = -at / np.linalg.norm(at)  # from the camera to the mirror
    x = np.cross([0.0, 1.0, 0.0], -z)
    x /= np.linalg.norm(x)  # the camera's x axis: y from z, which looks back
    turned = math.cos(angle_rad) * z + math.sin(angle_rad) * x
    faces = [
        Element(name=name, kind="refractor", position_mm=tuple(at + distance * z), diameter_mm=60.0,
                facing_mm=tuple(at + distance * z + 100 * normal), index_front=front, index_back=back)
        for name, distance, normal, front, back in (("front", 12.0, z, 1.0, index), ("back", 10.0, turned, index, 1.0))
    ]  # fmt: skip
    mirror = replace(scene.mirror, diameter_mm=300.0)
    return replace(wide(scene), name="wedge", mirror=mirror, element=tuple(faces))


def image_of(light, kind):
    """Image [rows, columns] of a kind of paths."""
    columns, rows = light.scene.camera.detector.pixels
    return light.images_w[:, kind, : light.scene.screen.pixels[0]].mean(0).sum(0).reshape(rows, columns)


def centre_mm(scene, image):
    """Mean place (x, y) of an image's light."""
    pitch, (rows, columns) = scene.camera.detector.pitch_mm, image.shape
    x, y = ((np.arange(n) - (n - 1) / 2) * pitch for n in (columns, rows))
    return image.sum(0) @ x / image.sum(), image.sum(1) @ y / image.sum()


def test_a_wedges_ghost_lies_where_two_reflections_turn_it(device):
    """Each round in a wedge of angle a and index n turns the light by 2 n a more; seen from the lens, focused on the
    mirror at D, a turn at distance w in front of the lens moves the image by (D - w) / D of it."""
    angle, index = 0.01, 1.6
    scene = wedge(angle, index)
    light = trace_paths(scene, device=device, rays_per_pixel=2**14, seed=43, least_chance=0.5)
    direct, ghost = (centre_mm(scene, image_of(light, kind)) for kind in (DIRECT, GHOST))
    focus, distance = scene.camera.focus_mm, scene.camera.image_distance_mm
    turn = 2 * index * angle * (focus - 11) / focus * distance
    assert turn > 10 * scene.camera.detector.pitch_mm
    assert abs(ghost[0] - direct[0]) == pytest.approx(turn, rel=0.01, abs=0)  # second order in angles
    # rays: the mirror's image is 0.6 mm in radius, 0.3 rms
    assert abs(ghost[1] - direct[1]) < Z * 0.3 / math.sqrt(min(path.rays for path in light.paths[:2]))
