"""Line scans with dark, bias and flat frames, bad pixels and exposures: the light alone is left, and is measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from noisy_images import images_of, small

from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.orientation import stored
from irtscots_cl.pipeline.lab_lines import calibrated_lines
from irtscots_cl.pipeline.measure import RefusedImagesError, measure

SCENE = small(25)
STUCK = (12, 10)  # upright; sees the mirror


@pytest.fixture(autouse=True)
def without_figures(monkeypatch):
    monkeypatch.setattr("irtscots_cl.report.figures.write_figures", lambda *_: [])


class Camera:
    """A camera of 12 bits whose pixels differ: raw = bias + time (current + response light), in whole counts."""

    def __init__(self):
        self.random = np.random.default_rng(4)
        row, column = np.mgrid[:25, :25]
        self.bias, self.current = 200.0 + 5 * row, 40.0 + column
        response = 1 - 0.3 * (column / 25 - 0.5) ** 2
        self.response = response / np.median(response)

    def record(self, light, time=1.0):
        values = self.bias + time * (self.current + self.response * light)
        raw = np.clip(np.rint(values + self.random.normal(0, 2, values.shape)), 0, 4095)
        raw[..., STUCK[0], STUCK[1]] = 4095
        return raw

    def files(self, folder, word="upright", *, dark=1.0, **more):
        """Calibration frames [10, rows, columns] that lie as `word` says."""
        folder.mkdir(exist_ok=True)
        frames = {
            "bias": self.record(np.zeros((10, 25, 25)), 0.0),
            "dark": self.record(np.zeros((10, 25, 25)), dark),
            "flat": self.record(np.full((10, 25, 25), 2000.0)),
        }
        for name, images in frames.items():
            np.save(folder / f"{name}.npy", stored(images, word).astype(np.uint16))
        paths = {name: (folder / f"{name}.npy",) for name in frames}
        return CameraFiles(**paths, dark_exposure_s=dark, flat_exposure_s=1.0, **more)


def light_images():
    images = images_of(SCENE)
    return images.each(lambda a: 3000 * a / images.peak)


@pytest.mark.parametrize("word", ["upright", "quarter-turn", "columns-reversed"])
def test_the_light_alone_is_left(tmp_path, word):
    camera, light = Camera(), light_images()
    raw = light.each(camera.record).stack()
    found = calibrated_lines(raw, camera.files(tmp_path, word), word)
    assert found.facts["dead_pixels"] == 1 and found.bad[STUCK] and {c.level for c in found.checks} == {"ok"}
    for scan, images in ((found.stack.x, light.x), (found.stack.y, light.y)):
        values = scan.flux_w[0].T.reshape(images.shape)
        off = (values - images)[:, ~found.bad]
        limit = 5 * np.hypot(2 / np.sqrt(len(off)), 2 / np.sqrt(10))  # 5 sigma: of the lines' mean and the dark's
        assert np.isfinite(off).all() and np.abs(off.mean(0)).max() < limit
        assert np.isnan(values[:, found.bad]).all()


def test_the_height_is_that_of_a_perfect_camera(tmp_path):
    camera, light = Camera(), light_images()
    perfect = measure(light.noisy(2 / 3000, 3).stack(), SCENE.nominal(), tmp_path / "perfect")
    facts = measure(
        light.each(camera.record).stack(), SCENE.nominal(), tmp_path / "lab", camera=camera.files(tmp_path / "c")
    )
    assert facts["camera"]["averaged"] == {"bias": 10, "dark": 10, "flat": 10}
    assert facts["pixels_used"] == perfect["pixels_used"] - 1
    own, other = (f["deviation_nm_rms"]["piston_tilt"] for f in (facts, perfect))
    assert own == pytest.approx(other, abs=4 * facts["height_standard_error_nm"])


def test_exposures_of_a_file_are_merged_or_kept(tmp_path):
    camera, light = Camera(), light_images()
    both = light.each(lambda a: np.stack([camera.record(a, 0.5), camera.record(a, 4.0)]))
    known = camera.files(tmp_path, exposures_s=(0.5, 4.0), dark=4.0)
    merged = calibrated_lines(both.stack(), known, "upright")
    assert merged.stack.x.flux_w.shape[0] == 1 and merged.facts["exposures_s"] == [0.5, 4.0]
    values = merged.stack.x.flux_w[0].T.reshape(light.x.shape)[:, ~merged.bad]
    expected = 0.5 * light.x[:, ~merged.bad]
    dim = expected < 100
    assert np.std((values - expected)[dim]) < 0.6  # 2 counts in 0.5 s alone, 0.25 in both, and the mean frames' noise
    assert np.abs(values - expected).max() < 12  # where the long exposure saturates
    kept = calibrated_lines(both.stack(), replace(known, exposures_s=()), "upright")
    assert kept.stack.x.flux_w.shape[0] == 2
    with pytest.raises(ValueError, match=r"the x scan has 2 exposures, the camera's table tells of 3"):
        calibrated_lines(both.stack(), replace(known, exposures_s=(), repeats=3), "upright")


def test_dark_frames_with_light_are_refused(tmp_path):
    camera, light = Camera(), light_images()
    files = camera.files(tmp_path)
    with pytest.raises(RefusedImagesError, match=r"lab.h5: dark: parts of the images are .* counts darker"):
        measure(
            light.each(camera.record).stack(), SCENE.nominal(), tmp_path / "out", source="lab.h5",
            camera=CameraFiles(dark=files.flat),
        )  # fmt: skip
    assert not (tmp_path / "out").exists()
