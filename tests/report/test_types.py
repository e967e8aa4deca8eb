"""The types of reports say what real reports hold."""

from __future__ import annotations

import dataclasses
import typing

import numpy as np
import pytest
from calibrations import knowing, measured, paraboloid
from synthetic import noise_free_stack, small_scene

from irtscots_cl.analysis.stray_light import StrayLight
from irtscots_cl.calibration.calibrate import calibrate
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.opencl.device import describe_together
from irtscots_cl.pipeline.measure import measure
from irtscots_cl.pipeline.simulate import simulate
from irtscots_cl.pipeline.target import Setting
from irtscots_cl.report.calibration import CalibrationFacts, calibration_facts
from irtscots_cl.report.facts import path_facts
from irtscots_cl.report.types import DeviceFacts, Ledger, MeasuredFacts, PathReport, Report, SettingFacts
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.screen_response import ScreenResponse
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.results.paths import LostFlux, PathFlux, PathLight

DEVICE = {"index": "0:0", "name": "A", "platform": "P", "driver": "1", "kind": "gpu", "compute_units": 4}


def check(value: object, kind: object, at: str = "") -> None:
    """Keys of every TypedDict are its own, none missing but optional ones, and values are of their types."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if typing.is_typeddict(kind):
        assert kind.__required_keys__ <= value.keys() <= kind.__annotations__.keys(), at
        types = typing.get_type_hints(kind)
        for key, item in value.items():
            check(item, types[key], f"{at}.{key}")
    elif origin is list:
        assert isinstance(value, list), at
        for k, item in enumerate(value):
            check(item, arguments[0], f"{at}[{k}]")
    elif origin is dict:
        for key, item in value.items():
            assert isinstance(key, arguments[0]), at
            check(item, arguments[1], f"{at}.{key}")
    elif kind is float:
        assert isinstance(value, (float, int)) and not isinstance(value, bool), at
    else:
        assert isinstance(value, kind), at


def test_a_wrong_report_is_told():
    check(DEVICE, DeviceFacts)
    assert DeviceFacts.__optional_keys__ == {"devices", "workers"}
    for wrong in (DEVICE | {"more": 1}, DEVICE | {"kind": 1}, {"index": "0:0"}, DEVICE | {"devices": [{}]}):
        with pytest.raises(AssertionError):
            check(wrong, DeviceFacts)


def test_report():
    report = simulate(small_scene(), estimator="analytic", parts=True).report
    check(report, Report)
    assert report["error_parts"] and report["zernike"]
    assert report.keys() == Report.__required_keys__
    assert Report.__optional_keys__ == {"target", "noise", "checks"}


def test_report_of_a_run_with_noise():
    noise, response = DetectorNoise(electrons_at_peak=1e4, shot_noise=True), ScreenResponse(drift=0.01)
    report = simulate(small_scene(), estimator="analytic", noise=noise, response=response).report
    check(report, Report)
    assert report.keys() == Report.__required_keys__ | {"noise"}


def test_setting_of_a_target():
    assert SettingFacts.__required_keys__ == {field.name for field in dataclasses.fields(Setting)}


def test_device_of_many():
    check(describe_together([DEVICE, DEVICE]), DeviceFacts)


def test_path_report():
    paths = (PathFlux("screen > mirror > lens > detector", "direct", 2.0, 0.01, 900, 0.0, 0.0),)
    ledger = dict.fromkeys(Ledger.__required_keys__, 0) | {"launched": 900}
    losses = (LostFlux("escaped", 1.0, 0.1),)
    light = PathLight(small_scene(), TraceOptions("nonsequential"), DEVICE, paths, losses, 9.6,
                      np.zeros((3, 3, 2, 1)), np.full(3, 100), {"launched": 900}, ledger,
                      {"build": 0.5, "trace": 0.25, "kernels": 0.2})  # fmt: skip
    stray = (StrayLight("ghost", 0.1, Estimate(1.0, 0.1), *np.zeros((2, 1, 1)), np.ones((1, 1), bool)),)
    facts = path_facts(light, stray)
    check(facts, PathReport)
    assert facts["staying"] and facts["stray_light"] and facts["paths"]


def test_measured_facts(tmp_path):
    check(measure(noise_free_stack(small_scene()), small_scene().nominal(), tmp_path), MeasuredFacts)


def test_calibration():
    scene = knowing(paraboloid(21), camera_to_screen=(436.2, 0.05))
    found = calibrate([measured(scene, {"camera.x_mm": 0.3})], scene)
    check(calibration_facts(found, []), CalibrationFacts)
