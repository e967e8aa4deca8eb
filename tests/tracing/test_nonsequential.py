"""The non-sequential estimator beside the sequential ones, closed forms and an independent tracer.

FAILURE_CHANCE, of the whole file, is split among its statistical statements.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from oracle import sequence
from path_scenes import PLATE, PLATE_GHOST, PLATE_SECOND, plate_mean, wide
from scenes import coarse_screen, scene_of
from scipy import stats
from significance import poisson_ratio_p, sidak_p, sidak_z
from tracers import path_tracer_of

from irtscots_cl.execution.launch_plan import RateMeter
from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.estimators import nonsequential
from irtscots_cl.tracing.options import NONSEQUENTIAL, TraceOptions
from irtscots_cl.tracing.results.paths import KINDS
from irtscots_cl.tracing.trace import trace, trace_paths

FAILURE_CHANCE = 1e-6
STATEMENTS = 64  # at most, each of which fails by chance with CHANCE
CHANCE = FAILURE_CHANCE / STATEMENTS
Z = sidak_z(1, CHANCE)  # of a single statement: 5.7

DIRECT, GHOST, SCATTER = range(len(KINDS))
RAYS = {"sphere": 2**17, "sphere-deviated": 2**17, "lopsided": 2**15, "turned": 2**15, "off-axis": 512}  # 1e7 to 1e8


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
    expected = trace(scene, estimator="analytic").images(LineScan(scene))
    scan = getattr(expected, axis)
    curves = scan.mean_w()
    images = getattr(light_of(name, device)[0].images(LineScan(scene)), axis)
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


def test_the_reflectance_of_the_plates_faces():
    """((n - 1) / (n + 1))^2 at small angles, and (1 - R) / (1 + R) = 2 n / (n^2 + 1) through both faces."""
    assert plate_mean(lambda r: r) == pytest.approx((0.52 / 2.52) ** 2, rel=1e-4, abs=0)  # the angle's fourth power
    assert plate_mean(lambda r: (1 - r) / (1 + r)) == pytest.approx(3.04 / (1.52**2 + 1), rel=1e-5, abs=0)


@pytest.mark.parametrize("least_chance", [pytest.param(0.0, marks=pytest.mark.slow), 0.1, 0.5])
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
    light, (bare_w, _) = plate(device, 0.0), bare_flux_w(device)  # all rays weigh the same, those of ghosts too
    total_w = sum(path.flux_w for path in light.paths)
    expected = plate_mean(lambda r: (1 - r) / (1 + r))
    assert Z * math.sqrt(expected * (1 - expected) / light.ends["launched"]) < 3e-4  # so this holds to 3e-4 or better
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


# --- real lenses, beside the independent tracer -------------------------------------------------------------

LENSES = ("sphere-singlet", "sphere-doublet")
ORACLE_RAYS = 2**21  # of which the aperture takes a third
PIXEL_RAYS = 2**22


def one_pixel(name):
    """A preset lit by one screen pixel beside the middle, where the stop cuts into its light from one side."""
    scene = load_scene(name)
    screen = replace(scene.screen, pixels=(1, 1), centre_offset_mm=(0.35, -0.25))
    return replace(scene, screen=screen)


@cache
def lens_light(name, device):
    return trace_paths(one_pixel(name), device=device, rays_per_pixel=PIXEL_RAYS, replicates=1, seed=51)


@cache
def oracle_light(name):
    return sequence.from_one_pixel(one_pixel(name), ORACLE_RAYS, np.random.default_rng(52))


def moments(place, weight):
    """Of light at places (column, row) [n, 2]: means of column, row, their squares and product, and their variances.

    Places from the detector's middle, in pixels; those of the kernel are whole pixels, so the oracle's are rounded too.
    """
    x, y = (place - 62).T
    values, share = np.stack([x, y, x * x, y * y, x * y]), weight / weight.sum()
    mean = values @ share
    return mean, (values - mean[:, None]) ** 2 @ share


@pytest.mark.parametrize("name", LENSES)
def test_a_real_lens_images_the_mirror_as_the_oracle_says(device, name):
    """Where one screen pixel's light lands through the lens, without its ghosts: place, size and shape of its image."""
    light, oracle = lens_light(name, device), oracle_light(name)
    rays = light.paths[0].rays
    assert light.paths[0].kind == "direct" and min(rays, len(oracle.flux_w)) > 200_000
    image = light.images_w[0, DIRECT, 0]
    np.testing.assert_array_equal(image, light.images_w[0, DIRECT, 1])  # its column is its row
    row, column = np.divmod(np.arange(len(image)), 125)
    found, variance = moments(np.stack([column, row], -1), image)
    expected, of_oracle = moments(np.rint(oracle.place), oracle.flux_w)
    z = (found - expected) / np.sqrt(variance / rays + of_oracle / len(oracle.flux_w))
    assert np.abs(z).max() < sidak_z(len(z), CHANCE)
    radius = math.sqrt(expected[2] + expected[3])
    assert math.sqrt(variance[0] / rays) < 0.002 * radius  # so this holds to a hundredth of the image or better


