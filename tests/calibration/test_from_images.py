"""Measurements from images and files, against the places that the light really has."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import h5py
import numpy as np
import pytest
from calibrations import write_places
from noisy_images import Images, images_of, small
from scenes import with_part

from irtscots_cl.calibration import from_images as module
from irtscots_cl.calibration.from_images import ThinnedSetup, from_file, from_images, is_of_images, step_of
from irtscots_cl.calibration.jacobian import design_centroids
from irtscots_cl.calibration.measured import Measurement
from irtscots_cl.calibration.parameters import moved
from irtscots_cl.imaging.orientation import stored
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.optics.setup import Setup

SCENE = small(25).nominal()
TRUE = {"camera.tilt_y_rad": 1e-3, "screen.x_mm": 0.3}


@lru_cache
def images(seed: int = 1) -> Images:
    return images_of(moved(SCENE, TRUE)).noisy(0.002, seed)


def pulls(m: Measurement) -> np.ndarray:
    """Places less those of the true chief rays and the light's offsets from them, over their errors."""
    true = design_centroids(moved(SCENE, TRUE), SCENE, m.place_of())
    return (m.places_mm - m.offsets_mm - true) / m.errors_mm


def test_places_and_their_errors():
    m, checks = from_images(images().stack(), SCENE, name="lab.h5")
    assert m.scene == SCENE and m.name == "lab.h5" and 150 < len(m.pixels) < 320
    z = pulls(m)
    # both are 1 but for what the unknown geometry does to the light's model; 5 sigmas of 500 numbers
    assert abs(z.mean()) < 0.5 and 0.7 < z.std() < 1.5
    assert not {check.name for check in checks} & {"outline", "place x", "place y"}


def test_a_better_guess_of_the_geometry_has_a_better_model_of_the_light():
    m, _ = from_images(images().stack(), SCENE, moved(SCENE, TRUE))
    assert m.scene == SCENE
    z = pulls(m)
    assert abs(z.mean()) < 5 / np.sqrt(z.size) and 0.8 < z.std() < 1.2
    for scene, is_guess in ((moved(SCENE, TRUE), True), (SCENE, False)):
        setup = Setup(scene)
        there = np.stack(setup.chief_rays.reverse(*m.place_of())[1:])
        offsets = np.stack(design_points(setup)[2:]).reshape(2, -1)[:, m.pixels] - there
        assert np.array_equal(m.offsets_mm, offsets) == is_guess


def test_offsets_are_small_and_those_of_the_light():
    m, _ = from_images(images().stack(), SCENE)
    assert 0 < np.abs(m.offsets_mm).max() < 0.05 * SCENE.screen.pitch_xy_mm[0]
    assert np.abs(m.mirror_offsets_mm).max() < 1.0  # of pixels of 43 mm


def test_pixels_at_the_edge_as_seen_and_as_believed_are_left_out():
    m, _ = from_images(images().stack(), SCENE)
    whole = np.zeros(25 * 25, bool)
    whole[m.pixels] = True
    for scene in (SCENE, moved(SCENE, TRUE)):
        assert Setup(scene).chief_rays.footprint.coverage.ravel()[whole].min() > 0.999


def test_images_that_are_turned_are_refused():
    turned = images().each(lambda a: a[..., ::-1, :])
    with pytest.raises(ValueError, match="orientation: centroids fit the design .* times better with"):
        from_images(turned.stack(), SCENE)


def test_large_images_are_thinned():
    m, checks = from_images(images().stack(), SCENE, most=60)
    assert step_of(SCENE, 60) == 3
    row, column = m.place_of()
    assert set((row % 3).tolist()) == {1} == set((column % 3).tolist()) and 10 < len(m.pixels) < 60
    assert "pixels" not in {check.name for check in checks}
    every, _ = from_images(images().stack(), SCENE)
    common = np.isin(every.pixels, m.pixels)
    # the noise and the frames' gains are told from fewer pixels
    np.testing.assert_allclose(m.places_mm[:, np.isin(m.pixels, every.pixels)], every.places_mm[:, common],
                               atol=2 * np.median(m.errors_mm))  # fmt: skip


def test_a_thinned_setup_is_the_whole_one_on_its_pixels():
    whole, thin = Setup(SCENE), ThinnedSetup(SCENE, 3)
    there = thin.chief_rays.wanted
    assert there.sum() == 8 * 8
    for name in ("x_mm", "v_mm", "coverage"):
        values = [getattr(s.chief_rays.footprint, name) for s in (whole, thin)]
        np.testing.assert_allclose(values[0][there], values[1][there], rtol=1e-14)  # other parts, other rounding
        assert not np.any(np.nan_to_num(values[1][~there]))
    np.testing.assert_array_equal(whole.chief_rays.sees_mirror[there], thin.chief_rays.sees_mirror[there])
    for k in (0, 1):
        for one, other in zip(whole.chief_rays.light_shape(k), thin.chief_rays.light_shape(k), strict=True):
            np.testing.assert_allclose(one[there], other[there], rtol=1e-12)


