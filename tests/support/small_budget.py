"""Small tests with budgets."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.trials import Trials
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene

SOURCES = {
    "camera.x_mm": 0.1,
    "screen.x_mm": 0.1,
    "screen.z_mm": {"triangular": 0.05},
    "screen.tilt_x_rad": {"uniform": 1e-3},
    "screen.brightness_xx": 0.1,
    "noise.place_mm": 1e-3,
}


def small_scene(pixels: int = 41, preset: str = "sphere") -> Scene:
    """A preset with fewer, larger pixels."""
    scene = load_scene(preset)
    detector = scene.camera.detector
    pitch = detector.pitch_mm * detector.pixels[0] / pixels
    detector = replace(detector, pixels=(pixels, pixels), pitch_mm=pitch)
    return replace(scene, camera=replace(scene.camera, detector=detector))


def small_trials(trials: int = 8, sources=SOURCES, seed: int = 1, pixels: int = 41, **more) -> Trials:
    """more: further keys of the budget."""
    budget = Budget(sources=dict(sources), trials=trials, seed=seed, **more)
    return Trials.of(MeasuredDesign.of_budget(Setup(small_scene(pixels)), budget), budget)


CALIBRATED = ("camera.x_mm", "screen.x_mm")


def calibration_report(tmp_path, correlation: float, names=CALIBRATED, sigma: float = 0.1):
    """A made report of a calibration with that covariance, and a figure term that is no error of the geometry."""
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = sigma**2 * np.array([[1, correlation], [correlation, 1]])
    covariance[2, 2] = 1.0
    unknowns = [{"name": name} for name in (*names, "zernike.5_um")]
    facts = {"measurements": [{"name": "a"}], "unknowns": unknowns, "covariance": covariance.tolist()}
    path = tmp_path / "report.json"
    path.write_text(json.dumps(facts))
    return str(path)
