"""Intel's OpenCL of a Python package: what the OpenCL loader is shown, and that it works where it is installed."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fuzz import seeds

from irtscots_cl.opencl import intel_driver
from irtscots_cl.opencl.device import all_devices, select_device
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

HOW = "Intel's OpenCL is not installed: pip install 'irtscots-cl[intel]'"


@pytest.fixture
def package(monkeypatch, tmp_path):
    """A package with the library and one that it needs; the system's drivers in a folder of their own."""
    (tmp_path / "lib").mkdir()
    (tmp_path / "vendors").mkdir()
    names = (intel_driver.LIBRARY, *intel_driver.NEEDED)
    for name in names:
        (tmp_path / "lib" / name).write_text("")
    files = [SimpleNamespace(name=name, locate=lambda name=name: tmp_path / "lib" / name) for name in names]
    monkeypatch.setattr(intel_driver, "distribution", lambda name: SimpleNamespace(files=files))
    monkeypatch.setattr(intel_driver, "SYSTEM_FOLDER", str(tmp_path / "vendors"))
    monkeypatch.delenv(intel_driver.VARIABLE, raising=False)
    return tmp_path


def shown() -> dict[str, str] | None:
    """The drivers in the folder that the loader is shown, or None if that is the usual one."""
    folder = os.environ.get(intel_driver.VARIABLE)
    return None if folder is None else {path.name: path.read_text().strip() for path in Path(folder).iterdir()}


def test_the_loader_sees_the_package_beside_the_systems_drivers(package):
    (package / "vendors" / "gpu.icd").write_text("libgpu.so.1\n")
    with intel_driver.registered():
        folder = os.environ[intel_driver.VARIABLE]
        assert shown() == {"gpu.icd": "libgpu.so.1", "irtscots-intel.icd": str(package / "lib" / intel_driver.LIBRARY)}
    assert shown() is None and not Path(folder).exists()


def test_a_folder_that_is_set_is_kept_and_added_to(package, monkeypatch):
    own = package / "own"
    own.mkdir()
    (own / "card.icd").write_text("/opt/card.so\n")
    monkeypatch.setenv(intel_driver.VARIABLE, str(own))
    seen = []

    def fail():
        with intel_driver.registered():
            seen.extend(sorted(shown()))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert seen == ["card.icd", "irtscots-intel.icd"]
    assert os.environ[intel_driver.VARIABLE] == str(own)


@pytest.mark.parametrize("case", ["absent", "not complete", "the system has it", "one driver is set"])
def test_the_loader_is_left_alone(package, monkeypatch, case):
    before = None
    if case == "absent":
        (package / "lib" / intel_driver.LIBRARY).unlink()
    elif case == "not complete":  # it would take the library from the current folder
        (package / "lib" / intel_driver.NEEDED[-1]).unlink()
    elif case == "the system has it":
        (package / "vendors" / "intel64.icd").write_text(f"/opt/intel/{intel_driver.LIBRARY}\n")
    else:
        before = str(package / "driver.so")
        Path(before).write_text("")
        monkeypatch.setenv(intel_driver.VARIABLE, before)
    with intel_driver.registered():
        assert os.environ.get(intel_driver.VARIABLE) == before


def test_a_driver_that_does_not_load_is_told_with_what_it_needs(package):
    assert intel_driver.problem().startswith("intel-opencl-rt is installed and gives no OpenCL platform: pip install ")
    (package / "lib" / "libimf.so").unlink()
    assert "is not used without libimf.so of intel-cmplr-lib-rt: pip install " in intel_driver.problem()
    (package / "lib" / intel_driver.LIBRARY).unlink()
    assert intel_driver.problem() == ""


@pytest.fixture
def intel():
    if intel_driver.library() is None:
        pytest.skip(HOW)
    return select_device(intel_driver.PLATFORM)


@pytest.mark.needs_device
def test_the_installed_driver_is_a_device_after_those_that_were_there(intel):
    assert all_devices()[-1] is intel and intel.kind == "cpu"


@pytest.mark.needs_device
@pytest.mark.parametrize("estimator", ["forward", "adjoint"])
def test_it_traces_as_pocl_does(intel, tmp_path, estimator):
    """The same random words: all rays but those at a bin's edge end in the same bin."""
    (tmp_path / "small.toml").write_text(next(text for text in seeds() if '"sphere-deviated"' in text))
    scene = load_scene(tmp_path / "small.toml")
    rays = {"forward": 2**14, "adjoint": 2**10}[estimator]
    one, other = (
        trace(scene, device=device, seed=3, estimator=estimator, rays_per_pixel=rays, replicates=1).counts.astype(float)
        for device in (select_device("pocl"), intel)
    )
    assert one.sum() > 0 and np.abs(one - other).sum() < 2e-3 * one.sum()  # a thousandth at the edges
