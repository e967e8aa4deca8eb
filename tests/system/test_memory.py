"""What would not fit the memory is refused in one line, before it is taken."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import time
import tracemalloc

import h5py
import numpy as np
import pytest

from irtscots_cl.cli import main
from irtscots_cl.imaging.image_files import read_images
from irtscots_cl.optics.chief_rays import BYTES_PER_PIXEL
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.system import memory
from irtscots_cl.system.memory import check_memory, memory_bytes, peak_bytes

resource = pytest.importorskip("resource")  # limits of memory: POSIX systems


@pytest.fixture
def one_gib(monkeypatch):
    monkeypatch.setattr(memory, "memory_bytes", lambda: 2.0**30)


def test_the_memory_is_the_least_of_machine_container_and_process(tmp_path, monkeypatch):
    here = memory_bytes()
    assert 2**28 < here < 2**50
    (tmp_path / "max").write_text("12345678\n")
    monkeypatch.setattr(memory, "CONTAINER", tmp_path / "max")
    assert memory_bytes.__wrapped__() == 12345678
    (tmp_path / "max").write_text("max\n")  # no limit
    assert memory_bytes.__wrapped__() >= here
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (2**38, hard))
    try:
        assert memory_bytes.__wrapped__() <= 2**38
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def test_only_what_does_not_fit_is_refused(one_gib):
    check_memory("x", 2**30)
    with pytest.raises(ValueError, match=r"^x: takes about 1\.5 GiB of memory; must fit the 1\.0 GiB that there are$"):
        check_memory("x", 1.5 * 2**30)


def large(screen: tuple[int, int], detector: tuple[int, int]):
    """sphere-deviated with that many pixels where it has its own."""
    scene = load_scene("sphere-deviated")

    def regrid(part, pixels: tuple[int, int]):
        pitch = part.pitch_mm * part.pixels[0] / max(pixels)
        return dataclasses.replace(part, pixels=pixels, pitch_mm=pitch)

    camera = dataclasses.replace(scene.camera, detector=regrid(scene.camera.detector, detector))
    return dataclasses.replace(scene, name="large", screen=regrid(scene.screen, screen), camera=camera)


@pytest.mark.parametrize(
    "screen, detector, arguments, line",
    [
        ((21, 21), (4096, 4096), [], "camera.detector.pixels = [4096, 4096]: takes about 8.6 GiB"),
        ((21, 21), (16384, 1024), ["--estimator", "analytic"], "camera.detector.pixels = [16384, 1024]: takes"),
        ((8192, 8192), (9, 9), ["--estimator", "forward"], "screen pixels for each of 69"),
        ((8192, 8192), (9, 9), ["--estimator", "forward", "--aim", "camera"], "screen pixels for each of 69"),
        ((8192, 8192), (9, 9), ["--no-smoothing"], "screen pixels for each of 69"),
        ((8192, 8192), (9, 9), ["--estimator", "nonsequential"], "screen.pixels = [8192, 8192]: takes about 8.8 GiB"),
    ],
)
def test_the_largest_scenes_are_refused_before_they_take_memory(
    tmp_path, one_gib, capsys, device, screen, detector, arguments, line
):
    (tmp_path / "large.toml").write_text(large(screen, detector).to_toml())
    start = time.perf_counter()
    tracemalloc.start()
    assert main(["run", str(tmp_path / "large.toml"), "--out", str(tmp_path / "out"), *arguments]) == 2
    said = capsys.readouterr().err
    assert line in said and said.count("\n") == 1
    assert tracemalloc.get_traced_memory()[1] < 2**30
    tracemalloc.stop()
    assert time.perf_counter() - start < 20
    assert not (tmp_path / "out").exists()


PEAK = """
import sys
from fuzz import peak_bytes
from irtscots_cl.optics.chief_rays import check_visible
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
scene, before = load_scene(sys.argv[1]), peak_bytes()
check_visible(Setup(scene).chief_rays, "x")
print(peak_bytes() - before)
"""


@pytest.mark.slow
def test_a_detector_takes_the_memory_that_is_said(tmp_path):
    (tmp_path / "large.toml").write_text(large((21, 21), (320, 320)).to_toml())
    arguments = [sys.executable, "-c", PEAK, str(tmp_path / "large.toml")]
    here = {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(arguments, capture_output=True, text=True, check=True, timeout=60, env=os.environ | here)
    of_pixel = int(done.stdout) / 320**2
    assert BYTES_PER_PIXEL / 2 < of_pixel < BYTES_PER_PIXEL * 1.5  # 456 when measured


def test_a_large_image_file_is_refused_unread(tmp_path, one_gib):
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        for axis in "xy":
            file.create_dataset(f"images/{axis}", (2**10, 2**9, 2**8), "f8")
            file[f"lines/{axis}_mm"] = np.arange(2**10)
    with pytest.raises(ValueError, match="/images/x: 134217728 values: takes about 4.0 GiB of memory; must fit"):
        read_images(tmp_path / "lab.h5")


def test_running_out_of_memory_is_one_line(monkeypatch, capsys):
    def out(*_):
        raise MemoryError("Unable to allocate 9 PiB")

    monkeypatch.setattr("irtscots_cl.cli.common.load_scene", out)
    assert main(["run", "sphere"]) == 3
    assert capsys.readouterr().err == "irtscots: too little memory on the host: Unable to allocate 9 PiB\n"


def test_the_peak_is_this_processes_own():
    """Of a small process started by one that has held much: what the parent held is not counted."""
    held = np.ones(2**26)  # 512 MiB
    assert peak_bytes() > held.nbytes
    code = "from irtscots_cl.system.memory import peak_bytes; print(peak_bytes())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 2**22 < float(done.stdout) < 2**28
    del held
