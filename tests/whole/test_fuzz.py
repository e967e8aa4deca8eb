"""Files made by chance are refused in one line or mean something; they never crash, hang, or fill the memory.

IRTSCOTS_FUZZ: how many scene files, and a tenth as many image files (default 1000, also in .ci/run).
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from fuzz import scene_file, seeds

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.optics.chief_rays import ChiefRays, check_visible
from irtscots_cl.report.result_file import write_result
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.packing.scene import pack
from irtscots_cl.tracing.trace import trace

resource = pytest.importorskip("resource")  # limits of memory: POSIX systems

SCENES = int(os.environ.get("IRTSCOTS_FUZZ", "1000"))
IMAGES = SCENES // 10
RUNS = 2 + SCENES // 1000  # whole commands on refused files, and as many on others
MAX_SECONDS = 5.0  # of one file
MAX_BYTES = 2**30
ADDRESSES = 6 * 2**30  # compilers and mathematics libraries reserve far more than they use
PATHS = (str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2]))
MAX_LINE = 2000  # characters of a refusal
LARGE = 2**14  # pixels; above, a scene that loads is left at that: its calibration takes seconds, not chance


def follow(path: Path) -> str:
    """What becomes of a scene file: refused, large, unseen or a scene. Fails on a refusal that is not one line."""
    try:
        scene = load_scene(path)
    except SceneError as error:
        assert str(error).isprintable() and len(str(error)) < MAX_LINE, ascii(error)
        return "refused"
    if np.prod(scene.screen.pixels) > LARGE or np.prod(scene.camera.detector.pixels) > LARGE:
        return "large"
    chief = ChiefRays(scene)
    try:
        check_visible(chief, path.name)
    except SceneError as error:
        assert str(error).isprintable() and len(str(error)) < MAX_LINE, ascii(error)
        return "unseen"
    assert np.isfinite(np.frombuffer(pack(chief, "fp64").scene.tobytes(), np.uint8)).all()
    return "scene"


def test_scene_files_made_by_chance(tmp_path):
    path, found = tmp_path / "fuzz.toml", dict.fromkeys(("refused", "unseen", "scene", "large"), 0)
    for number in range(SCENES):
        path.write_bytes(scene_file(number))
        start = time.perf_counter()
        try:
            found[follow(path)] += 1
        except Exception as error:
            pytest.fail(f"scene file {number}: {type(error).__name__}: {error}")
        assert time.perf_counter() - start < MAX_SECONDS, number
    assert min(found["refused"], found["scene"]) > SCENES // 10, found  # or they test nothing


@pytest.mark.parametrize(
    "preset, old, new",
    [
        ("off-axis", "aperture_diameter_mm = 1.0", "aperture_diameter_mm = 1e6"),  # no ray comes back to the screen
        ("sphere-deviated", "pitch_mm = 0.514", "pitch_mm = 1e12"),  # the deviation overflows beside the mirror
    ],
)
def test_scene_files_that_once_failed(tmp_path, preset, old, new):
    text = next(text for text in seeds() if f'"{preset}"' in text)
    (tmp_path / "fuzz.toml").write_text(text.replace(old, new))
    assert old in text and follow(tmp_path / "fuzz.toml") == "unseen"


@pytest.mark.parametrize("size", ["5e-324", "1e-300", "9.9e-13"])
def test_lengths_whose_inverse_overflows_are_refused(tmp_path, size):
    text = next(text for text in seeds() if '"sphere"' in text)
    number, old = re.search(r"(pitch_mm = )[\d.]+", text).span(), text
    (tmp_path / "fuzz.toml").write_text(old[: number[0]] + f"pitch_mm = {size}" + old[number[1] :])
    assert follow(tmp_path / "fuzz.toml") == "refused"


# A program of its own: a fault of the HDF5 library would end the tests. It prints what each file came to.
FOLLOW_IMAGES = """
import sys, time, warnings
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from fuzz import image_file, peak_bytes
import irtscots_cl.report.figures
from irtscots_cl.cli import main

