"""A camera's images of the pictures of `irtscots patterns`, as files: counts, noise, orientation, what is refused."""

from dataclasses import replace

import numpy as np
import pytest
import tifffile
from pattern_folders import small_scene

import irtscots_cl as irt
from irtscots_cl.imaging.sequences import TimeOrder, in_order
from irtscots_cl.pipeline.pattern_kinds import sinusoids
from irtscots_cl.pipeline.show import show_frames

TOP = 4095
DARK = 0.015 * TOP


@pytest.fixture(scope="module")
def run():
    return irt.trace(small_scene("sphere"), estimator="analytic")


@pytest.fixture
def folder(run, tmp_path):
    series, _ = sinusoids(run.scene, [0.9], 4)
    show_frames(run.scene, tmp_path, in_order(series, TimeOrder("x-then-y", ("start",), ("start",), 1, 1)))
    return tmp_path


def images(paths):
    return np.stack([tifffile.imread(path) for path in paths]).astype(float)


def test_counts_are_those_of_the_electrons(run, folder):
    dark, white, *fringes = images(irt.record_pictures(run, folder, electrons=8000, full_well_e=10_000))
    assert len(fringes) == 8
    count_e = 10_000 / TOP
    assert np.std(dark) == pytest.approx(np.hypot(2.5 / count_e, 12**-0.5), rel=0.15)  # 4 sigma of 576 pixels
    assert np.mean(dark) == pytest.approx(DARK, abs=0.2)
    assert np.max(white) == pytest.approx(DARK + 8000 / count_e, abs=5 * 8000**0.5 / count_e)
    mean = np.mean(fringes, axis=0) - DARK  # four steps twice: half of white
    lit = white > TOP / 2
    assert np.mean(mean[lit] / (white[lit] - DARK)) == pytest.approx(0.5, abs=0.005)


def test_the_noise_is_of_the_seed(run, folder, tmp_path):
    first = images(irt.record_pictures(run, folder, seed=3))
    for path in (folder / "camera").iterdir():
        path.unlink()
    assert np.array_equal(images(irt.record_pictures(run, folder, seed=3)), first)
    for path in (folder / "camera").iterdir():
        path.unlink()
    other = images(irt.record_pictures(run, folder, seed=4))
    assert not np.array_equal(other, first)


def test_images_lie_as_the_scene_says(run, folder):
    straight = images(irt.record_pictures(run, folder))
    for path in (folder / "camera").iterdir():
        path.unlink()
    detector = replace(run.scene.camera.detector, orientation="half-turn")
    turned = replace(run, scene=replace(run.scene, camera=replace(run.scene.camera, detector=detector)))
    assert np.array_equal(images(irt.record_pictures(turned, folder)), straight[:, ::-1, ::-1])


def test_a_folder_with_images_is_kept(run, folder):
    irt.record_pictures(run, folder)
    with pytest.raises(ValueError, match="camera: has files"):
        irt.record_pictures(run, folder)


@pytest.mark.parametrize(
    ("given", "said"),
    [({"electrons": 0.0}, "electrons = 0"), ({"read_noise_e": -1.0}, "read_noise_e = -1"), ({"bits": 17}, "bits = 17")],
)
def test_numbers_out_of_range_are_refused(run, folder, given, said):
    with pytest.raises(ValueError, match=said):
        irt.record_pictures(run, folder, **given)
    assert not (folder / "camera").exists()


def test_pictures_of_another_screen_are_refused(run, folder):
    other = replace(run, scene=replace(run.scene, screen=replace(run.scene.screen, pixels=(10, 10))))
    with pytest.raises(ValueError, match="screen"):
        irt.record_pictures(other, folder)
