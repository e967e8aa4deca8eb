"""Chief rays: axes, signs, what pixels cover of the mirror, and refused scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lopsided import lopsided
from oracle import tracer
from scenes import SEQUENTIAL, scene_of

from irtscots_cl.optics import chief_rays
from irtscots_cl.optics.chief_rays import SUBPIXELS, ChiefRays, check_visible
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError


def with_mirror(scene, **changes):
    return replace(scene, mirror=replace(scene.mirror, **changes))


def tilted(scene, **noll_um):
    terms = {int(index.removeprefix("z")): value for index, value in noll_um.items()}
    radius = scene.mirror.diameter_mm / 2
    return with_mirror(scene, zernike=(ZernikeTerms(radius_mm=radius, ordering="noll", coefficients_um=terms),))


# --- axes and signs ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*SEQUENTIAL, "lopsided"])
def test_columns_grow_with_the_mirrors_x_and_rows_with_its_y(name):
    chief = ChiefRays(scene_of(name))
    rows, columns = chief.shape
    x, y = chief.footprint.x_mm, chief.footprint.y_mm
    inner = np.isfinite(x[:, 1:]) & np.isfinite(x[:, :-1])
    assert inner.sum() > 1000 and (np.diff(x, axis=1)[inner] > 0).all()
    inner = np.isfinite(y[1:]) & np.isfinite(y[:-1])
    assert inner.sum() > 1000 and (np.diff(y, axis=0)[inner] > 0).all()
    assert (rows, columns) == scene_of(name).camera.detector.pixels[::-1]


def test_the_centre_pixel_looks_at_what_the_camera_looks_at():
    scene = load_scene("sphere")
    chief = ChiefRays(scene)
    points, u, v = chief.reverse(62, 62)
    np.testing.assert_allclose(points, [0, 0, 0], rtol=0, atol=1e-12)  # mm: rounding at 4 m
    np.testing.assert_allclose([u, v], [0, 0], rtol=0, atol=1e-9)  # mm: presets' positions are equal but for sign
    _, columns = chief.shape
    assert chief.camera_model.image_point(0, columns - 1)[0] == pytest.approx(62 * 0.037, rel=1e-14)  # rounding
    assert chief.camera_model.image_point(-0.5, 0)[1] == pytest.approx(-62.5 * 0.037, rel=1e-14)  # rounding


def test_the_mirror_behind_the_camera_is_not_seen():
    """The camera looks along the mirror; the lines of pixels that look up meet the mirror backwards."""
    scene = load_scene("sphere")
    camera = replace(
        scene.camera, position_mm=(0.0, 0.0, 100.0), look_at_mm=(500.0, 0.0, 70.0), focal_length_mm=20.0,
        detector=replace(scene.camera.detector, pixels=(41, 1), pitch_mm=0.5),
    )  # fmt: skip
    chief = ChiefRays(replace(scene, camera=camera))
    row, column = np.zeros(41), np.arange(41)
    points, u, v = chief.reverse(row, column)
    met = np.isfinite(points).all(-1)
    assert 10 < met.sum() < 31 and (points[met, 0] > 0).all()  # ahead; with the others about half would be behind
    assert not np.isfinite(u[~met] + v[~met]).any()
    assert not chief.sees_mirror[0, ~met].any() and chief.sees_mirror.any()


def test_a_pixel_covers_about_nine_point_six_millimetres():
    chief = ChiefRays(load_scene("sphere"))
    step = chief.footprint.x_mm[62, 63] - chief.footprint.x_mm[62, 62]
    expected = 0.037 * 4166.747 / 16.0617 / np.cos(np.radians(3))  # seen at 3 degrees from the normal
    assert step == pytest.approx(expected, rel=1e-3)  # the perspective over one pixel


@pytest.mark.parametrize(("term", "axis"), [("z2", 0), ("z3", 1)])
def test_a_tilt_moves_the_light_downhill_by_twice_the_slope(term, axis):
    """dz/dx > 0 turns the normal to -x, and the light lands at smaller u; the same for y and v."""
    scene = load_scene("sphere")
    amount_um = 2.0
    slope = 2 * amount_um * 1e-3 / 532.0  # Noll's tilt is 2 rho cos
    straight, turned = (ChiefRays(s).reverse(62, 62)[1:] for s in (scene, tilted(scene, **{term: amount_um})))
    moved = np.subtract(turned, straight)
    assert moved[axis] == pytest.approx(-2 * slope * 4166.747, rel=0.01)  # cos 3 degrees
    assert abs(moved[1 - axis]) < 0.01 * abs(moved[axis])  # the same


def test_power_moves_the_light_of_opposite_pixels_oppositely():
    scene = load_scene("sphere")
    amount_um = 0.5  # sqrt(3) (2 rho^2 - 1): slope 4 sqrt(3) rho / radius
    for row, column, axis, sign in [(62, 100, 0, 1), (62, 24, 0, -1), (100, 62, 1, 1), (24, 62, 1, -1)]:
        points, *straight = ChiefRays(scene).reverse(row, column)
        _, *bent = ChiefRays(tilted(scene, z4=amount_um)).reverse(row, column)
        slope = 4 * np.sqrt(3) * amount_um * 1e-3 * points[axis] / 532.0**2
        moved = bent[axis] - straight[axis]
        assert np.sign(points[axis]) == sign == -np.sign(moved)
        assert moved == pytest.approx(-2 * slope * 4166.747, rel=0.03)  # cosines of up to 8 degrees


def test_reverse_is_the_oracles_path():
    for scene in (load_scene("off-axis"), lopsided()):
        chief = ChiefRays(scene)
        generator = np.random.default_rng(8)
        row, column = generator.uniform(10, 45, (2, 300))
        radius = scene.camera.aperture_diameter_mm / 2
        a, b = generator.uniform(-radius, radius, (2, 300))
        points, u, v = chief.reverse(row, column, a, b)
        columns, rows = scene.camera.detector.pixels
        image = np.stack([column - (columns - 1) / 2, row - (rows - 1) / 2], -1) * scene.camera.detector.pitch_mm
        oracle = tracer.trace_adjoint(scene, image, np.stack([a, b], -1))
        np.testing.assert_allclose(points, oracle.mirror, rtol=0, atol=1e-7)  # 1/10 nm
        np.testing.assert_allclose(np.stack([u, v], -1), oracle.screen, rtol=0, atol=1e-7)  # 1/10 nm


# --- coverage ----------------------------------------------------------------------------------------------


def fine_footprint(chief, which, per_axis=64):
    """Coverage and centroid [rows, columns] of some rows of pixels, by a fine grid of chief rays each."""
    columns = chief.shape[1]
    step = (np.arange(per_axis) + 0.5) / per_axis - 0.5
    covered, x, y = np.zeros((3, len(which), columns))
    for k, row in enumerate(which):
        points, _, _ = chief.reverse(row + step[:, None], (np.arange(columns)[:, None] + step)[:, None, :])
        on = chief.surface.contains(points[..., 0], points[..., 1])
        covered[k] = on.mean((1, 2))
        with np.errstate(invalid="ignore"):
            x[k] = np.where(on, points[..., 0], 0).sum((1, 2)) / on.sum((1, 2))
            y[k] = np.where(on, points[..., 1], 0).sum((1, 2)) / on.sum((1, 2))
    return covered, x, y


@pytest.mark.parametrize(("name", "which"), [("coarse sphere", slice(None)), ("lopsided", slice(2, None, 9))])
def test_coverage_and_centroids_against_fine_sampling(name, which):
    if name == "lopsided":
        scene = lopsided()
    else:  # 25 x 25 pixels, which the rim cuts at all angles
        scene = load_scene("sphere")
        camera = replace(scene.camera, detector=replace(scene.camera.detector, pixels=(25, 25), pitch_mm=0.185))
        scene = replace(scene, camera=camera)
    chief = ChiefRays(scene)
    coverage, x, y = fine_footprint(chief, np.arange(chief.shape[0])[which])
    footprint = chief.footprint
    found, found_x, found_y = footprint.coverage[which], footprint.x_mm[which], footprint.y_mm[which]
    edge = (coverage > 0) & (coverage < 1)
    assert edge.sum() > 30
    # A straight edge through n x n samples moves by at most about one row of them; rms far less.
    assert np.abs(found - coverage).max() < 1 / SUBPIXELS
    assert np.sqrt(np.mean((found - coverage)[edge] ** 2)) < 0.01  # twice the half percent that SUBPIXELS is for
    assert (found[coverage == 1] == 1).all()
    size = np.nanmax(np.diff(x, axis=1))
    used = coverage > 0.1
    np.testing.assert_allclose(found_x[used], x[used], rtol=0, atol=0.05 * size)  # a row of samples: 1/20 pixel
    np.testing.assert_allclose(found_y[used], y[used], rtol=0, atol=0.05 * size)  # the same
    full = coverage == 1
    np.testing.assert_allclose(found_x[full], x[full], rtol=0, atol=1e-4 * size)  # 64 points' own midpoint rule
    np.testing.assert_allclose(found_y[full], y[full], rtol=0, atol=1e-4 * size)  # the same
    assert np.isnan(footprint.x_mm[footprint.coverage == 0]).all()


def test_covered_area_is_the_mirrors():
    chief = ChiefRays(load_scene("sphere"))
    corners = chief.reverse(*np.meshgrid(np.arange(126) - 0.5, np.arange(126) - 0.5, indexing="ij"))[0]
    d1, d2 = corners[1:, 1:] - corners[:-1, :-1], corners[1:, :-1] - corners[:-1, 1:]
    pixel_area = 0.5 * np.abs(d1[..., 0] * d2[..., 1] - d1[..., 1] * d2[..., 0])
    area = np.nansum(pixel_area * chief.footprint.coverage)
    assert area == pytest.approx(np.pi * 532.0**2, rel=5e-4)  # 340 edge pixels, each to 1 %, of 9600


def test_footprint_is_symmetric_where_the_test_is():
    footprint = ChiefRays(load_scene("sphere")).footprint
    # the scene is symmetric in y, not in x
    np.testing.assert_array_equal(footprint.coverage, footprint.coverage[::-1])
    np.testing.assert_allclose(footprint.y_mm, -footprint.y_mm[::-1], rtol=0, atol=1e-9)  # mm: rounding at 4 m
    np.testing.assert_allclose(footprint.x_mm, footprint.x_mm[::-1], rtol=0, atol=1e-9)  # mm: rounding at 4 m


def test_a_hole_takes_its_area():
    scene = load_scene("sphere")
    whole = ChiefRays(scene)
    holed = ChiefRays(with_mirror(scene, obscuration_mm=200.0))
    assert holed.footprint.coverage[62, 62] == 0 and not holed.sees_mirror[62, 62] and whole.sees_mirror[62, 62]
    missing = (whole.footprint.coverage - holed.footprint.coverage).sum()
    one = 0.037 * whole.scene.camera.focus_mm / whole.scene.camera.image_distance_mm
    assert missing == pytest.approx(
        np.pi * 100.0**2 / (one**2 / np.cos(np.radians(3))), rel=5e-3
    )  # 70 edge pixels, 1 % each
    far = np.hypot(whole.footprint.x_mm, whole.footprint.y_mm) > 120
    np.testing.assert_array_equal(holed.footprint.coverage[far], whole.footprint.coverage[far])


def test_a_small_hole_is_not_overlooked():
    holed = ChiefRays(with_mirror(load_scene("sphere"), obscuration_mm=4.0))  # smaller than a pixel's footprint
    coverage = holed.footprint.coverage
    area = np.pi * 2.0**2 / (0.037 * holed.scene.camera.focus_mm / holed.scene.camera.image_distance_mm) ** 2
    assert coverage[62, 62] == pytest.approx(1 - area, abs=0.02)  # 16 x 16 samples, 35 of them in the hole
    np.testing.assert_array_equal(np.delete(coverage[62, 50:75], 12), 1)


# --- where the light lands ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*SEQUENTIAL, "lopsided"])
def test_sees_mirror_and_landing_range_hold_for_all_rays(name):
    scene = scene_of(name)
    chief = ChiefRays(scene)
    lowest, highest = chief.landing_range()
    generator = np.random.default_rng(10)
    rows, columns = chief.shape
    pixel_row, pixel_column = generator.integers(0, rows, 40_000), generator.integers(0, columns, 40_000)
    radius = scene.camera.aperture_diameter_mm / 2 * np.sqrt(generator.random(40_000))
    angle = generator.uniform(0, 2 * np.pi, 40_000)
    points, u, v = chief.reverse(
        pixel_row + generator.uniform(-0.5, 0.5, 40_000),
        pixel_column + generator.uniform(-0.5, 0.5, 40_000),
        radius * np.cos(angle),
        radius * np.sin(angle),
    )
    on = chief.surface.contains(points[:, 0], points[:, 1])
    assert on.sum() > 10_000
    assert chief.sees_mirror[pixel_row, pixel_column][on].all()
    screen = scene.screen
    landing = (np.stack([u, v], -1) - screen.centre_offset_mm) / screen.pitch_mm + (np.array(screen.pixels) - 1) / 2
    inside = (landing >= lowest[pixel_row, pixel_column] - 0.02) & (landing <= highest[pixel_row, pixel_column] + 0.02)
    assert inside[on].all()  # 0.02 pixel: cubic terms across a pixel; windows have a margin of one
    width = highest - lowest
    assert np.nanmedian(width) < 3 * scene.camera.aperture_diameter_mm / screen.pitch_mm  # and not by being vast


def test_a_camera_that_looks_past_the_mirror_is_refused():
    scene = load_scene("sphere")
    scene = replace(scene, camera=replace(scene.camera, look_at_mm=(3000.0, 0.0, 0.0)))
    with pytest.raises(
        SceneError, match=r"^mine: camera.look_at_mm = \[3000.0, 0.0, 0.0\]: no detector pixel sees the"
    ):
        check_visible(ChiefRays(scene), "mine")


def test_a_screen_beside_the_light_is_refused_with_the_way_to_it():
    scene = load_scene("sphere")
    scene = replace(scene, screen=replace(scene.screen, centre_offset_mm=(-30.0, 12.0)))
    with pytest.raises(SceneError) as caught:
        check_visible(ChiefRays(scene), "mine")
    message = str(caught.value)
    assert message.startswith("mine: screen.position_mm") and "\n" not in message
    x, y = map(float, message.split("about ")[1].split(" mm")[0].split(", "))
    assert (x, y) == pytest.approx((30.0, -12.0), abs=0.3)  # the spot's own centre lies 0.1 mm off


@pytest.mark.parametrize("name", [*SEQUENTIAL, "lopsided"])
def test_visible_scenes_pass(name):
    check_visible(ChiefRays(scene_of(name)), name)


def test_many_rays_in_parts_are_the_same_rays(monkeypatch):
    chief = ChiefRays(scene_of("lopsided"))
    row, column = np.arange(60.0)[:, None], np.array([3.0, 20.0, 41.0])
    expected = chief.reverse(row, column, 0.1, -0.2)
    monkeypatch.setattr(chief_rays, "MANY_RAYS", 50)
    monkeypatch.setattr(chief_rays, "RAYS_OF_PART", 50)  # 16 rows at a time, the last 12
    for found, rays in zip(chief.reverse(row, column, 0.1, -0.2), expected, strict=True):
        np.testing.assert_allclose(found, rays, rtol=0, atol=1e-9)
    assert chief.reverse(3.0, 4.0)[1].shape == ()