@pytest.mark.parametrize("name", LENSES)
def test_a_real_lens_passes_the_light_that_the_oracle_says(device, name):
    """In watts, with Fresnel's losses at all surfaces."""
    light, oracle = lens_light(name, device), oracle_light(name)
    flux_w, error_w = flux_of(light, light.paths[0].name)
    # a hit or a miss of about equal weights
    error = math.sqrt((1 - len(oracle.flux_w) / ORACLE_RAYS) / len(oracle.flux_w))
    expected = oracle.flux_w.sum()
    assert abs(flux_w - expected) < Z * math.hypot(error_w, error * expected)
    assert Z * math.hypot(error_w / expected, error) < 0.02  # less than a single surface reflects


@pytest.mark.second_device
def test_paths_tell_how_sharp_they_are(device):
    """Of the path by its name; what is in no path of its own has no focus. tests/test_sequence.py has the figures."""
    paths = {path.name: path for path in lens_light("sphere-singlet", device).paths}
    direct = paths["screen > mirror > lens.front > lens.back > detector"]
    ghost = paths["screen > mirror > lens.front > lens.back (r) > lens.front (r) > lens.back > detector"]
    assert abs(direct.focus_mm) < 2e-6 and direct.blur_mm < 2e-7  # lengths are told to 1e-6 mm
    assert ghost.focus_mm == pytest.approx(-14.714, abs=1e-3)
    assert ghost.blur_mm == pytest.approx(5.092, abs=1e-3)
    assert math.isnan(paths["other"].focus_mm) and math.isnan(paths["other"].blur_mm)


def slopes_behind(steps, axis, across, height_mm, origin):
    """Height and slope behind a lens, against its axis, of two rays at +-height_mm in front: half their difference.

    Their difference does not tell of a lens that stands aside by the rounding of its file. origin: where both rays come
    from, or None for rays along the axis.
    """
    first = steps[0].vertex
    start = first + 0.01 * steps[0].axis + np.array([[height_mm], [-height_mm]]) * across
    away = np.stack([-axis, -axis]) if origin is None else sequence.unit(start - origin)
    points, directions = start, away
    for step in steps:
        points, directions, _ = sequence.pass_step(step, points, directions)
    slope = directions @ across / -(directions @ axis)
    height = (points - steps[-1].vertex) @ across
    return (height[0] - height[1]) / 2, (slope[0] - slope[1]) / 2


def lens_matrix(scene):
    """Paraxial matrix (height, slope) from the first vertex to the last, by refraction and transfer; and their gap."""
    elements, matrix = scene.element, np.eye(2)
    for k, surface in enumerate(elements):
        if k:
            gap = math.dist(elements[k - 1].position_mm, surface.position_mm)
            matrix = np.array([[1.0, gap], [0.0, 1.0]]) @ matrix
        # a radius below 0 has its centre behind the front, where the light goes: convex
        power = (surface.index_back - surface.index_front) / -surface.radius_mm
        behind = surface.index_back
        matrix = np.array([[1.0, 0.0], [-power / behind, surface.index_front / behind]]) @ matrix
    return matrix


