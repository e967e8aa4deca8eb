"""Fixtures that tests share: the device, commands."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import pytest

# One thread for linear algebra, set before NumPy is there: a second one waits for its turn by turning in circles, and
# takes up to seven times the processor time for matrices as small as the tests have.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.pop("COLUMNS", None)  # pytest-xdist sets it, and tables obey it

from irtscots_cl import cli
from irtscots_cl.opencl.device import Device, select_device

# Tests that are slow by measurement, beside those marked by hand: tools/slow_tests.py writes the list.
SLOW = frozenset((Path(__file__).parent / "slow_tests.txt").read_text(encoding="utf-8").splitlines())
# Processor time of the longest files without their slow tests, also written by tools/slow_tests.py
FILE_SECONDS = {
    name: float(seconds)
    for seconds, name in map(str.split, (Path(__file__).parent / "file_seconds.txt").read_text("utf-8").splitlines())
}
# Fixtures that give a device of the machine, or run commands that may use one
DEVICE_FIXTURES = {"device", "precision"}


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what runs kernels as needs_device: tools/second_device runs these alone on another OpenCL implementation.

    By fixtures, also those that a test's own fixtures use; what finds its device in another way is marked by hand.
    Mark the tests of slow_tests.txt as slow. Where several processes share the files, the long files come first, by
    FILE_SECONDS or by their slow tests: the short ones are left to fill the processes evenly at the end.
    """
    for item in items:
        if item.nodeid in SLOW:
            item.add_marker(pytest.mark.slow)
        if DEVICE_FIXTURES.intersection(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.needs_device)
    seconds = FILE_SECONDS
    if "not slow" not in config.option.markexpr:
        seconds = Counter(item.nodeid.split("::")[0] for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: -seconds.get(item.nodeid.split("::")[0], 0))


@pytest.fixture(scope="session")
def device() -> Device:
    """The device under test: the environment variable IRTSCOTS_DEVICE, or the best one found."""
    return select_device(None)


@pytest.fixture(params=["fp32", "fp64"])
def precision(request: pytest.FixtureRequest, device: Device) -> str:
    """Each precision that the device computes in."""
    if request.param == "fp64" and not device.has_fp64:
        pytest.skip("the device has no double precision")
    return request.param


@pytest.fixture
def irtscots(capsys):
    """Runs a command in this process: (exit code, stdout, stderr). No failure may show a traceback."""

    def call(*arguments):
        capsys.readouterr()
        try:
            code = cli.main([str(argument) for argument in arguments])
        except SystemExit as stop:  # of argparse
            code = stop.code
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        return code, out, err

    return call


@pytest.fixture
def fresh():
    """A Dask cluster of two workers and its client, for tests that spoil them."""
    import distributed
    from dask_clusters import start

    with start(2) as local, distributed.Client(local) as client:
        yield local, client


@pytest.fixture
def impatient(monkeypatch):
    """Short waits for a Dask cluster's workers and schedulers."""
    from dask_clusters import be_impatient

    be_impatient(monkeypatch)
