"""Derivatives of centroids against differences of the chief rays of scenes that were moved."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from lopsided import lopsided
from scenes import scene_of

from irtscots_cl.calibration.jacobian import centroid_jacobian, design_centroids
from irtscots_cl.calibration.parameters import known_parameters, moved, parameter, zernike_names
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.camera_intrinsics import Intrinsics
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.screen_shape import CoverGlass, ScreenShape

TERMS = zernike_names([1, 2, 4, 7, 11, 22])
ROUNDING_MM = 2e-11  # of (u, v): some ulp of lengths of 4 m, times the lever of the reflected ray
STEPS_MM = 5e-10  # distortion is inverted to 1e-13, seen from 4 m away; a bent screen is met to 1e-11
MOVE_MM = 0.1
SCENES = (
    "sphere",
    "off-axis",
    "lopsided",
    "asphere",
    "lopsided-asphere",
    "everything",
    "glass",
    "bent glass",
    "measured",
)


def scene_with(kind: str):
    """A scene; the later ones with roll, clocking, distortion, region of interest, unequal pitches and a shape."""
    if kind == "lopsided":
        return lopsided()
    if kind in ("asphere", "lopsided-asphere"):
        return scene_of(kind)
    if kind in ("sphere", "off-axis"):
        return load_scene(kind)
    scene = load_scene("sphere-deviated")
    intrinsics = Intrinsics(
        image_size_px=(300, 300), roi_px=(10, 20), binning=(2, 2), principal_point_px=(140.0, 150.0),
        distortion=(-0.1, 0.2, 0.001, -0.002, 0.1, 0.01, 0.02, 0.03),
    )  # fmt: skip
    camera = replace(scene.camera, roll_deg=3.0, aperture_offset_mm=(1.0, -2.0), intrinsics=intrinsics)
    sag = ScreenShape(sag_mm=((2, 0, 0.1), (1, 1, 0.2), (0, 3, -0.1)))
    fractions = tuple((x, y) for x in (0.0, 0.5, 1.0) for y in (0.0, 0.3, 1.0))
    points = tuple((4.3 * x - 2 + 0.1 * y, 5.1 * y - 2.6, 0.2 * x * y) for x, y in fractions)
    shapes = {"glass": None, "measured": ScreenShape(fractions=fractions, points_mm=points)}
    glass = CoverGlass(thickness_mm=2.0) if "glass" in kind else None
    screen = replace(scene.screen, clocking_deg=-5.0, pitch_mm=(0.2, 0.25), shape=shapes.get(kind, sag),
                     cover_glass=glass, centre_offset_mm=(0.1, -0.3))  # fmt: skip
    return replace(scene, camera=camera, screen=screen)


def some_pixels(scene, count=30):
    columns, rows = scene.camera.detector.pixels
    random = np.random.default_rng(1)
    return random.uniform(0.3 * rows, 0.7 * rows, count), random.uniform(0.3 * columns, 0.7 * columns, count)


def differences(scene, name, pixels, largest):
    """Derivatives by Richardson's extrapolation of central differences, and their rounding error.

    largest: of the derivatives, in about; the step moves no centroid by more than MOVE_MM.
    """
    step = min(0.1 * parameter(name, scene).scale, MOVE_MM / max(largest, 1e-9))

    def central(h):
        after, before = (design_centroids(moved(scene, {name: v}), scene, pixels) for v in (h, -h))
        return (after - before) / (2 * h)

    rounding = ROUNDING_MM if scene.camera.intrinsics is None else STEPS_MM
    return (4 * central(step / 2) - central(step)) / 3, rounding / step


@pytest.mark.parametrize("kind", SCENES)
def test_the_derivatives_are_those_of_moved_scenes(kind):
    scene = scene_with(kind)
    # measured points carry a sag only where they are: splines between them
    names = [n for n in (*known_parameters(scene), *TERMS) if kind != "measured" or "sag" not in n]
    pixels = some_pixels(scene)
    found = centroid_jacobian(scene, names, pixels)
    assert found.shape == (2, 30, len(names)) and np.isfinite(found).all()
    for k, name in enumerate(names):
        expected, rounding = differences(scene, name, pixels, np.abs(found[..., k]).max())
        assert np.abs(found[..., k] - expected).max() <= 1e-8 * np.abs(expected).max() + rounding, name


def test_a_mirrors_turn_about_its_axis_moves_nothing_on_a_sphere_alone():
    names = ["mirror.clocking_rad", "screen.clocking_rad"]
    found = centroid_jacobian(load_scene("sphere"), names, some_pixels(load_scene("sphere")))
    assert np.abs(found[..., 0]).max() < 1e-8 < np.abs(found[..., 1]).max()  # mm per rad: rounding of 4 m


def test_all_pixels_by_default_row_by_row():
    setup = Setup(load_scene("sphere"))
    found = centroid_jacobian(setup, ["camera.x_mm"]).reshape(2, 125, 125, 1)
    one = centroid_jacobian(setup, ["camera.x_mm"], (30, 80))
    np.testing.assert_array_equal(found[:, 30, 80, 0], one[:, 0, 0])


def test_pixels_that_see_no_mirror_are_nan():
    """A camera that looks along the mirror: the rows of pixels that look up see nothing."""
    scene = load_scene("sphere")
    detector = replace(scene.camera.detector, pixels=(41, 1), pitch_mm=0.5)
    camera = replace(scene.camera, position_mm=(0.0, 0.0, 100.0), look_at_mm=(500.0, 0.0, 70.0), focal_length_mm=20.0,
                     detector=detector)  # fmt: skip
    found = centroid_jacobian(replace(scene, camera=camera), ["camera.x_mm", "zernike.4_um"])
    seen = np.isfinite(found).all((0, 2))
    assert 0 < seen.sum() < 41 and np.isnan(found[:, ~seen]).all()


def test_an_unknown_name_is_refused_with_the_nearest():
    with pytest.raises(ValueError, match="unknown 'camera.w_mm': did you mean camera.z_mm"):
        centroid_jacobian(load_scene("sphere"), ["camera.w_mm"])


def test_forty_unknowns_of_a_whole_detector_take_less_than_a_second():
    scene = load_scene("sphere")
    names = [*known_parameters(scene), *zernike_names(range(4, 11))]
    setup = Setup(scene)
    start = time.process_time()
    found = centroid_jacobian(setup, names)
    assert time.process_time() - start < 2.0  # of processor time; 0.3 s here, twice that on a busy machine
    assert found.shape == (2, 125 * 125, 41)
