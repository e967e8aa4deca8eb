"""The wheel: holds kernels and scenes, and works without the source tree."""

import importlib.util
import os
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BINARIES = "Scripts" if os.name == "nt" else "bin"
# Nothing of the environment of the tests may lead the clean one back to the source tree.
ENVIRONMENT = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}


def command(*words: object, cwd: Path, expect: int = 0) -> str:
    result = subprocess.run(
        [str(word) for word in words],
        cwd=cwd,
        env=ENVIRONMENT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert result.returncode == expect, result.stdout[-2000:] + result.stderr[-4000:]
    return result.stdout


@pytest.fixture(scope="module")
def dist(tmp_path_factory) -> Path:
    """A folder with the sdist and with the wheel that was built from the sdist, as a release is."""
    folder = tmp_path_factory.mktemp("dist")
    pytest.importorskip("build", reason="the test extra is not installed")
    offline = ["--no-isolation"] if importlib.util.find_spec("hatchling") else []
    command(sys.executable, "-m", "build", *offline, "--outdir", folder, ROOT, cwd=folder)
    return folder


@pytest.fixture(scope="module")
def wheel(dist) -> Path:
    (path,) = dist.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def clean_python(wheel, tmp_path_factory) -> Path:
    """An environment that has the wheel, and the dependencies from this environment's site-packages.

    They come by a .pth file. Python does not follow the .pth files of a folder that is named by one, so the editable
    install of this environment is not seen.
    """
    folder = tmp_path_factory.mktemp("clean")
    venv.create(folder, with_pip=False)
    python = folder / BINARIES / "python"
    command(
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "--disable-pip-version-check",
        "install",
        "--no-deps",
        "--no-index",
        wheel,
        cwd=folder,
    )
    executor = command(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder).strip()
    here = dict.fromkeys(sysconfig.get_path(kind) for kind in ("purelib", "platlib"))
    Path(executor, "dependencies.pth").write_text("\n".join(here) + "\n", encoding="utf-8")
    return python


def relative_files(folder: Path, pattern: str) -> set[str]:
    return {path.relative_to(ROOT).as_posix() for path in folder.rglob(pattern)}


def test_wheel_holds_the_package_the_kernels_and_the_scenes(wheel):
    package = {name for name in relative_files(ROOT / "irtscots_cl", "*.*") if "__pycache__" not in name}
    kernels = {f"irtscots_cl/{name}" for name in relative_files(ROOT / "kernels", "*.cl")}
    assert {"irtscots_cl/__init__.py", "irtscots_cl/py.typed", "irtscots_cl/scene/preset_scenes/sphere.toml"} <= package
    assert "irtscots_cl/kernels/entry/trace_adjoint.cl" in kernels
    files = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert files >= package | kernels
    assert {name.split("/")[0] for name in files} == {"irtscots_cl"}  # no top-level kernels or tests


def test_sdist_holds_sources_and_tests(dist):
    (path,) = dist.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert names >= relative_files(ROOT / "kernels", "*.cl") | {"pyproject.toml", "LICENSE", "README.md", "tools/run"}
    assert not {name for name in names if name.startswith((".venv", ".git/", ".hypothesis"))}


def test_wheel_finds_its_own_files(clean_python, tmp_path):
    code = (
        "import irtscots_cl as irt; from irtscots_cl.opencl.program import kernels_folder; "
        "print(irt.__file__, kernels_folder(), irt.load_scene('sphere').name, irt.__version__, sep='\\n')"
    )
    package, kernels, scene, version = command(clean_python, "-c", code, cwd=tmp_path).splitlines()
    assert Path(package).is_relative_to(clean_python.parent.parent)
    assert Path(kernels) == Path(package).parent / "kernels"
    assert scene == "sphere"
    assert version in (ROOT / "pyproject.toml").read_text(encoding="utf-8")


def test_installed_command_runs(clean_python, tmp_path):
    irtscots = clean_python.parent / "irtscots"
    assert "usage" in command(irtscots, "--help", cwd=tmp_path).lower()
    assert "sphere-deviated" in command(irtscots, "scenes", cwd=tmp_path)
    assert "sphere-deviated" in command(clean_python, "-m", "irtscots_cl", "scenes", cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []  # looking leaves nothing behind
