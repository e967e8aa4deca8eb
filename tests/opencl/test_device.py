"""Which device is taken, and how its driver's failures are told."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import pyopencl as cl
import pytest
from faults import driver_error

import irtscots_cl.opencl.device as module
from irtscots_cl.opencl.device import (
    ENVIRONMENT,
    Device,
    DeviceError,
    all_devices,
    driver_errors,
    select_device,
    select_devices,
)


def fake(index, name, platform, kind, units, available=True, endian_little=True):
    """A device that exists only by its facts."""
    facts = SimpleNamespace(
        name=f" {name} ",
        platform=SimpleNamespace(name=platform),
        type=kind,
        max_compute_units=units,
        available=available,
        endian_little=endian_little,
    )
    return Device(facts, index)


FOUND = (
    fake("0:0", "pthread-Some CPU", "Portable Computing Language", cl.device_type.CPU, 64),
    fake("1:0", "Small GPU", "ACME OpenCL", cl.device_type.GPU, 8),
    fake("1:1", "Big GPU", "ACME OpenCL", cl.device_type.GPU, 80),
    fake("1:2", "Huge GPU, switched off", "ACME OpenCL", cl.device_type.GPU, 800, available=False),
    fake("1:3", "Other-endian GPU", "ACME OpenCL", cl.device_type.GPU, 900, endian_little=False),
    fake("2:0", "FPGA card", "Gates Inc", cl.device_type.ACCELERATOR, 1000),
)


@pytest.fixture
def found(monkeypatch):
    monkeypatch.setattr(module, "all_devices", lambda: FOUND)
    monkeypatch.delenv(ENVIRONMENT, raising=False)


@pytest.mark.parametrize(
    ("choice", "index"),
    [
        (None, "1:1"),
        ("0:0", "0:0"),
        ("1:0", "1:0"),
        ("gpu", "1:1"),
        ("GPU", "1:1"),
        ("cpu", "0:0"),
        ("other", "2:0"),
        ("small", "1:0"),
        ("acme", "1:1"),
        ("pocl", "0:0"),
        (" Portable ", "0:0"),
        ("fpga", "2:0"),
    ],
)
def test_choice(found, choice, index):
    assert select_device(choice).index == index


@pytest.mark.parametrize("choice", ["0:1", "0", "nothing like it", "", " ", "huge", "1:2", "other-endian", ":"])
def test_refused_choices_list_what_was_found(found, choice):
    with pytest.raises(DeviceError) as caught:
        select_device(choice)
    message = str(caught.value)
    assert message.startswith(f"--device = {choice!r}: ") and "\n" not in message
    for device in FOUND:
        assert f"{device.index} {device.name} ({device.platform})" in message


def test_the_environment_chooses_where_the_caller_does_not(found, monkeypatch):
    monkeypatch.setenv(ENVIRONMENT, "small")
    assert select_device(None).index == "1:0"
    assert select_device("cpu").index == "0:0"
    monkeypatch.setenv(ENVIRONMENT, "missing")
    with pytest.raises(DeviceError, match=f"{ENVIRONMENT} = 'missing': no such usable device"):
        select_device(None)
    monkeypatch.setenv(ENVIRONMENT, "")
    assert select_device(None).index == "1:1"  # set but empty is not set


@pytest.mark.parametrize(
    ("choice", "indices"),
    [
        ("all", ["0:0", "1:0", "1:1", "2:0"]),
        (" All ", ["0:0", "1:0", "1:1", "2:0"]),
        (None, ["1:1"]),
        ("small", ["1:0"]),
        ("1:0,1:1", ["1:0", "1:1"]),
        ("cpu, big ,1:1", ["0:0", "1:1"]),
    ],
)
def test_many_devices_may_be_chosen_each_once(found, choice, indices):
    assert [device.index for device in select_devices(choice)] == indices


def test_all_is_refused_where_one_is_wanted_and_so_is_a_list_with_an_unknown_one(found, monkeypatch):
    with pytest.raises(DeviceError, match="^--device = 'all': must name one device here$"):
        select_device("all")
    with pytest.raises(DeviceError, match="^--device = 'nothing': no such usable device"):
        select_devices("cpu,nothing")
    monkeypatch.setenv(ENVIRONMENT, "all")
    assert len(select_devices()) == 4 and len(select_devices("cpu")) == 1
    with pytest.raises(DeviceError, match=f"^{ENVIRONMENT} = 'all': must name one device here$"):
        select_device()


def test_many_devices_are_described_together():
    one = {"index": "0:0", "name": "A", "platform": "P", "driver": "1", "kind": "cpu", "compute_units": 2}
    assert module.describe_together([one]) == one
    other = one | {"index": "1:0", "name": "B", "kind": "gpu", "compute_units": 30}
    open_pool = module.describe_together([one, one, other])
    assert open_pool["name"] == "2 x A + B" and open_pool["kind"] == "cpu + gpu" and open_pool["platform"] == "P"
    assert open_pool["compute_units"] == 34 and open_pool["devices"] == [one, one, other]


def test_no_device_at_all_says_what_to_install(monkeypatch):
    monkeypatch.setattr(module, "all_devices", tuple)
    with pytest.raises(DeviceError, match=r"^no OpenCL device found; install one: .*pocl") as caught:
        select_device("gpu")
    assert "\n" not in str(caught.value)


def test_a_device_that_went_away_is_not_taken(found, monkeypatch):
    class Gone:
        def __getattr__(self, name):
            if name in ("available", "endian_little"):
                raise driver_error("DEVICE_NOT_AVAILABLE", "clGetDeviceInfo")
            return getattr(FOUND[2].cl_device, name)

    monkeypatch.setattr(module, "all_devices", lambda: (*FOUND[:2], Device(Gone(), "1:1"), *FOUND[3:]))
    assert select_device(None).index == "1:0"
    with pytest.raises(DeviceError, match=r"--device = 'big': no such usable device"):
        select_device("big")


@pytest.mark.parametrize(("doing", "told"), [("", ""), ("a copy", "a copy: ")])
def test_what_a_driver_reports_becomes_one_line(doing, told):
    with pytest.raises(DeviceError) as caught, driver_errors(FOUND[1], doing):
        raise driver_error("OUT_OF_RESOURCES", "clFinish")
    assert str(caught.value) == f"device 1:0 Small GPU: {told}clFinish failed: OUT_OF_RESOURCES - more"


def test_other_errors_are_not_the_drivers():
    with pytest.raises(ZeroDivisionError), driver_errors(FOUND[1]):
        1 / 0  # noqa: B018


def test_vector_width():
    facts = FOUND[0].cl_device
    facts.native_vector_width_float, facts.native_vector_width_double = 16, 8
    facts.version = "OpenCL 3.0 PoCL HSTR: pthread-x86_64-pc-linux-gnu-skylake-avx512"
    assert (FOUND[0].vector_width("fp32"), FOUND[0].vector_width("fp64")) == (16, 8)
    facts.version = "OpenCL 3.0 PoCL HSTR: pthread-x86_64-pc-linux-gnu-znver3"  # compiled for AVX2
    assert (FOUND[0].vector_width("fp32"), FOUND[0].vector_width("fp64")) == (8, 8)
    facts.version = "OpenCL 3.0"
    facts.native_vector_width_float, facts.native_vector_width_double = 32, 2
    assert (FOUND[0].vector_width("fp32"), FOUND[0].vector_width("fp64")) == (16, 8)
    assert FOUND[1].vector_width("fp32") == FOUND[5].vector_width("fp64") == 1


# --- the devices that are there ----------------------------------------------------------------------------


def test_every_device_is_selected_by_its_own_index(device):
    devices = all_devices()
    assert device in devices
    assert len({d.index for d in devices}) == len(devices)
    for d in devices:
        if d.cl_device.available and d.cl_device.endian_little:
            assert select_device(d.index) is d


def test_description_holds_plain_facts(device):
    facts = device.describe()
    assert set(facts) == {"index", "name", "platform", "driver", "kind", "compute_units"}
    assert all(isinstance(value, (str, int)) and value for value in facts.values())
    assert facts["kind"] in ("cpu", "gpu", "other")


def test_devices_are_hashable_values(device):
    assert dataclasses.replace(device) == device and hash(dataclasses.replace(device)) == hash(device)
