"""The tables [screen.shape], [screen.cover_glass] and [screen.lines]: taken, and refused in one line."""

from __future__ import annotations

import math
import tomllib

import pytest
from refusals import BASE, changed, refusal

from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.screen_shape import CoverGlass, ScanLines, ScreenShape

THREE = [[-2.0, -2.0], [2.0, -2.0], [-2.0, 2.0]]
CORNERS = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
FOUR = {"fractions": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
        "points_mm": [[-2.0, -2.0], [2.0, -2.0], [-2.0, 2.0], [2.0, 2.0]]}  # fmt: skip


def scene_with(table: str, value):
    return Scene.from_dict(changed("screen", table, to=value))


# --- what is taken ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "value", "expected"),
    [
        ("shape", {"sag_mm": [[2, 0, 0.5], [0, 10, -1]]}, ScreenShape(sag_mm=((2, 0, 0.5), (0, 10, -1.0)))),
        ("shape", FOUR, ScreenShape(**{k: tuple(map(tuple, v)) for k, v in FOUR.items()})),
        ("shape", {**FOUR, "points_mm": [[*p, 0.1] for p in FOUR["points_mm"]], "interpolation": "linear"}, None),
        ("cover_glass", {"thickness_mm": 1.1}, CoverGlass(1.1, 1.5)),
        ("cover_glass", {"thickness_mm": 3.0, "index": 1.0}, CoverGlass(3.0, 1.0)),
        ("lines", {"step_px": 2}, ScanLines(2, 1, 0)),
        ("lines", {"step_px": 3, "width_px": 5, "first_px": 4}, ScanLines(3, 5, 4)),
        ("lines", {}, ScanLines()),
    ],
)
def test_the_tables_go_to_toml_and_back(table, value, expected):
    scene = scene_with(table, value)
    if expected is not None:
        assert getattr(scene.screen, table) == expected
    assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene
    assert scene.screen.is_plain == (table == "lines")


def test_scenes_without_the_tables_have_none_of_them():
    screen = Scene.from_dict(BASE).screen
    assert screen.shape is screen.cover_glass is screen.lines is None and screen.is_plain