folder, count = Path(sys.argv[1]), int(sys.argv[2])
good = (folder / "good.h5").read_bytes()
irtscots_cl.report.figures.write_figures = lambda *_: []  # they take longer than all else
for number in range(count):
    print(number, end=" ", flush=True)
    image_file(number, good, folder / "bad.h5")
    arguments = ["reconstruct", str(folder / "bad.h5"), "--scene", str(folder / "s.toml"), "--out", str(folder / "out")]
    arguments += ["--measure", ("fine", "refined")[number // 5 % 2]] if number % 5 == 0 else []
    start, out, err = time.perf_counter(), StringIO(), StringIO()
    with warnings.catch_warnings(), redirect_stdout(out), redirect_stderr(err):
        warnings.simplefilter("error")
        code = main(arguments)
    said = err.getvalue()
    lines = said.splitlines()
    good_line = all(line.isprintable() and line.startswith("irtscots: ") for line in lines) and (
        all(line.startswith("irtscots: warning: ") for line in lines) if code == 0 else len(lines) == 1
    )
    print(code, good_line, f"{time.perf_counter() - start:.3f}", peak_bytes(), flush=True)
"""
COMMAND = """
import sys
from pathlib import Path
from fuzz import peak_bytes
from irtscots_cl.cli import main

code = main(sys.argv[1:])
Path("peak").write_text(str(peak_bytes()))
sys.exit(code)
"""


def limited() -> None:
    """In a child process: memory of which libraries may reserve some, and no more."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))


def program(text: str, *arguments: str, cwd: Path, seconds: float) -> subprocess.CompletedProcess:
    """What a Python program gives within limits."""
    return subprocess.run([sys.executable, "-c", text, *arguments], cwd=cwd, capture_output=True, text=True,
                          timeout=seconds, preexec_fn=limited,
                          env=os.environ | {"PYTHONPATH": os.pathsep.join(PATHS)})  # fmt: skip


@pytest.fixture(scope="module")
def images(tmp_path_factory) -> Path:
    """A folder with good.h5 and s.toml, the images of a small scene."""
    folder = tmp_path_factory.mktemp("images")
    (folder / "s.toml").write_text(next(text for text in seeds() if "sphere-deviated" in text))
    scene = load_scene(folder / "s.toml")
    stack = trace(scene, estimator="analytic").images(LineScan(scene))
    write_result(folder / "good.h5", stack, measure_by("paper", stack, scene.nominal()), {})
    return folder


def test_image_files_made_by_chance(images):
    done = program(FOLLOW_IMAGES, str(images), str(IMAGES), cwd=images, seconds=20 + IMAGES)
    lines = [line.split() for line in done.stdout.splitlines()]
    assert done.returncode == 0 and len(lines) == IMAGES, (lines[-1:], done.stderr[-2000:])
    codes = [line[1] for line in lines]
    assert {*codes} == {"0", "2"} and min(codes.count("0"), codes.count("2")) > IMAGES // 10
    assert all(line[2] == "True" for line in lines), next(line for line in lines if line[2] != "True")
    assert max(float(line[3]) for line in lines) < MAX_SECONDS
    assert int(lines[-1][4]) < MAX_BYTES


@pytest.mark.slow
def test_the_command_on_scene_files_made_by_chance(tmp_path):
    """Whole runs, half of them of what loads."""
    path, runs, codes = tmp_path / "fuzz.toml", {"refused": 0, "scene": 0}, []
    for number in range(10_000, 20_000):
        path.write_bytes(scene_file(number))
        kind = follow(path)
        if kind not in runs or runs[kind] == RUNS:
            continue
        runs[kind] += 1
        estimator = ("adjoint", "analytic")[number % 2]  # the second builds no kernels
        arguments = ("run", "fuzz.toml", "--rays-per-pixel", "64", "--estimator", estimator, "--out", "out")
        done = program(COMMAND, *arguments, cwd=tmp_path, seconds=120)
        assert done.returncode == (2 if kind == "refused" else done.returncode), number
        assert done.returncode in (0, 2), (number, done.stderr[-2000:])
        told = [line for line in done.stderr.splitlines() if not line.startswith("irtscots: warning: ")]
        assert len(told) == (done.returncode == 2), (number, done.stderr)
        assert int((tmp_path / "peak").read_text()) < MAX_BYTES, number
        codes.append(done.returncode)
        if min(runs.values()) == RUNS:
            break
    assert 0 in codes
