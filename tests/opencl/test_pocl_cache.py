"""PoCL's cache folder: the one that PoCL uses, and what is said where it cannot be written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from irtscots_cl.opencl import device as device_module
from irtscots_cl.opencl.pocl_cache import PLATFORM, cache_folder, cache_problem

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("variables", "folder", "origin"),
    [
        ({"POCL_CACHE_DIR": "/a", "XDG_CACHE_HOME": "/b", "HOME": "/c"}, "/a", "POCL_CACHE_DIR"),
        ({"POCL_CACHE_DIR": "", "XDG_CACHE_HOME": "/b", "HOME": "/c"}, "/b/pocl/kcache", "XDG_CACHE_HOME"),
        ({"XDG_CACHE_HOME": "", "HOME": "/c"}, "/c/.cache/pocl/kcache", "HOME"),
        ({}, "/tmp/pocl/kcache", ""),
    ],
)
def test_the_folder_is_found_as_by_pocl(monkeypatch, variables, folder, origin):
    for name in ("POCL_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert cache_folder() == (Path(folder), origin)


def test_a_problem_names_folder_variable_and_remedy(monkeypatch, tmp_path):
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path / "new"))
    assert cache_problem() == "" and (tmp_path / "new").is_dir()
    (tmp_path / "file").write_text("")
    for folder, reason in ((tmp_path / "file", "it is a file"), (tmp_path / "file" / "below", "Not a directory")):
        monkeypatch.setenv("POCL_CACHE_DIR", str(folder))
        assert cache_problem() == (
            f"PoCL cannot write to its cache folder {folder}, from the environment variable POCL_CACHE_DIR: {reason}; "
            "set POCL_CACHE_DIR to a writable folder"
        )


class Platform:
    """A driver without devices."""

    def __init__(self, name):
        self.name = name

    def get_devices(self):
        return []


@pytest.mark.parametrize(
    ("names", "text"),
    [
        ([], "no OpenCL device found; install one: "),
        (["Some GPU"], "no OpenCL device found: the OpenCL driver is there, but has no device: Some GPU"),
        (["Some GPU", PLATFORM], "no OpenCL device found: PoCL cannot write to its cache folder /dev/null/x, "),
    ],
)
def test_without_a_device_the_message_names_the_cause(monkeypatch, names, text):
    monkeypatch.setenv("POCL_CACHE_DIR", "/dev/null/x")
    monkeypatch.setattr(device_module.cl, "get_platforms", lambda: [Platform(name) for name in names])
    assert device_module.no_device_message().startswith(text)


@pytest.mark.parametrize("place", ["file/below", "file"], ids=["no device", "no build"])
def test_a_command_names_the_folder_where_pocl_cannot_write(device, tmp_path, place):
    if device.platform != PLATFORM:
        pytest.skip("another implementation has another cache")
    (tmp_path / "file").write_text("")
    command = [sys.executable, "-m", "irtscots_cl", "run", "sphere", "--device", "pocl"]
    variables = os.environ | {"PYTHONPATH": str(ROOT), "POCL_CACHE_DIR": str(tmp_path / place)}
    done = subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (3, "", 1), done.stderr
    assert done.stderr.startswith("irtscots: ")
    assert f"PoCL cannot write to its cache folder {tmp_path / place}, " in done.stderr
