"""A scene file's data with one value changed, and how it is refused: the one line that says why."""

from __future__ import annotations

import copy
import tomllib

import pytest

from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import preset_text
from irtscots_cl.scene.validation import SceneError

BASE = tomllib.loads(preset_text("sphere-deviated"))
TERMS = ("mirror", "zernike", 0)


def changed(*steps, to):
    """BASE with the value at `steps` replaced."""
    data = copy.deepcopy(BASE)
    part = data
    for step in steps[:-1]:
        part = part[step]
    part[steps[-1]] = to
    return data


def without(*steps):
    data = copy.deepcopy(BASE)
    part = data
    for step in steps[:-1]:
        part = part[step]
    del part[steps[-1]]
    return data


def refusal(data):
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(data, source="my.toml")
    message = str(caught.value)
    assert message.isprintable()  # one line, no control characters
    return message
