"""Fixtures that every device test shares."""

from __future__ import annotations

import pytest

from irtscots_cl.device import Device, select_device


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
