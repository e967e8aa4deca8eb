"""Fixtures that tests share: the device, commands."""

from __future__ import annotations

import pytest

from irtscots_cl import cli
from irtscots_cl.opencl.device import Device, select_device


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