@pytest.mark.parametrize("name", LENSES)
def test_the_lenses_have_the_focal_length_of_a_thick_lens(name):
    """The oracle's rays near the axis, the paraxial matrix, for a singlet the lensmaker's formula, and the preset."""
    scene = load_scene(name)
    steps, matrix = sequence.lens_of(scene), lens_matrix(scene)
    axis = sequence.unit(np.array(scene.camera.look_at_mm) - scene.camera.position_mm)  # to the mirror
    _, slope = slopes_behind(steps, axis, np.array([0.0, 1.0, 0.0]), 1e-3, None)
    focal_length = -1e-3 / slope
    assert focal_length == pytest.approx(-1 / matrix[1, 0], rel=1e-6, abs=0)  # aberration: (1e-3 / 16)^2
    assert focal_length == pytest.approx(16.0, rel=1e-6, abs=0)  # radii are told to 1e-6 mm of 8
    if len(scene.element) == 2:
        front, back = scene.element
        n, r1, r2 = front.index_back, -front.radius_mm, -back.radius_mm
        gap = math.dist(front.position_mm, back.position_mm)
        power = (n - 1) * (1 / r1 - 1 / r2 + (n - 1) * gap / (n * r1 * r2))
        assert focal_length == pytest.approx(1 / power, rel=1e-6, abs=0)


@pytest.mark.parametrize("name", LENSES)
def test_the_detectors_stand_where_the_lenses_image_the_mirror(name):
    """Rays from the mirror's middle meet behind the lens on the detector: by the oracle and by the paraxial matrix."""
    scene = load_scene(name)
    camera, last = scene.camera, np.array(scene.element[-1].position_mm)
    axis = sequence.unit(np.array(camera.look_at_mm) - camera.position_mm)
    height, slope = slopes_behind(sequence.lens_of(scene), axis, np.array([0.0, 1.0, 0.0]), 1e-3, np.zeros(3))
    behind = camera.detector_distance_mm - (np.array(camera.position_mm) - last) @ axis  # from the last vertex
    assert -height / slope == pytest.approx(behind, rel=1e-6, abs=0)
    first = math.dist(scene.element[0].position_mm, (0.0, 0.0, 0.0))
    h, u = lens_matrix(scene) @ [first, 1.0]
    assert -h / u == pytest.approx(behind, rel=1e-6, abs=0)


# --- bookkeeping --------------------------------------------------------------------------------------------


@cache
def ghosts(device):
    return trace_paths(load_scene("ghosts"), device=device, rays_per_pixel=8192, replicates=4, seed=61)


def test_all_rays_end_and_all_light_has_a_path(device):
    """Ends, ledger and paths count the same rays; images of a kind hold the light of its paths."""
    light = ghosts(device)
    ends = dict(light.ends)
    launched, parted = ends.pop("launched"), ends.pop("parted")
    assert (launched, parted) == (8192 * 21 * 21, 0)  # nothing scatters
    assert sum(ends.values()) == launched
    assert (ends["failed"], ends["absorbed by panel"]) == (0, 0)  # its back is never lit
    assert min(ends[key] for key in ("detected", "escaped", "bounce limit", "absorbed by stop")) > 0
    assert sum(path.rays for path in light.paths) == ends["detected"]
    assert sum(light.ledger.values()) == 2 * light.ledger["launched"]  # beside the fates: their sum
    of_kind = light.images_w[:, :, :21].sum((2, 3)).mean(0)
    for kind in ("direct", "ghost"):
        flux_w = sum(path.flux_w for path in light.paths if path.kind == kind)
        flux_w += light.paths[-1].flux_w if kind == "ghost" else 0.0  # paths not kept apart count as ghosts
        assert of_kind[KINDS.index(kind)] == pytest.approx(flux_w, rel=1e-4, abs=0)  # of weights in steps of 2^-22
    assert [path.flux_w for path in light.paths[:-1]] == sorted((p.flux_w for p in light.paths[:-1]), reverse=True)
    assert light.paths[-1].name == "other"


