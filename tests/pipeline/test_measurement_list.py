"""Lists of measurements: what is taken, and what is refused in one line."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from scenes import coarse

from irtscots_cl.calibration.parameters import moved
from irtscots_cl.pipeline.measurement_list import planned
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError

SCENE = coarse("sphere-deviated", 15)


def write(tmp_path, text: str) -> Path:
    path = tmp_path / "list.toml"
    path.write_text(text)
    return path


def test_files_alone():
    (one,) = planned([Path("a.h5")], SCENE)
    assert one.scene == SCENE.nominal() and one.kind == {"name": "a", "turn_rad": 0.0, "knows_mirror": False}
    both = planned([Path("a.h5"), Path("b/a.h5")], SCENE, [0.0, 90.0])
    assert [p.kind["name"] for p in both] == ["a (1)", "a (2)"] and both[1].kind["turn_rad"] == math.pi / 2
    (known,) = planned([Path("a.h5")], SCENE, known=True)
    assert known.scene == SCENE and known.kind["knows_mirror"]


def test_a_list(tmp_path):
    other = replace(load_scene("sphere"), name="flat")
    (tmp_path / "flat.toml").write_text(other.to_toml())
    path = write(
        tmp_path,
        """
        [[measurement]]
        images = "a.h5"
        [[measurement]]
        images = "b.h5"
        name = "turned"
        mirror_turn_deg = 120
        own = ["mirror.tilt_x_rad"]
        moved = { "screen.z_mm" = 10.0 }
        [[measurement]]
        images = "/c.h5"
        reference = "flat.toml"
        [[measurement]]
        images = "d.h5"
        reference = "off-axis"
        """,
    )
    first, second, third, fourth = planned([path], SCENE)
    assert first.path == tmp_path / "a.h5" and first.kind["name"] == "a (1)" and first.scene == SCENE.nominal()
    assert second.kind["name"] == "turned" and second.kind["own"] == ("mirror.tilt_x_rad",)
    assert second.kind["turn_rad"] == pytest.approx(2 * math.pi / 3)
    assert second.scene == moved(SCENE.nominal(), {"screen.z_mm": 10.0})
    assert third.path == Path("/c.h5") and third.kind["knows_mirror"] and third.scene.mirror == other.mirror
    assert third.scene.camera == SCENE.camera and fourth.scene.mirror == load_scene("off-axis").mirror


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "measurement: must be 1 to 100 tables [[measurement]]"),
        ("measurement = 1", "measurement: must be 1 to 100 tables [[measurement]]"),
        ("measurement = [1]", "measurement.1 = 1: must be a table [[measurement]]"),
        ("measuremnt = []", "measuremnt: unknown key; did you mean measurement?"),
        ("[[measurement]]", "measurement.1.images: missing; needs a text"),
        ('[[measurement]]\nimages = "a"\nturn = 3', "measurement.1.turn: unknown key; "),
        ('[[measurement]]\nimages = "a"\nmirror_turn_deg = nan', "measurement.1.mirror_turn_deg = nan: must be"),
        ('[[measurement]]\nimages = "a"\nown = ["mirror.x"]', "measurement.1: unknown 'mirror.x': did you mean"),
        ('[[measurement]]\nimages = "a"\nmoved = { camera = 1.0 }', "measurement.1: unknown 'camera': "),
        ('[[measurement]]\nimages = "a"\nmoved = { "camera.x_mm" = "a" }', "measurement.1.moved.'camera.x_mm' = 'a': "),
        ("[[measurement", "is not valid TOML: "),
    ],
)  # fmt: skip
def test_lists_that_are_wrong(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(ValueError, match=r"^\S*list\.toml: ") as caught:
        planned([path], SCENE)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_a_move_to_where_nothing_can_be(tmp_path):
    path = write(tmp_path, '[[measurement]]\nimages = "a"\nmoved = { "camera.z_mm" = -1e5 }')
    with pytest.raises(SceneError, match="must lie in front of the mirror"):
        planned([path], SCENE)


def test_angles_that_do_not_fit_the_files(tmp_path):
    with pytest.raises(ValueError, match="^--mirror-turn = 1 angles: must be one for each of the 2 files$"):
        planned([Path("a.h5"), Path("b.h5")], SCENE, [1.0])
    with pytest.raises(ValueError, match="^--mirror-turn: must be left out with a list of measurements"):
        planned([write(tmp_path, "")], SCENE, [1.0])
    with pytest.raises(ValueError, match=r"none\.toml: cannot be read: No such file"):
        planned([tmp_path / "none.toml"], SCENE)
