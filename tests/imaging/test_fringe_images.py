"""Images of fringes by their manifest: names, order, means, and what does not fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fringe_folders import Lab
from noisy_images import small

from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.fringe_images import is_fringe_input, open_fringe_images, own_manifest
from irtscots_cl.imaging.fringe_manifest import DARK, WHITE, FringeManifest, frames_of
from irtscots_cl.imaging.fringes import FringeSet

SETS = tuple(FringeSet.equal(axis, (0.9,), 3) for axis in "xy")
SUFFIXES = frozenset({".tif", ".png"})


@pytest.fixture(scope="module")
def scene():
    return small(12).nominal()


@pytest.fixture
def lab(scene):
    manifest = FringeManifest(scene.name, scene.screen.pixels, frames_of(SETS), ("camera",), 8)
    return Lab(manifest, (np.arange(8)[:, None, None] * 10 + np.zeros((8, 12, 12))).astype(np.uint16))


def test_the_stack_has_the_manifests_order_and_the_means(scene, lab, tmp_path):
    lab.write(tmp_path)
    images = open_fringe_images([tmp_path], scene, camera=CameraFiles(saturation=999.0))
    stack = images.stack()
    assert [int(image[0, 0]) for image in (stack.frames[k] for k in range(6))] == [20, 30, 40, 50, 60, 70]
    assert stack.dark[0, 0] == 0 and stack.white[0, 0] == 10 and stack.saturation == 999
    assert images.stack(50.0).saturation == 50
    assert images.name(images.of_stack(2)) == "image 5 (IMG_5.tif)"
    assert (images.names_of(DARK), images.names_of(WHITE)) == ("image 1 (IMG_1.tif)", "image 2 (IMG_2.tif)")


@pytest.mark.parametrize("gone", [0, 4, 7])
def test_a_missing_image_is_named_by_the_gap_in_the_numbers(scene, lab, tmp_path, gone):
    lab.write(tmp_path)[gone].unlink()
    with pytest.raises(ValueError, match="7 images") as caught:
        open_fringe_images([tmp_path], scene)
    assert ("IMG_5.tif (x fringes of 0.9 periods at 240 degrees) is missing" in str(caught.value)) == (gone == 4)


def test_too_many_images_and_other_shapes_are_refused(scene, lab, tmp_path):
    more = replace(lab, frames=np.concatenate([lab.frames, lab.frames[:1]]))
    more.write(tmp_path / "more")
    with pytest.raises(ValueError, match=r"9 images.*has 8 frames: too many"):
        open_fringe_images([tmp_path / "more"], scene)
    replace(lab, frames=lab.frames[:, :, :10]).write(tmp_path / "narrow")
    with pytest.raises(ValueError, match="images of 10 x 12 pixels"):
        open_fringe_images([tmp_path / "narrow"], scene)


def test_the_manifest_among_paths(lab, tmp_path):
    paths = lab.write(tmp_path)
    table = tmp_path / "manifest.toml"
    assert own_manifest([tmp_path]) == (table, []) and own_manifest([*paths, table]) == (table, paths)
    with pytest.raises(ValueError, match="no manifest.toml in it"):
        own_manifest([tmp_path / "camera"])
    with pytest.raises(ValueError, match="need one manifest"):
        own_manifest(paths)
    assert is_fringe_input(paths[:2], SUFFIXES) and is_fringe_input([tmp_path], SUFFIXES)
    assert is_fringe_input([table], SUFFIXES) and not is_fringe_input([tmp_path / "scan.h5"], SUFFIXES)
