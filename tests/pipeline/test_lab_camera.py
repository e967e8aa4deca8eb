"""Dark, flat and bias frames, bad pixels, repeats and exposures of fringe images, from files by the command line."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import dataclass, replace

import h5py
import numpy as np
import pytest
from fringe_folders import recorded, stored_as
from lab_files import write_frames
from scenes import coarse

import irtscots_cl as irt
from irtscots_cl import cli
from irtscots_cl.cli.camera_options import add_camera_files, camera_of
from irtscots_cl.imaging.fringe_images import open_fringe_images
from irtscots_cl.imaging.fringe_manifest import manifest_text
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.orientation import stored
from irtscots_cl.maths.low_order import rms
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.measurement.fringe_quality import Exclusions, Reason
from irtscots_cl.measurement.quality import Check
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.lab_camera import recorded_images
from irtscots_cl.pipeline.measure_fringes import fringe_surface
from irtscots_cl.report.image_types import CameraFacts
from irtscots_cl.scene.presets import load_scene

SETS = tuple(FringeSet.equal(axis, (0.9, 2.46), 4) for axis in "xy")
WORD = "rows-reversed"
READ = 2.0  # counts
STUCK = [(12, 11), (9, 16)]  # pixels that see the mirror
pytestmark = pytest.mark.needs_device


@pytest.fixture(scope="module")
def scene():
    return stored_as(coarse("sphere-deviated", 25), WORD)


@pytest.fixture(scope="module")
def light(scene):
    """Frames of light alone [N, rows, columns], the brightest 0.9 of 4095, and their manifest."""
    lab = recorded(irt.trace(scene, estimator="analytic"), scene, SETS, noise=False, bits=12)
    return replace(lab, frames=np.maximum(lab.frames.astype(float) - 60, 0))


class Camera:
    """A camera with an offset and a response of its own at every pixel, and pixels that are stuck."""

    def __init__(self, shape, seed=5):
        self.random = np.random.default_rng(seed)
        row, column = np.mgrid[: shape[0], : shape[1]]
        self.bias = 100 + 40 * row / shape[0] + self.random.normal(0, 3, shape)
        self.current = 20 + 30 * column / shape[1]  # counts a second
        self.response = 1 - 0.3 * (column / shape[1] - 0.5) ** 2 + self.random.normal(0, 0.02, shape)
        self.stuck = STUCK

    def record(self, light, exposure_s=1.0, top=4095):
        signal = self.bias + exposure_s * (self.current + self.response * light)
        noise = np.hypot(READ, np.sqrt(np.maximum(signal - self.bias, 0) / 5))
        counts = np.clip(np.rint(signal + noise * self.random.standard_normal(np.shape(signal))), 0, top)
        for pixel in self.stuck:
            counts[..., pixel[0], pixel[1]] = top
        return counts.astype(np.uint16)

    def even(self, level, count, exposure_s=1.0):
        return np.stack([self.record(np.full(self.bias.shape, float(level)), exposure_s) for _ in range(count)])


@pytest.fixture
def camera(light):
    return Camera(light.frames.shape[1:])


def lab_folder(path, light, scene, frames, *, table="", kind="tif16", **series):
    """A folder with images, calibration frames by the name of their folder, manifest and scene."""
    write_frames(path / "camera", frames, kind)
    for name, images in series.items():
        write_frames(path / name, images, kind, name=f"{name} {{}}")
    text = manifest_text(light.manifest, "test") + table
    (path / "manifest.toml").write_text(text, encoding="utf-8")
    (path / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
    return path


@dataclass(frozen=True)
class Measured:
    """What a folder gives. stated_nm: rms of the height's error bars. counts: of the pixels by reason."""

    checks: dict[str, Check]
    camera: CameraFacts | None
    saturation: float
    height_nm: np.ndarray
    excluded: np.ndarray
    stated_nm: float
    counts: dict[str, int]

    @property
    def warnings(self):
        return [f"{c.name}: {c.text}" for c in self.checks.values() if c.level != "ok"]


