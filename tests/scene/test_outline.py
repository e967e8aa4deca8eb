"""The table [mirror.outline]: taken, and refused in one line."""

from __future__ import annotations

import math
import tomllib

import pytest
from refusals import BASE, changed, refusal

from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.optional_tables import checked_tables
from irtscots_cl.scene.outline import MAX_POINTS, Outline, OutlinePart, Spider, corners_mm

HEXAGON = {"shape": "hexagon", "across_flats_mm": 900.0}
SQUARE = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]


def scene_with(outline) -> Scene:
    return Scene.from_dict(changed("mirror", "outline", to=outline))


def polygon(points, **more):
    return {"shape": "polygon", "points_mm": points, **more}


# --- what is taken ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        (HEXAGON, Outline(shape="hexagon", across_flats_mm=900.0)),
        ({"shape": "rectangle", "size_mm": [900, 300.0], "rotation_deg": -30}, None),
        (polygon(SQUARE, centre_mm=[5.0, -3.0]), None),
        ({"shape": "mask", "file": "somewhere.png", "pitch_mm": 1.0}, None),
        ({"shape": "mask", "file": "somewhere.png", "pitch_mm": [1.0, 2.0], "centre_mm": [1.0, 0.0]}, None),
        ({"shape": "circle", "diameter_mm": 300.0, "obscuration_mm": 10.0, "centre_mm": [100.0, 0.0]}, None),
        ({"spider": [{"width_mm": 3.0, "angles_deg": [0, 120, 240]}]}, Outline(spider=(Spider(3.0, (0, 120, 240)),))),
        ({"part": [HEXAGON, {"shape": "circle", "diameter_mm": 1.0}],
          "spider": [{"width_mm": 3.0, "ends_mm": [[0.0, 0.0], [3.0, 4.0]]}]}, None),
    ],
)  # fmt: skip
def test_the_table_goes_to_toml_and_back(table, expected):
    scene = scene_with(table)
    again = Scene.from_dict(tomllib.loads(scene.to_toml()))
    assert again.mirror.outline == (scene.mirror.outline if expected is None else expected)
    assert again == scene and hash(again.mirror) == hash(scene.mirror)


def test_a_shape_takes_two_lines():
    table = tomllib.loads('[mirror.outline]\nshape = "hexagon"\nacross_flats_mm = 900.0\n')["mirror"]["outline"]
    assert scene_with(table).mirror.outline.is_convex


def test_mirrors_without_the_table_are_disks():
    assert Scene.from_dict(BASE).mirror.outline is None


def test_the_path_of_a_mask_is_relative_to_the_scenes_file():
    data = changed("mirror", "outline", to={"shape": "mask", "file": "mask.png", "pitch_mm": 1.0})
    assert checked_tables(data, "folder/scene.toml")["mirror"]["outline"].file == "folder/mask.png"


def test_corners_run_counterclockwise_from_where_the_keys_say():
    hexagon = corners_mm(OutlinePart(shape="hexagon", across_corners_mm=2.0))
    assert hexagon[0] == pytest.approx((1.0, 0.0)) and hexagon[1] == pytest.approx((0.5, math.sqrt(0.75)))
    turned = corners_mm(OutlinePart(shape="hexagon", across_flats_mm=math.sqrt(3), rotation_deg=90.0))
    assert turned[0] == pytest.approx((0.0, 1.0))  # from +x towards +y
    rectangle = corners_mm(OutlinePart(shape="rectangle", size_mm=(4.0, 2.0), centre_mm=(10.0, 0.0)))
    assert rectangle == [(12.0, 1.0), (8.0, 1.0), (8.0, -1.0), (12.0, -1.0)]
    clockwise = corners_mm(OutlinePart(shape="polygon", points_mm=((0.0, 0.0), (0.0, 1.0), (1.0, 0.0))))
    assert clockwise == [(1.0, 0.0), (0.0, 1.0), (0.0, 0.0)]


@pytest.mark.parametrize(
    ("outline", "convex"),
    [
        (Outline(shape="hexagon", across_flats_mm=1.0), True),
        (Outline(part=(OutlinePart(shape="rectangle", size_mm=(1.0, 2.0)),)), True),
        (Outline(shape="polygon", points_mm=((0, 0), (4, 0), (1, 1), (0, 4))), False),
        (Outline(shape="polygon", points_mm=((0, 0), (2, 0), (4, 0), (0, 4))), True),
        (Outline(shape="circle", diameter_mm=1.0), False),
        (Outline(shape="hexagon", across_flats_mm=1.0, spider=(Spider(0.1, (0.0,)),)), False),
        (Outline(part=(OutlinePart(shape="circle", diameter_mm=1.0),) * 2), False),
    ],
)
def test_only_a_convex_polygon_alone_is_convex(outline, convex):
    assert outline.is_convex == convex