def test_pitches_may_differ_along_x_and_y():
    assert scene_with("pitch_mm", [0.2, 0.3]).screen.pitch_xy_mm == (0.2, 0.3)
    assert Scene.from_dict(BASE).screen.pitch_xy_mm == (0.2, 0.2)
    assert scene_with("pitch_mm", [0.2, 0.3]).screen.pixel_area_mm2 == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("pixels", "lines", "count"),
    [(21, (1, 1, 0), 21), (21, (2, 1, 0), 11), (21, (2, 2, 0), 10), (21, (1, 2, 0), 20), (21, (3, 2, 1), 7),
     (21, (5, 1, 20), 1), (21, (1, 22, 0), 0), (7, (3, 1, 0), 3)],
)  # fmt: skip
def test_only_whole_lines_count(pixels, lines, count):
    step, width, first = lines
    assert ScanLines(*lines).count(pixels) == count
    assert count == len([s for s in range(first, pixels, step) if s + width <= pixels])


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "value", "key", "shown", "must"),
    [
        ("shape", {}, "sag_mm", "[]", "be given, or points_mm, and not both"),
        ("shape", {"sag_mm": [[1, 1, 0.1]], **FOUR}, "sag_mm", "", "be given, or points_mm, and not both"),
        ("shape", {"sag_mm": [[6, 5, 0.1]]}, "sag_mm", "[6, 5]", "have powers whose sum is at most 10"),
        ("shape", {"sag_mm": [[-1, 0, 0.1]]}, "sag_mm", "", "an array of [i, j, mm]"),
        ("shape", {"sag_mm": [[1.5, 0, 0.1]]}, "sag_mm", "", "an array of [i, j, mm]"),
        ("shape", {"sag_mm": [[1, 0]]}, "sag_mm", "", "an array of [i, j, mm]"),
        ("shape", {"sag_mm": [[1, 0, math.nan]]}, "sag_mm", "nan", "a finite number"),
        ("shape", {"sag_mm": 0.1}, "sag_mm", "0.1", "an array of [i, j, mm]"),
        ("shape", {**FOUR, "fractions": FOUR["fractions"][:3]}, "fractions", "3 places", "be as many as points_mm (4)"),
        ("shape", {"fractions": FOUR["fractions"]}, "sag_mm", "[]", "be given, or points_mm"),
        ("shape", {k: v[:3] for k, v in FOUR.items()}, "points_mm", "3 points", "be 4 to 4096 points"),
        ("shape", {**FOUR, "points_mm": [*THREE, [2.0, 2.0, 0.1]]}, "points_mm", "mixed", "all be [x, y]"),
        ("shape", {**FOUR, "fractions": [*CORNERS, [0.0, 1.0]]}, "fractions", "[0.0, 1.0]", "be given once"),
        ("shape", {**FOUR, "fractions": [*CORNERS, [2.5, 1.0]]}, "fractions", "", "0 to 1 across the pixel grid"),
        ("shape", {**FOUR, "points_mm": [*THREE, [math.inf, 1.0]]}, "points_mm", "", "finite numbers"),
        ("shape", {**FOUR, "interpolation": "cubic"}, "interpolation", "'cubic'", "be smooth or linear"),
        ("shape", {"radius_mm": 5.0}, "radius_mm", "", "unknown key"),
        ("cover_glass", {}, "thickness_mm", "", "missing"),
        ("cover_glass", {"thickness_mm": 0.0}, "thickness_mm", "0.0", "at least 1e-12"),
        ("cover_glass", {"thickness_mm": 1.0, "index": 0.9}, "index", "0.9", "at least 1"),
        ("cover_glass", {"thickness_mm": 1.0, "index": 3.5}, "index", "3.5", "at most 3"),
        ("cover_glass", {"thickness_mm": 1.0, "indx": 1.5}, "indx", "", "index"),
        ("lines", {"step_px": 0}, "step_px", "0", "an integer from 1"),
        ("lines", {"step_px": 1.5}, "step_px", "1.5", "an integer from 1"),
        ("lines", {"width_px": 0}, "width_px", "0", "an integer from 1"),
        ("lines", {"first_px": -1}, "first_px", "-1", "an integer from 0"),
        ("lines", {"step_px": 11}, "step_px", "11", "three whole lines of 1 pixels on the 21 of the x scan"),
        ("lines", {"width_px": 20}, "step_px", "1", "leave at least three whole lines of 20 pixels"),
        ("lines", {"first_px": 19}, "step_px", "1", "leave at least three whole lines"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_refused_with_key_value_and_what_is_allowed(table, value, key, shown, must):
    message = refusal(changed("screen", table, to=value))
    assert message.startswith(f"my.toml: screen.{table}.{key}"), message
    assert shown in message and must in message, message


@pytest.mark.parametrize("table", ["shape", "cover_glass", "lines"])
@pytest.mark.parametrize("value", ["text", 1, [1]])
def test_a_table_is_a_table(table, value):
    assert f"screen.{table}" in refusal(changed("screen", table, to=value))


@pytest.mark.parametrize("value", [[0.2], [0.2, 0.0], [0.2, -1.0], [0.2, 0.2, 0.2], "0.2", math.nan])
def test_a_wrong_pitch_is_refused(value):
    message = refusal(changed("screen", "pitch_mm", to=value))
    assert message.startswith("my.toml: screen.pitch_mm")


@pytest.mark.parametrize("value", [math.inf, "3", [3.0]])
def test_a_wrong_clocking_or_roll_is_refused(value):
    assert refusal(changed("screen", "clocking_deg", to=value)).startswith("my.toml: screen.clocking_deg")
    assert refusal(changed("camera", "roll_deg", to=value)).startswith("my.toml: camera.roll_deg")


def test_a_wrong_orientation_names_all_eight():
    message = refusal(changed("camera", "detector", "orientation", to="upside-down"))
    assert message.startswith("my.toml: camera.detector.orientation = 'upside-down'")
    for word in ("upright", "rows-reversed", "three-quarter-turn", "transposed-half-turn"):
        assert word in message