def measured(folder, *options, strict=False):
    """By the command's options, without its files and figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--saturation", type=float, default=math.inf)
    add_camera_files(parser)
    camera = camera_of(parser.parse_args([*map(str, options)]))
    setup = Setup(load_scene(str(folder / "scene.toml")).nominal())
    recorded = recorded_images(open_fringe_images([folder], setup.scene, camera=camera))
    found, checks = fringe_surface(recorded, setup, strict)
    result, reason = found.result, found.reason
    return Measured(
        {c.name: c for c in checks}, recorded.lab and recorded.lab.facts, recorded.ceiling,
        np.where(result.height_mask, result.deviation_mm * 1e6, np.nan), reason,
        rms(error_bars(result).height_mm, result.height_mask) * 1e6,
        Exclusions(reason).counts(found.stored(result.on_mirror)),
    )  # fmt: skip


def refusal(folder, *options, strict=False):
    with pytest.raises(ValueError, match=".") as caught:
        measured(folder, *options, strict=strict)
    assert str(caught.value).isprintable()
    return str(caught.value)


def test_calibrated_frames_give_the_height_of_a_perfect_camera(light, scene, camera, tmp_path):
    """The stuck pixels are bad by the flat frames; the mean frames' errors are stated."""
    series = {"dark": camera.even(0, 16), "flat": camera.even(2500, 16)}
    folder = lab_folder(tmp_path / "a", light, scene, camera.record(light.frames), **series)
    found = measured(folder, "--dark", folder / "dark", "--flat", folder / "flat")
    assert found.warnings == []
    told = found.camera
    assert told["averaged"] == {"dark": 16, "flat": 16} and told["dead_pixels"] == told["bad_pixels"] == 2
    assert told["standard_error"]["dark"] == pytest.approx(np.hypot(READ, np.sqrt(35 / 5)) / 4, rel=0.1)
    assert {"dark", "flat", "bad pixels"} <= set(found.checks)
    assert found.counts["bad"] == 2 and sorted(map(tuple, np.argwhere(found.excluded == Reason.BAD))) == sorted(STUCK)
    clean = lab_folder(tmp_path / "clean", light, scene, np.rint(light.frames + 60).astype(np.uint16))
    difference = found.height_nm - measured(clean).height_nm
    assert 0.3 < np.nanstd(difference) / found.stated_nm < 1.8  # the scatter of 9 low terms, 3 sigma