# --- files --------------------------------------------------------------------------------------------------


def test_a_file_of_places(tmp_path):
    path = tmp_path / "places.h5"
    write_places(path)
    assert not is_of_images(path)
    m, _ = from_file(path, SCENE, name="places", turn_rad=0.3)
    assert len(m.pixels) == 25 * 25 and m.turn_rad == 0.3 and (m.offsets_mm == 0).all()


@pytest.mark.parametrize("orientation", ["rows-reversed", "quarter-turn"])
def test_files_lie_as_the_scene_says(tmp_path, orientation):
    """Images and places in files that are turned give the measurement of upright ones."""
    detector = replace(SCENE.camera.detector, orientation=orientation)
    scene = with_part(SCENE, "camera", detector=detector)
    direct, _ = from_images(images().stack(), SCENE)
    of = images().each(lambda a: stored(a, orientation))
    with h5py.File(tmp_path / "images.h5", "w") as file:
        file["images/x"], file["images/y"], file["lines/x_mm"], file["lines/y_mm"] = of.x, of.y, of.lines_x, of.lines_y
    m, _ = from_file(tmp_path / "images.h5", scene)
    np.testing.assert_array_equal(m.pixels, direct.pixels)
    np.testing.assert_allclose(m.places_mm, direct.places_mm, atol=1e-12)
    write_places(tmp_path / "places.h5")
    upright, _ = from_file(tmp_path / "places.h5", SCENE)
    with h5py.File(tmp_path / "places.h5", "r+") as file:
        for dataset in file["screen"].values():
            dataset[...] = stored(dataset[()], orientation)
    turned, _ = from_file(tmp_path / "places.h5", scene)
    np.testing.assert_array_equal(turned.places_mm, upright.places_mm)


def test_a_file_of_images(tmp_path):
    path, of = tmp_path / "images.h5", images()
    with h5py.File(path, "w") as file:
        file["images/x"], file["images/y"], file["lines/x_mm"], file["lines/y_mm"] = of.x, of.y, of.lines_x, of.lines_y
    assert is_of_images(path)
    m, _ = from_file(path, SCENE)
    direct, _ = from_images(of.stack(), SCENE)
    np.testing.assert_array_equal(m.places_mm, direct.places_mm)


def test_places_and_images_as_the_camera_stores_them(tmp_path):
    path, of = tmp_path / "places.h5", images()
    detector = replace(SCENE.camera.detector, orientation="quarter-turn")
    scene = with_part(SCENE, "camera", detector=detector)
    u = np.arange(625.0).reshape(25, 25)
    write_places(path, screen__x_mm=stored(u, "quarter-turn"))
    m, _ = from_file(path, scene)
    np.testing.assert_array_equal(m.places_mm[0], u.ravel())
    with h5py.File(tmp_path / "images.h5", "w") as file:
        file["images/x"], file["images/y"] = (stored(a, "quarter-turn") for a in (of.x, of.y))
        file["lines/x_mm"], file["lines/y_mm"] = of.lines_x, of.lines_y
    turned, plain = from_file(tmp_path / "images.h5", scene)[0], from_images(of.stack(), SCENE)[0]
    np.testing.assert_array_equal(turned.places_mm, plain.places_mm)


def test_pixels_that_may_not_be_used(tmp_path):
    use = np.ones((25, 25), bool)
    use[:, :12] = False
    write_places(tmp_path / "places.h5")
    assert len(from_file(tmp_path / "places.h5", SCENE, use=use)[0].pixels) == 25 * 13
    some, _ = from_images(images().stack().masked(use), SCENE)
    assert len(some.pixels) > 50 and (some.pixels % 25).min() >= 12


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"screen__y_standard_error_mm": None},
            "/screen/y_standard_error_mm: missing; a calibration needs places with",
        ),
        ({"screen__y_mm": np.zeros((24, 25))}, "v_mm has shape (24, 25); must be the detector's (25, 25)"),
    ],
)
def test_files_that_lack_something(tmp_path, change, message):
    write_places(tmp_path / "places.h5", **change)
    with pytest.raises(ValueError, match=r"^\S*places\.h5: ") as caught:
        from_file(tmp_path / "places.h5", SCENE)
    assert message in str(caught.value)


def test_what_is_no_file(tmp_path):
    with pytest.raises(ValueError, match="not a readable HDF5 file: there is no file of that name"):
        from_file(tmp_path / "none.h5", SCENE)


def test_exact_images_have_errors_of_the_lights_model():
    """Without noise the stated errors do not vanish: the model is good to FLOOR of a line."""
    scene = with_part(SCENE, "screen", pixels=SCENE.screen.pixels)
    m, _ = from_images(images_of(scene).stack(), replace(scene))
    assert m.errors_mm.min() >= module.FLOOR * scene.screen.pitch_xy_mm[0]