def test_kinds_of_paths_add_up_to_all_light(device):
    light = ghosts(device)
    pattern = LineScan(light.scene)
    whole = light.images(pattern)
    components = [light.only(kind).images(pattern) for kind in KINDS]
    for axis in ("x", "y"):
        split = [getattr(component, axis).flux_w for component in components]
        np.testing.assert_allclose(sum(split), getattr(whole, axis).flux_w, rtol=1e-15, atol=0)  # rounding
        assert split[DIRECT].any() and split[GHOST].any() and not split[SCATTER].any()
        both = getattr(light.only("direct", "ghost").images(pattern), axis).flux_w
        np.testing.assert_array_equal(both, getattr(whole, axis).flux_w)
    assert {path.kind for path in light.only("ghost").paths} == {"ghost"}
    with pytest.raises(ValueError, match="^brightness: "):
        light.line_flux_w("x", np.ones((21, 21)))


def test_the_same_seed_gives_the_same_bits_for_any_cut_into_launches(device, monkeypatch):
    def run(seed=7):
        return trace_paths(load_scene("sphere-singlet"), device=device, rays_per_pixel=5000, replicates=2, seed=seed)

    first, again = run(), run()
    monkeypatch.setattr(nonsequential.PathTask, "max_rays_per_item", 768)
    monkeypatch.setattr(RateMeter, "launch_rays", lambda self, first: 100_000)
    cut, other = run(), run(seed=8)
    for light in (again, cut):
        np.testing.assert_array_equal(light.images_w, first.images_w)
        assert light.paths == first.paths and light.ends == first.ends
    assert not np.array_equal(other.images_w, first.images_w)
    assert not np.array_equal(first.images_w[0], first.images_w[1])


def test_replicates_are_independent_parts_of_the_rays(device):
    """One of two replicates is what a run of its rays alone gives; between many, flux scatters as counting says."""
    scene = load_scene("sphere-singlet")
    coarse = replace(scene.camera.detector, pixels=(25, 25), pitch_mm=0.185)  # 64 replicates of its images take 20 MB
    scene = replace(scene, camera=replace(scene.camera, detector=coarse))
    alone = trace_paths(scene, device=device, rays_per_pixel=2048, replicates=1, seed=71)
    many = trace_paths(scene, device=device, rays_per_pixel=2048 * 64, replicates=64, seed=71)
    np.testing.assert_array_equal(many.images_w[0], alone.images_w[0])
    for path in many.paths[:2]:
        counted_w = path.flux_w * math.sqrt((1 - path.rays / many.ends["launched"]) / path.rays)
        lower, upper = stats.chi2.isf([1 - CHANCE / 2, CHANCE / 2], 63)
        # rays of fixed numbers per screen pixel scatter less than all at random: by the spread of pixels' shares
        assert lower * 0.5 < 63 * (path.standard_error_w / counted_w) ** 2 < upper, path.name
    assert np.isnan(alone.paths[0].standard_error_w)


@pytest.mark.second_device
def test_rays_are_given_up_at_the_bounce_limit(device):
    """Of the same rays, two events leave those to be given up that three detect: the detector is the third element."""
    scene = load_scene("sphere")
    ends = []
    for limit in (1, 2, 3):
        tracer = path_tracer_of(scene, device, TraceOptions(NONSEQUENTIAL, seed=81, bounce_limit=limit))
        sums, _ = run_rays(tracer, np.array([512]))
        ends.append(tracer.task.light.ends(sums, 512 * tracer.sources))
    one, two, three = ends
    assert (one["detected"], two["detected"]) == (0, 0)
    assert three["detected"] > 0 and three["bounce limit"] == 0
    assert two["bounce limit"] == three["detected"]  # after mirror and lens; none misses the detector
    assert one["bounce limit"] == one["launched"] - one["escaped"]  # all that meet the mirror, and nothing else
    assert two["absorbed by stop"] == three["absorbed by stop"] > 0


