"""The faster of two drivers of one processor: how it is chosen, and what of it is kept."""

from __future__ import annotations

import numpy as np
import pytest

import irtscots_cl.opencl.device as device_module
from irtscots_cl.opencl import intel_driver, speed
from irtscots_cl.opencl.device import ENVIRONMENT, Device, DeviceError, select_device, select_devices
from irtscots_cl.opencl.pocl_cache import PLATFORM


class Facts:
    """A driver's device that exists only by its facts."""

    endian_little = available = True
    max_compute_units, driver_version, version, native_vector_width_float = 4, "1", "OpenCL 3.0", 8

    def __init__(self, platform, kind, name):
        self.platform = type("Platform", (), {"name": platform, "version": "3"})
        self.type, self.name = kind, name


CPU, GPU = 2, 4  # CL_DEVICE_TYPE_*
POCL = Device(Facts(PLATFORM, CPU, "pthread-cpu"), "0:0")
INTEL = Device(Facts(intel_driver.PLATFORM, CPU, "cpu"), "1:0")
CARD = Device(Facts("Card", GPU, "card"), "2:0")


@pytest.fixture
def measured(monkeypatch, tmp_path):
    """The two drivers, with rates that a test sets, and the list of measurements."""
    made, given = [], {"0:0": 100.0, "1:0": 100.0}

    def measure(devices):
        made.append([device.index for device in devices])
        return dict(given)

    monkeypatch.setattr(speed, "measure", measure)
    monkeypatch.setattr(device_module, "all_devices", lambda: (INTEL, POCL))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv(ENVIRONMENT, raising=False)
    return made, given


@pytest.mark.parametrize(("rate", "taken"), [(0.0, POCL), (99.0, POCL), (109.0, POCL), (111.0, INTEL), (300.0, INTEL)])
def test_the_default_driver_stays_unless_the_other_is_clearly_faster(measured, rate, taken):
    measured[1]["1:0"] = rate
    assert select_device() is taken and select_device("cpu") is taken
    assert select_devices("all") == (taken,)


def test_a_name_a_gpu_and_one_driver_alone_need_no_measurement(measured, monkeypatch):
    assert select_device("pocl") is POCL and select_device(intel_driver.PLATFORM) is INTEL
    assert select_device("0:0") is POCL
    monkeypatch.setattr(device_module, "all_devices", lambda: (POCL, INTEL, CARD))
    assert select_device() is CARD
    monkeypatch.setattr(device_module, "all_devices", lambda: (INTEL,))
    assert select_device() is INTEL and measured[0] == []


def test_rates_are_kept_until_a_driver_changes(measured, tmp_path):
    made, given = measured
    given["1:0"] = 200.0
    assert select_device() is INTEL
    given["1:0"] = 1.0  # a second measurement would change the choice
    assert select_device() is INTEL and made == [["0:0", "1:0"]]
    newer = Device(Facts(intel_driver.PLATFORM, CPU, "cpu"), "1:0")
    newer.cl_device.driver_version = "2"
    assert speed.fastest(POCL, [newer]) is POCL and len(made) == 2
    (kept, _) = sorted((tmp_path / "irtscots-cl").iterdir(), key=lambda path: path.read_text(), reverse=True)
    kept.write_text("[1")  # a damaged file is measured again
    assert select_device() is POCL and len(made) == 3


def test_without_a_writable_folder_it_measures_each_time(measured, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    assert select_device() is select_device() is POCL and len(measured[0]) == 2


def test_a_driver_that_fails_has_no_rate(monkeypatch):
    class Test:
        def __init__(self, device):
            if device is INTEL:
                raise DeviceError("computes wrongly")

        def rate(self):
            return 5.0

    monkeypatch.setattr(speed, "SpeedTest", Test)
    assert speed.measure([POCL, INTEL]) == {"0:0": 5.0, "1:0": 0.0}


def test_the_kernel_counts_rays_that_pass(device):
    """Each work-item has its own rays; the image of the aperture is centred."""
    test = speed.SpeedTest(device)
    counts = test.counts().reshape(-1, 64, 64)
    assert not np.array_equal(counts[0], counts[1])
    image, places = counts.sum(0, dtype=float), np.arange(64) - 31.5
    across = (image.sum(0) * places).sum() / image.sum(), (image.sum(1) * places).sum() / image.sum()
    spread = np.sqrt((image.sum(0) * places**2).sum() / image.sum() / image.sum())
    assert np.abs(across).max() < 0.01 + 6 * spread  # 1/100 pixel for pixels cut at the rim; 6 sigma
    rate = test.rate()
    assert rate > 0
