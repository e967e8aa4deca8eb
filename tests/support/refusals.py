"""How a scene is refused: the one line that says why."""

from __future__ import annotations

import pytest

from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError


def refusal(data):
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(data, source="my.toml")
    message = str(caught.value)
    assert message.isprintable()  # one line, no control characters
    return message