def test_what_sticks_out_of_the_disk_is_taken():
    assert scene_with({"shape": "rectangle", "size_mm": [3000.0, 100.0]}).mirror.outline.is_convex


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "key", "must"),
    [
        (3, "outline = 3", "must be a table [mirror.outline]"),
        ({}, "outline.shape = None", "must be given, or tables [[mirror.outline.part]], or [[mirror.outline.spider]]"),
        ({"shape": "square"}, "outline.shape = 'square'", "must be one of circle, rectangle, hexagon, polygon, mask"),
        ({"shape": "hexagon"}, "outline.across_flats_mm = None", "must be given, or across_corners_mm, and not both"),
        ({**HEXAGON, "across_corners_mm": 3.0}, "outline.across_flats_mm = 900.0",
         "must be given, or across_corners_mm, and not both"),
        ({**HEXAGON, "size_mm": [1.0, 2.0]}, "outline.size_mm = [1.0, 2.0]", "must be left out for shape 'hexagon'"),
        ({**HEXAGON, "across_flat_mm": 1.0}, "outline.across_flat_mm", "unknown key; did you mean across_flats_mm?"),
        ({"size_mm": [1.0, 2.0]}, "outline.size_mm = [1.0, 2.0]", "must be left out without a shape"),
        ({"shape": "rectangle"}, "outline.size_mm = None", "must be given for shape 'rectangle'"),
        ({"shape": "rectangle", "size_mm": [1.0]}, "outline.size_mm = [1.0]", "[width, height]"),
        ({"shape": "circle"}, "outline.diameter_mm = None", "must be given for shape 'circle'"),
        ({"shape": "circle", "diameter_mm": 2.0, "obscuration_mm": 2.0}, "outline.obscuration_mm = 2.0",
         "must be below diameter_mm (2.0)"),
        ({"shape": "mask", "file": "x.png"}, "outline.pitch_mm = None", "must be given for shape 'mask'"),
        ({"shape": "mask", "pitch_mm": 1.0}, "outline.file = None", "must be given for shape 'mask'"),
        ({"shape": "mask", "file": "x.png", "pitch_mm": 1.0, "rotation_deg": 9.0}, "outline.rotation_deg = 9.0",
         "must be left out for shape 'mask'"),
        ({"shape": "mask", "file": "x", "pitch_mm": 1.0, "spider": [{"width_mm": 1.0, "angles_deg": [0]}]},
         "outline.spider = '1 tables'", "must be left out with a mask"),
        ({**HEXAGON, "part": [HEXAGON]}, "outline.shape = 'hexagon'",
         "must be left out where there are tables [[mirror.outline.part]]"),
        ({"part": [{"shape": "mask"}]}, "outline.part[0].shape = 'mask'", "must be one of circle"),
        ({"part": [HEXAGON, {"shape": "circle"}]}, "outline.part[1].diameter_mm = None", "for shape 'circle'"),
        ({"spider": [{"width_mm": 0.0, "angles_deg": [0]}]}, "outline.spider[0].width_mm = 0.0", "a finite number"),
        ({"spider": [{"width_mm": 1.0}]}, "outline.spider[0].angles_deg = []", "must be given, or ends_mm"),
        ({"spider": [{"width_mm": 1.0, "ends_mm": [[0, 0], [0, 0]]}]}, "outline.spider[0].ends_mm", "two different"),
        ({"spider": [{"width_mm": 1.0, "ends_mm": [[0, 0], [1, 0]], "centre_mm": [1, 0]}]},
         "outline.spider[0].centre_mm = [1.0, 0.0]", "must be left out where ends_mm is given"),
        (polygon(SQUARE[:2]), "outline.points_mm = '2 points'", f"must be 3 to {MAX_POINTS} corners"),
        (polygon([[0, 0], [1, float("nan")], [0, 1]]), "outline.points_mm", "an array of [x, y]"),
        (polygon([*SQUARE, SQUARE[0]]), "outline.points_mm = [0.0, 0.0]", "must differ from the corner before it"),
        (polygon([SQUARE[k] for k in (0, 2, 1, 3)]), "outline.points_mm = '4 points'", "side 1 meets side 3"),
        (polygon([[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]]), "outline.points_mm = '5 points'", "side 1 meets side 3"),
        (polygon([[0, 0], [4, 0], [2, 0], [0, 4]]), "outline.points_mm = '4 points'", "side 1 meets side 2"),
        ({"shape": "circle", "diameter_mm": 2.0, "centre_mm": [534.0, 0.0]}, "outline.shape = 'circle'",
         "must reach into the disk of mirror.diameter_mm (1064.0)"),
        ({"part": [HEXAGON, {"shape": "rectangle", "size_mm": [9.0, 9.0], "centre_mm": [0.0, -600.0]}]},
         "outline.part[1].shape = 'rectangle'", "must reach into the disk of mirror.diameter_mm (1064.0)"),
    ],
)  # fmt: skip
def test_refused(table, key, must):
    message = refusal(changed("mirror", "outline", to=table))
    assert f"my.toml: mirror.{key}" in message
    assert must in message


def test_a_part_in_the_hole_is_refused():
    data = changed("mirror", "outline", to={"shape": "circle", "diameter_mm": 90.0})
    data["mirror"]["obscuration_mm"] = 100.0
    assert "outline.shape = 'circle': must reach out of the hole of mirror.obscuration_mm (100.0)" in refusal(data)


def test_a_polygon_around_the_centre_reaches_into_the_disk():
    assert scene_with(polygon([[-2000, -2000], [2000, -2000], [2000, 2000], [-2000, 2000]])).mirror.outline.is_convex


def test_an_outline_of_another_kind_is_refused():
    with pytest.raises(ValueError, match="outline = 'hexagon': must be an Outline of irtscots_cl.scene.outline"):
        Mirror(radius_mm=1000.0, diameter_mm=100.0, outline="hexagon")
