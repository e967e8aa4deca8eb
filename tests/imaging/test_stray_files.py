"""The file of stray light: what is written comes back, and what is no such file is refused in one line."""

from __future__ import annotations

from dataclasses import fields, replace

import h5py
import numpy as np
import pytest
from scenes import with_part
from small_budget import small_scene
from stray_files import REPLICATES, made_maps, write_made

from irtscots_cl.imaging.stray_files import read_stray_maps
from irtscots_cl.maths.statistics import jackknife_error
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.instrument import ORIENTATIONS
from irtscots_cl.scene.scatter.models import Harvey
from irtscots_cl.scene.screen_response import ScreenResponse


def oblong(orientation="upright"):
    """A small scene whose detector has other numbers of rows and columns."""
    scene = small_scene(12)
    detector = replace(scene.camera.detector, pixels=(12, 9), orientation=orientation)
    return with_part(scene, "camera", detector=detector)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "stray-light.h5"


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_maps_come_back_and_lie_as_the_images_do(path, orientation):
    scene = oblong(orientation)
    maps = made_maps(scene)
    maps.of_direct[2, 3] = np.nan
    write_made(path, scene, ghost=maps)
    found = read_stray_maps(path, scene)
    assert list(found) == ["ghost"]
    for one in fields(maps):
        if one.name != "facts":
            assert np.array_equal(getattr(found["ghost"], one.name), getattr(maps, one.name), equal_nan=True), one.name
    with h5py.File(path) as file:
        assert file["ghost/of_direct"].shape == ((12, 9) if "transposed" in orientation or "quarter" in orientation
                                                 else (9, 12))  # fmt: skip
        assert file.attrs["orientation"] == orientation and file["ghost/change/x_mm"].attrs["unit"] == "mm"
        errors = file["ghost/change/y_standard_error_mm"][()]
        assert np.sort(errors.ravel()) == pytest.approx(np.sort(jackknife_error(maps.change_mm)[1].ravel()))
        assert file["ghost/change/y_left_out_mm"].shape[0] == REPLICATES


def test_what_changes_no_shares_and_no_places_may_differ(path):
    scene = oblong()
    write_made(path, scene, scatter=made_maps(scene))
    detector = replace(scene.camera.detector, noise=DetectorNoise(electrons_at_peak=1e4, shot_noise=True))
    other = with_part(with_part(scene, "camera", detector=replace(detector, orientation="transposed")), "screen",
                      response=ScreenResponse(), radiance=3.0)  # fmt: skip
    other = replace(other, name="other", budget=Budget(sources={"camera.x_mm": 0.1}))
    found = read_stray_maps(path, other)["scatter"]
    assert np.array_equal(found.of_direct, made_maps(scene).of_direct)  # on the upright grid, as the file says


PLATE = Element("plate", "absorber", (-200.0, 0.0, 4000.0), (0.0, 0.0, 0.0), size_mm=(3.0, 3.0))


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        (lambda s: with_part(s, "mirror", radius_mm=4000.0), "mirror.radius_mm = 4166.747, here it is 4000.0;"),
        (lambda s: with_part(s, "mirror", scatter=Harvey(l=0.01, s=-1.5, tis=0.1)), "mirror.scatter.model = none, "),
        (lambda s: with_part(s, "screen", pitch_mm=0.1), "screen.pitch_mm = 0.2, here it is 0.1;"),
        (lambda s: with_part(s, "camera", aperture_diameter_mm=2.0), "camera.aperture_diameter_mm = 1.0, here"),
        (lambda s: replace(s, element=(PLATE,)), "element[0].name = none, here it is plate;"),
        (lambda s: with_part(s, "camera", detector=replace(s.camera.detector, pixels=(9, 9))),
         "camera.detector.pixels = [12, 9], here it is [9, 9];"),
    ],
)  # fmt: skip
def test_another_scene_is_refused_by_its_first_difference(path, changed, told):
    scene = oblong()
    write_made(path, scene, ghost=made_maps(scene))
    with pytest.raises(ValueError, match="stray-light.h5: is of a scene with") as caught:
        read_stray_maps(path, changed(scene))
    assert told in str(caught.value) and "irtscots paths SCENE --out DIR" in str(caught.value)
    assert "\n" not in str(caught.value)


def without(name):
    def spoil(file):
        del file[name]

    return spoil


def another(name, values):
    def spoil(file):
        del file[name]
        file[name] = values

    return spoil


def attribute(name, value):
    def spoil(file):
        file.attrs[name] = value

    return spoil


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (attribute("content", "maps"), "holds no maps of stray light; must be a stray-light.h5 of `irtscots paths"),
        (attribute("scene", "name = 1"), "scene: "),
        (without("ghost/of_direct"), "ghost/of_direct: missing; must be a dataset"),
        (another("ghost/change/x_mm", np.zeros((9, 11))), "ghost/change/x_mm: of shape [9, 11] and type float64; must"),
        (another("ghost/change/x_mm", np.zeros((9, 12), int)), "type int64; must be numbers [9, 12]"),
        (another("ghost/change/x_left_out_mm", np.zeros(0)), "of 0 replicates; must be of 1 to 10000"),
        (another("ghost/height_nm", np.full((9, 12), np.inf)), "ghost/height_nm: holds an infinite value"),
        (another("ghost/change/y_mm", h5py.ExternalLink("other.h5", "/x")), "its values are in another file"),
    ],
)
def test_broken_files_are_refused(path, spoil, told):
    scene = oblong()
    write_made(path, scene, ghost=made_maps(scene))
    with h5py.File(path, "r+") as file:
        spoil(file)
    with pytest.raises(ValueError, match="stray-light.h5: ") as caught:
        read_stray_maps(path, scene)
    assert told in str(caught.value) and "\n" not in str(caught.value)


def test_other_files_are_refused(path, tmp_path):
    scene = oblong()
    with pytest.raises(ValueError, match="there is no file of that name"):
        read_stray_maps(path, scene)
    with pytest.raises(ValueError, match="it is a folder"):
        read_stray_maps(tmp_path, scene)
    path.write_text("no HDF5")
    with pytest.raises(ValueError, match="holds no maps of stray light; must be a stray-light.h5 of"):
        read_stray_maps(path, scene)
    write_made(path, scene, ghost=made_maps(scene))
    path.write_bytes(path.read_bytes()[:900])
    with pytest.raises(ValueError, match="stray-light.h5: not a readable HDF5 file"):
        read_stray_maps(path, scene)