def test_the_command_takes_options_and_the_manifest_s_table_alike(light, scene, camera, tmp_path, capsys):
    series = {"dark": camera.even(0, 16), "flat": camera.even(2500, 16)}
    table = '[camera]\ndark = "dark"\nflat = ["flat"]\n'
    frames = camera.record(light.frames)
    told = lab_folder(tmp_path / "table", light, scene, frames, table=table, **series)
    folder = lab_folder(tmp_path / "options", light, scene, frames, **series)
    arguments = (folder, "--scene", folder / "scene.toml", "--out", folder / "out", "--dark", folder / "dark", "--flat")
    assert cli.main(["reconstruct", "--json", *map(str, (*arguments, folder / "flat"))]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["camera"]["averaged"] == {"dark": 16, "flat": 16} and facts["images"]["files"] == 18
    assert facts["fringes"]["excluded"]["bad"] == 2
    with h5py.File(folder / "out" / "result.h5") as file:
        assert all(file["excluded"][()][pixel] == Reason.BAD for pixel in STUCK)
        by_table = measured(told)
        assert by_table.camera == facts["camera"]
        np.testing.assert_array_equal(file["deviation_nm"][()], stored(by_table.height_nm, WORD))


def test_a_map_of_bad_pixels_leaves_them_out(light, scene, camera, tmp_path):
    folder = lab_folder(tmp_path, light, scene, camera.record(light.frames))
    bad = np.zeros(light.frames.shape[1:], bool)
    for pixel in STUCK:
        bad[pixel] = True
    np.save(folder / "bad.npy", bad)
    options = ("--bad-pixels", folder / "bad.npy")
    found = measured(folder, *options)
    assert found.camera["bad_pixels"] == 2 == found.counts["bad"]
    bad[:2] = True
    np.save(folder / "bad.npy", bad)
    assert measured(folder, *options).warnings == [
        "bad pixels: 52 bad pixels (8.32%): a camera has few; is the map the right one?"
    ]
    np.save(folder / "bad.npy", ~bad)
    assert "marks 92% of the pixels as bad: must be 0 where they are good" in refusal(folder, *options)


@pytest.mark.parametrize("order", ["together", "in turn"])
def test_repeats_are_averaged(light, scene, camera, tmp_path, order):
    """Four images of each frame halve the error."""
    camera.stuck = []
    repeats = np.stack([camera.record(light.frames) for _ in range(4)])
    frames = (repeats.swapaxes(0, 1) if order == "together" else repeats).reshape(-1, *light.frames.shape[1:])
    one = lab_folder(tmp_path / "one", light, scene, repeats[0])
    folder = lab_folder(tmp_path / "four", light, scene, frames)
    said = refusal(folder)
    assert "72 images; " in said and "are there 4 images of each frame? Then say repeats = 4" in said
    found = measured(folder, "--repeats", 4, "--repeat-order", order)
    assert found.warnings == [] and found.camera["images_per_frame"] == 4
    assert found.stated_nm == pytest.approx(measured(one).stated_nm / 2, rel=0.15)
    if order == "together":  # images of other frames are averaged
        said = refusal(folder, "--repeats", 4, "--repeat-order", "in turn")
        assert said.startswith("repeats: ") and 'another order ("together", "in turn")' in said


def test_exposures_are_merged_without_what_is_saturated(light, scene, camera, tmp_path):
    """The short exposure sees the bright parts, the long one, saturated there, the dark ones."""
    camera.stuck = []
    pair = np.stack([camera.record(light.frames, t) for t in (0.25, 2.0)], axis=1)
    frames = pair.reshape(-1, *light.frames.shape[1:])
    series = {"dark": camera.even(0, 16, 2.0), "bias": camera.even(0, 16, 0.0)}
    folder = lab_folder(tmp_path / "pair", light, scene, frames, **series)
    options = ("--exposures-s", 0.25, 2.0, "--dark", folder / "dark", "--bias", folder / "bias", "--dark-exposure-s", 2)
    found = measured(folder, *options)
    assert found.warnings == [] and found.camera["exposures_s"] == [0.25, 2.0]
    assert found.saturation == 4095  # found in the images: files of 16 bits
    assert "exposures" in found.checks
    short = measured(lab_folder(tmp_path / "short", light, scene, pair[:, 0]))
    assert found.stated_nm < 0.8 * short.stated_nm and found.counts["used"] >= short.counts["used"]
    for wrong, said in (((2.0, 0.25), "images of 2 s are 0.1"), ((0.25, 1.0), "images of 1 s are ")):
        text = refusal(folder, *options, "--exposures-s", *wrong)
        assert said in text and "times as bright as those of" in text
    text = refusal(folder, "--exposures-s", 0.25, 2.0)
    assert "unequal exposures need dark frames of a known exposure (dark_exposure_s), or bias frames" in text


def test_a_white_frame_that_is_saturated_is_bright_all_the_same(light, scene, camera, tmp_path):
    camera.stuck = []
    frames = camera.record(light.frames)
    frames[1] = camera.record(2 * light.frames[1])
    folder = lab_folder(tmp_path, light, scene, frames, dark=camera.even(0, 4))
    found = measured(folder, "--dark", folder / "dark")
    assert (frames[1] == 4095).sum() > 100 and found.saturation == 4095
    assert found.counts["used"] > 380 and found.counts["dark"] < 20


def test_a_colour_mosaic_is_named_unless_flat_frames_take_it_out(light, scene, camera, tmp_path):
    camera.stuck = []
    camera.response = camera.response * np.tile([[0.5, 1.0], [1.0, 0.7]], (13, 13))[:25, :25]
    series = {"dark": camera.even(0, 16), "flat": camera.even(2500, 16)}
    folder = lab_folder(tmp_path, light, scene, camera.record(light.frames), **series)
    warning, _ = measured(folder).warnings  # and noise that is no line over light
    assert warning.startswith("mosaic: the pixels of every square of four have 0.6") and "Bayer" in warning
    assert measured(folder, "--dark", folder / "dark", "--flat", folder / "flat").warnings == []


def contradictions(camera, light):
    """Calibration frames that cannot be, and what is said of them."""
    dark, flat = camera.even(0, 4), camera.even(2500, 4)
    lit = dark.copy()
    lit[2] = camera.even(600, 1)[0]
    return {
        "other size": (
            {"dark": dark[:, :-1]},
            "dark frames: ",
            "25 x 24 pixels; the images have 25 x 25: must be equal",
        ),
        "swapped": ({"dark": flat, "flat": dark}, "flat frames: ", "must be brighter; are they swapped?"),
        "light on the dark": ({"dark": flat}, "dark: parts of the images are", "or the files are swapped"),
        "saturated flat": ({"dark": dark, "flat": camera.even(6000, 4)}, "flat frames: 625 of 625", "too many"),
        "one lit": ({"dark": lit}, "dark frames: ", "dark 3.tif has"),
        "a bit deep": ({"dark": (dark >> 4)}, "dark frames: ", "samples of 8 bits, the images have 16"),
    }


@pytest.mark.parametrize("case", list(contradictions(Camera((25, 25)), None)))
def test_contradictions_are_named(light, scene, camera, tmp_path, case):
    series, *said = contradictions(camera, light)[case]
    folder = lab_folder(tmp_path, light, scene, camera.record(light.frames))
    for name, images in series.items():
        kind = "png8" if case == "a bit deep" else "tif16"
        write_frames(folder / name, images, kind, name=f"{name} {{}}")
    text = refusal(folder, *(part for name in series for part in (f"--{name}", folder / name)), strict=True)
    for part in said:
        assert part in text