def test_a_bounce_limit_leaves_shorter_paths_as_they_are(device):
    """Four events are the direct path through a singlet; what takes more is given up, and brings no light."""
    scene = load_scene("sphere-singlet")
    few, all_of = (
        trace_paths(scene, device=device, rays_per_pixel=4096, replicates=1, seed=82, bounce_limit=n) for n in (4, 10)
    )
    assert [path.kind for path in few.paths] == ["direct", "other"]
    assert (few.paths[0].rays, few.paths[0].flux_w) == (all_of.paths[0].rays, all_of.paths[0].flux_w)
    np.testing.assert_array_equal(few.images_w[:, DIRECT], all_of.images_w[:, DIRECT])
    assert all_of.images_w[:, GHOST].any() and not few.images_w[:, [GHOST, SCATTER]].any()
    assert few.ends["bounce limit"] > all_of.ends["bounce limit"]
    with pytest.raises(ValueError, match="no path from the screen reaches it"):
        trace_paths(scene, device=device, rays_per_pixel=16, replicates=1, bounce_limit=3)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"bounce_limit": 0}, "bounce_limit = 0: must be 1 to 42"),
        ({"bounce_limit": 43}, "bounce_limit = 43: must be 1 to 42"),
        ({"least_chance": -0.1}, "least_chance = -0.1: must be 0 to 0.5"),
        ({"least_chance": 0.51}, "least_chance = 0.51: must be 0 to 0.5"),
        ({"replicates": 0}, "replicates = 0: must be 1 to 1024"),
        ({"seed": -1}, "seed = -1: must be 0 to 2^64 - 1"),
    ],
)
def test_options_out_of_range_are_refused(values, line):
    with pytest.raises(ValueError, match=".") as caught:
        trace_paths(load_scene("sphere"), **values)
    assert str(caught.value) == line


@pytest.mark.parametrize("name", ["sphere", "sphere-singlet"])
def test_how_many_rays_go_side_by_side_changes_no_path(device, monkeypatch, name):
    """The list of rays closes up in the same order at every width; rounding may differ, and move a ray in 10,000."""
    runs = []
    for width in (1, 8, 16) if device.kind == "cpu" else (1,):
        monkeypatch.setattr(type(device), "vector_width", lambda self, precision, width=width: width)
        runs.append(trace_paths(load_scene(name), device=device, rays_per_pixel=1024, replicates=2, seed=9))
    for run in runs[1:]:
        for end, count in runs[0].ends.items():
            assert abs(run.ends[end] - count) <= 1e-4 * runs[0].ends["launched"] * (end != "launched"), end
        assert run.paths[0].rays == pytest.approx(runs[0].paths[0].rays, rel=1e-3, abs=0)  # a few at the aperture's rim


def test_trace_reaches_every_choice_of_the_estimator(device):
    """And launch_rays, which no result depends on: as many launches as it says."""
    scene, given = coarse_screen(load_scene("sphere-singlet")), {"device": device, "rays_per_pixel": 1024, "seed": 3}
    choices = {"bounce_limit": 6, "least_chance": 0.3, "branches": "split", "aimed_scatter": False}
    launches = []
    light = trace(scene, estimator=NONSEQUENTIAL, replicates=2, launch_rays=2**13, **given, **choices,
                  progress=lambda done, total: launches.append(done))  # fmt: skip
    assert {name: getattr(light.options, name) for name in choices} == choices
    assert len(launches) == pytest.approx(49 * 1024 / 2**13, abs=2)
    whole = trace_paths(scene, replicates=2, **given, **choices)
    np.testing.assert_array_equal(light.images_w, whole.images_w)
    other = trace_paths(scene, replicates=2, **given, **(choices | {"branches": "random"}))
    assert light.ends["parted"] > 0 == other.ends["parted"]
