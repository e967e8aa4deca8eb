"""What noise a run had: the key "noise" of report.json."""

from __future__ import annotations

import dataclasses
import math

from irtscots_cl.imaging.detector import electrons_per_w, peak_w
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.report.types import NoiseFacts
from irtscots_cl.scene.model import Scene


def noise_facts(scene: Scene, clean: ImageStack, recorded: ImageStack) -> NoiseFacts:
    """The facts of images that imaging.recording.record made of clean ones in W."""
    noise, response = scene.camera.detector.noise, scene.screen.response
    electrons, per_w = math.nan, math.nan
    if noise is not None and not noise.is_off:
        peak = peak_w(clean) * (1.0 if response is None else response.level)
        per_w = electrons_per_w(noise, peak)
        electrons = per_w * peak
    return {
        "unit": recorded.x.unit,
        "electrons_per_w": per_w,
        "electrons_at_peak": electrons,
        "saturation": recorded.x.saturation_w,
        "detector": _given(noise),
        "screen": _given(response),
    }


def _given(table: object) -> dict[str, object]:
    """The values of a table that differ from their defaults, and its seed; empty without a table."""
    if not dataclasses.is_dataclass(table) or isinstance(table, type):
        return {}
    fields = {field.name: (getattr(table, field.name), field.default) for field in dataclasses.fields(table)}
    return {name: value for name, (value, default) in fields.items() if value != default or name == "seed"}
