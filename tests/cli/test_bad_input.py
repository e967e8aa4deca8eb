"""What a user may get wrong, command by command: one line that names it, exit code 2, nothing written, no long wait."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic import small_scene

from irtscots_cl.imaging.patterns import LineScan

SCENE = small_scene("sphere", 9)
FEW = ("--rays-per-pixel", "64", "--replicates", "2", "--quiet")
SCENE_COMMANDS = {
    "run": ("run", "{}", "--out", "out"),
    "kernel": ("kernel", "{}"),
    "paths": ("paths", "{}"),
    "reconstruct": ("reconstruct", "images.h5", "--scene", "{}", "--out", "out"),
}


def write_images(path, **changed):
    """A file of images, all of it 1, with other content of some datasets; None leaves one out."""
    lines = {axis: LineScan(SCENE).positions_mm(axis) for axis in "xy"}
    content = {f"images/{axis}": np.ones((21, 9, 9)) for axis in "xy"} | {f"lines/{a}_mm": lines[a] for a in "xy"}
    content |= {name.replace("__", "/"): value for name, value in changed.items()}
    with h5py.File(path, "w") as file:
        for name, value in content.items():
            if value is not None:
                file[name] = value


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("irtscots_cl.pipeline.simulate.trace", lambda *_, **__: pytest.fail("traced"))
    monkeypatch.setattr("irtscots_cl.bench.suite.run_throughput", lambda *_, **__: pytest.fail("measured"))
    Path("mine.toml").write_text(SCENE.to_toml())
    write_images("images.h5")
    Path("file").write_text("no TOML")
    Path("empty.toml").write_bytes(b"")
    Path("folder.toml").mkdir()
    return tmp_path


def refused(outcome, *words, code=2):
    found, out, err = outcome
    assert (found, out) == (code, "") and err.startswith("irtscots: ") and err.count("\n") == 1, outcome
    assert all(word in err for word in words), err
    assert not Path("out").exists()


@pytest.mark.parametrize("command", SCENE_COMMANDS)
@pytest.mark.parametrize(
    ("scene", "line"),
    [
        ("./file", "./file: is not valid TOML: "),
        ("./none", "./none: cannot be read: No such file or directory"),
        ("empty.toml", "empty.toml: name: missing; "),
        ("folder.toml", "folder.toml: cannot be read: Is a directory"),
        ("", "'': unknown scene; "),
    ],
)
def test_what_is_no_scene(irtscots, here, command, scene, line):
    refused(irtscots(*(part.format(scene) for part in SCENE_COMMANDS[command])), f"irtscots: {line}")


def cut(share):
    def change(path):
        data = path.read_bytes()
        path.write_bytes(data[: int(share * len(data))])

    return change


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (cut(0), "not a readable HDF5 file: "),
        (cut(0.001), "not a readable HDF5 file: "),
        (cut(0.9), "not a readable HDF5 file: "),
        (lambda path: (path.unlink(), path.mkdir()), "no manifest.toml in it, which says what the images show"),
        (lambda path: path.unlink(), "not a readable HDF5 file: there is no file of that name"),
        (lambda path: write_images(path, images__x=None), "/images/x: missing; must be a dataset of real numbers"),
        (lambda path: write_images(path, lines__y_mm=None), "/lines/y_mm: missing; must be a dataset of real numbers"),
        (lambda path: write_images(path, images__x=np.ones((21, 9, 9), bool)), "/images/x: of type bool; must be a "),
        (lambda path: write_images(path, images__y=np.ones((21, 9, 9), complex)), "/images/y: of type complex128; "),
        (lambda path: write_images(path, images__x=h5py.Empty("f8")), "/images/x: empty; must be a dataset of real"),
        (lambda path: write_images(path, images__x=np.ones((9, 9))), "images of the x scan have shape (9, 9); must be"),
        (lambda path: write_images(path, images__x=np.ones((20, 9, 9))), "the x scan has 20 images but line positions"),
        (
            lambda path: write_images(
                path, images__y=np.where(np.arange(81).reshape(9, 9) == 40, np.inf, np.ones((21, 1, 1)))
            ),
            "images/y[0, 4, 4] = inf: must be a finite number within 1e+100",
        ),
        (lambda path: write_images(path, lines__x_mm=np.full(21, np.nan)), "lines/x_mm[0] = nan: must be a finite"),
        (
            lambda path: write_images(path, lines__x_mm=LineScan(SCENE).positions_mm("x") / 1e3),
            "/lines/x_mm: 21 lines from -0.002 to 0.002 mm, ",
        ),
        (
            lambda path: write_images(path, images__x=np.ones((21, 9, 8)), images__y=np.ones((21, 9, 8))),
            "scene sphere: images of (9, 8) and (9, 8) (rows, columns) do not fit; must be of the scene's detector",
        ),
    ],
)
@pytest.mark.parametrize("measure", ["paper", "fine"])
def test_what_are_no_images(irtscots, here, change, line, measure):
    change(Path("images.h5"))
    arguments = ("reconstruct", "images.h5", "--scene", "mine.toml", "--out", "out", "--measure", measure)
    refused(irtscots(*arguments), f"irtscots: images.h5: {line}")


OUT_COMMANDS = {
    "run": ("run", "mine.toml", *FEW),
    "reconstruct": ("reconstruct", "images.h5", "--scene", "mine.toml"),
    "bench": ("bench", "--quick"),
    "reproduce": ("reproduce", "table4", "--quick", "--quiet"),
}


@pytest.mark.needs_device
@pytest.mark.parametrize("command", OUT_COMMANDS)
@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("file", "--out = 'file': file is not a folder"),
        ("file/below", "file is not a folder"),
        ("a\0b", "--out = 'a\\x00b': no folder can have this name"),
        ("/proc/none", "/proc/none"),
        ("/dev/null", "--out = '/dev/null': /dev/null is not a folder"),
    ],
)
def test_a_folder_that_cannot_be_written_is_refused_before_the_work(irtscots, here, monkeypatch, command, out, words):
    monkeypatch.setattr("irtscots_cl.pipeline.measure.estimate_centroids", lambda *_, **__: pytest.fail("measured"))
    monkeypatch.setattr("irtscots_cl.studies.suite.run_study", lambda *_, **__: pytest.fail("traced"))
    refused(irtscots(*OUT_COMMANDS[command], "--out", out), words)


@pytest.mark.parametrize(
    ("command", "names"),
    [
        ("run", ("result.h5", "report.json", "report.html", ".lock", "figures/height.png")),
        ("reconstruct", ("result.h5", "figures/slopes.png")),
        ("bench", ("bench.json", "bench.png")),
        ("reproduce", ("reproduce.json", ".lock")),
    ],
)
def test_a_folder_in_the_place_of_a_result_is_refused_before_the_work(irtscots, here, command, names):
    for k, name in enumerate(names):
        place = Path(f"results{k}") / name
        place.mkdir(parents=True)
        line = f"--out = 'results{k}': {name} is a folder there; must be a file"
        refused(irtscots(*OUT_COMMANDS[command], "--out", f"results{k}"), line)
        assert list(place.iterdir()) == []


@pytest.mark.needs_device
def test_a_checkpoint_of_the_wrong_kind_is_refused(irtscots, here):
    Path("a/checkpoint").mkdir(parents=True)
    Path("b").mkdir()
    Path("b/checkpoints").write_text("")
    for more in ((), ("--resume",)):
        line = "a/checkpoint: is a folder; must be the checkpoint's file, or not be there"
        refused(irtscots(*OUT_COMMANDS["run"], "--out", "a", *more), line)
        line = "b/checkpoints: is a file; must be the checkpoints' folder, or not be there"
        refused(irtscots(*OUT_COMMANDS["reproduce"], "--out", "b", *more), line)
    assert sorted(os.listdir("a") + os.listdir("b")) == ["checkpoint", "checkpoints"]


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "-1", "1e400", "x", "", "9" * 30])
@pytest.mark.parametrize(
    ("command", "option"),
    [
        *(("run", o) for o in ("rays-per-pixel", "replicates", "seed", "overfill", "bounce-limit", "least-chance")),
        *(("paths", o) for o in ("rays-per-pixel", "replicates", "seed", "bounce-limit", "least-chance")),
        ("reconstruct", "threshold"),
    ],
)
def test_an_absurd_value_is_refused(irtscots, here, command, option, value):
    arguments = {"run": ("run", "mine.toml", "--out", "out", "--estimator", "nonsequential"),
                 "paths": ("paths", "mine.toml"),
                 "reconstruct": (*OUT_COMMANDS["reconstruct"], "--out", "out")}[command]  # fmt: skip
    refused(irtscots(*arguments, f"--{option}={value}"), f"--{option}")


@pytest.mark.parametrize("value", ["nan", "-inf", "-1", "0", "x"])
@pytest.mark.parametrize("option", ["target-nm", "max-seconds", "saturation"])
def test_an_absurd_limit_is_refused(irtscots, here, option, value):
    command = "reconstruct" if option == "saturation" else "run"
    refused(irtscots(*OUT_COMMANDS[command][: 4 if command == "reconstruct" else 2], "--out", "out",
                     f"--{option}={value}"), f"--{option}")  # fmt: skip


@pytest.mark.parametrize(
    ("options", "words"),
    [
        *(
            (("--estimator", "analytic", f"--{name}", value), f"--{name}: must be left out with --estimator analytic")
            for name, value in (("rays-per-pixel", "64"), ("replicates", "3"), ("sampler", "sobol"),
                                ("precision", "fp32"), ("device", "no such"), ("dask", "nowhere"),
                                ("max-seconds", "5"))
        ),
        (("--overfill", "2"), "--overfill = 2.0: must go with --estimator forward, not adjoint"),
        (("--estimator", "analytic", "--overfill", "2"), "--overfill = 2.0: must go with --estimator forward"),
    ],
)  # fmt: skip
def test_options_without_effect_are_refused(irtscots, here, options, words):
    refused(irtscots("run", "mine.toml", "--out", "out", *options), words)


@pytest.mark.parametrize(
    "words, cause",
    [
        (("rnu", "sphere"), "did you mean run?"),
        (("desing-patterns",), "did you mean design-patterns?"),
        (("run", "sphere", "--rays-per-pixel", "1,000"), "--rays-per-pixel = '1,000': must be a whole number"),
        (("run", "sphere", "--target-nm", "3nm"), "--target-nm = '3nm': must be a number, without commas or units"),
        (("run", "notes.txt"), "write ./notes.txt for the file of that name"),
        (("run", "mine"), "; mine is a folder"),
    ],
)
def test_the_cause_of_a_wrong_line_is_named(words, cause, irtscots, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "notes.txt").touch()
    (tmp_path / "mine").mkdir()
    refused(irtscots(*words), cause)
