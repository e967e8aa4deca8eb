"""Elements of a scene: what is accepted, the one line that refuses the rest, the way to TOML and back."""

from __future__ import annotations

import copy
import dataclasses
import math
import tomllib

import pytest
from refusals import refusal

from irtscots_cl.scene.element import KINDS, RESERVED, Element
from irtscots_cl.scene.model import MAX_ELEMENTS, Scene
from irtscots_cl.scene.presets import load_scene, preset_text
from irtscots_cl.scene.scatter.models import Lambertian
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.trace import trace

BASE = tomllib.loads(preset_text("sphere-singlet"))
LENGTH = "a finite number at least 1e-12 and at most 1e+12"
NOT_NEGATIVE = "a finite number at least 0 and at most 1e+12"
SIGNED = "a number from 1e-12 to 1e+12 on either side of 0"
SIZE = "[width, height], each a finite number at least 1e-12 and at most 1e+12"
POINT = "[x, y, z], three finite numbers within 1e+12"
INDEX = "a finite number at least 1 and at most 10"
CHOICES = "one of mirror, refractor, lens, absorber, detector"
NAME = "1 to 64 characters of A-Z a-z 0-9 . _ - without a leading dot"
ACCEPTED = {
    "mirror": {"reflectance": 0.5},
    "refractor": {"index_front": 1.0, "index_back": 1.5, "reflectance": 0.01},
    "lens": {"focal_length_mm": -30.0, "transmittance": 0.9},
    "absorber": {"important": True},
    "detector": {},
}
COATED = {"index_front": 1.0, "index_back": 1.5, "coating_index": 1.2}
SCATTER_TABLES = [
    {"model": "lambertian", "tis": 0.01},
    {"model": "harvey", "l": 0.01, "s": -1.5, "tis": 0.0025},
    {"model": "harvey", "l": 0.01, "s": -2.0, "b0": 0.2},
    {"model": "abg", "a": 1e-4, "b": 1e-3, "g": 1.5},
]


def element(kind="absorber", /, **values):
    """Table of a plain element; None takes a value out."""
    table = {
        "name": "thing", "kind": kind, "position_mm": [0.0, 0.0, 2000.0], "facing_mm": [0.0, 0.0, 0.0],
        "diameter_mm": 50.0,
    }  # fmt: skip
    needed = {"refractor": {"index_front": 1.0, "index_back": 1.5}, "lens": {"focal_length_mm": 100.0}}
    table |= needed.get(kind, {}) | values
    return {key: value for key, value in table.items() if value is not None}


def with_elements(*tables):
    """BASE with these elements behind its own two."""
    data = copy.deepcopy(BASE)
    data["element"] += list(tables)
    return data


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_accepted_with_what_it_allows(kind):
    scene = Scene.from_dict(with_elements(element(kind, **ACCEPTED[kind])))
    assert [e.name for e in scene.element] == ["lens.front", "lens.back", "thing"]
    for key, value in ACCEPTED[kind].items():
        assert getattr(scene.element[2], key) == value


@pytest.mark.parametrize(
    ("kind", "key", "value", "shown", "allowed"),
    [
        ("absorber", "name", "a b", "'a b'", NAME),
        ("absorber", "kind", "grating", "'grating'", CHOICES),
        ("absorber", "position_mm", [0.0, 1.0], "[0.0, 1.0]", POINT),
        ("absorber", "facing_mm", [0.0, 1.0, math.nan], "[0.0, 1.0, nan]", POINT),
        ("absorber", "radius_mm", 0.0, "0.0", SIGNED),
        ("absorber", "radius_mm", -2e12, "-2000000000000.0", SIGNED),
        ("absorber", "radius_mm", "5", "'5'", SIGNED),
        ("absorber", "conic", math.inf, "inf", "a finite number at least -1e+06 and at most 1e+06"),
        ("absorber", "off_axis_mm", -1.0, "-1.0", NOT_NEGATIVE),
        ("absorber", "diameter_mm", 0.0, "0.0", LENGTH),
        ("absorber", "obscuration_mm", -1.0, "-1.0", NOT_NEGATIVE),
        ("absorber", "size_mm", [3.0, 0.0], "[3.0, 0.0]", SIZE),
        ("mirror", "reflectance", 1.1, "1.1", "a finite number at least 0 and at most 1"),
        ("mirror", "reflectance", -0.1, "-0.1", "a finite number at least 0 and at most 1"),
        ("refractor", "index_front", 0.9, "0.9", INDEX),
        ("refractor", "index_back", 10.5, "10.5", INDEX),
        ("refractor", "index_back", True, "True", INDEX),
        ("refractor", "coating_index", 0.9, "0.9", INDEX),
        ("refractor", "coating_index", 10.5, "10.5", INDEX),
        ("refractor", "coating_index", "1.3", "'1.3'", INDEX),
        ("absorber", "important", 1, "1", "true or false"),
        ("absorber", "important", "true", "'true'", "true or false"),
        ("lens", "focal_length_mm", 0, "0", SIGNED),
        ("lens", "transmittance", 0.0, "0.0", "a finite number above 0 and at most 1"),
        ("lens", "transmittance", 1.01, "1.01", "a finite number above 0 and at most 1"),
    ],
)  # fmt: skip
def test_a_value_out_of_range_is_refused_in_one_line(kind, key, value, shown, allowed):
    data = with_elements(element(kind, **{key: value}))
    assert refusal(data) == f"my.toml: element[2].{key} = {shown}: must be {allowed}"


@pytest.mark.parametrize(
    ("kind", "values", "line"),
    [
        ("absorber", {"facing_mm": [0.0, 0.0, 2000.0]},
         "facing_mm = [0.0, 0.0, 2000.0]: must differ from position_mm, for a direction to face"),
        ("absorber", {"diameter_mm": None}, "diameter_mm = None: must be given, or else size_mm, and not both"),
        ("absorber", {"size_mm": [3.0, 4.0]}, "diameter_mm = 50.0: must be given, or else size_mm, and not both"),
        ("absorber", {"obscuration_mm": 50.0}, "obscuration_mm = 50.0: must be below diameter_mm (50.0)"),
        ("absorber", {"conic": -1.0}, "conic = -1.0: must be 0 for a plane; radius_mm makes it curved"),
        ("absorber", {"off_axis_mm": 3.0}, "off_axis_mm = 3.0: must be 0 for a plane; radius_mm makes it curved"),
        ("absorber", {"radius_mm": 25.0},
         "diameter_mm = 50.0: must end within the conic: its surface does not reach so far out"),
        ("absorber", {"radius_mm": -25.0},
         "diameter_mm = 50.0: must end within the conic: its surface does not reach so far out"),
        ("absorber", {"radius_mm": 30.0, "off_axis_mm": 5.0},
         "diameter_mm = 50.0: must end within the conic: its surface does not reach so far out"),
        ("absorber", {"radius_mm": 40.0, "conic": 2.0},
         "diameter_mm = 50.0: must end within the conic: its surface does not reach so far out"),
        ("absorber", {"radius_mm": 25.0, "diameter_mm": None, "size_mm": [30.0, 40.0]},
         "size_mm = [30.0, 40.0]: must end within the conic: its surface does not reach so far out"),
        ("refractor", {"index_front": None}, "index_front = None: must be given for kind 'refractor'"),
        ("refractor", {"index_back": None}, "index_back = None: must be given for kind 'refractor'"),
        ("lens", {"focal_length_mm": None}, "focal_length_mm = None: must be given for kind 'lens'"),
        ("lens", {"radius_mm": 100.0}, "radius_mm = 100.0: must be left out: a paraxial lens is a plane"),
        ("absorber", {"reflectance": 0.0}, "reflectance = 0.0: must be left out for kind 'absorber'"),
        ("lens", {"reflectance": 0.1}, "reflectance = 0.1: must be left out for kind 'lens'"),
        ("mirror", {"index_front": 1.5}, "index_front = 1.5: must be left out for kind 'mirror'"),
        ("lens", {"index_back": 1.5}, "index_back = 1.5: must be left out for kind 'lens'"),
        ("refractor", {"focal_length_mm": 1.0}, "focal_length_mm = 1.0: must be left out for kind 'refractor'"),
        ("refractor", {"index_front": 1.3, "coating_index": 1.2},
         "coating_index = 1.2: must be at least 1.3, the lower index beside it"),
        ("refractor", {"coating_index": 1.2, "reflectance": 0.04},
         "coating_index = 1.2: must be left out where reflectance is given, or that"),
        ("refractor", {"coating_index": 1.2, "reflectance": 0.0},
         "coating_index = 1.2: must be left out where reflectance is given, or that"),
        *((kind, {"coating_index": 1.2}, f"coating_index = 1.2: must be left out for kind '{kind}'")
          for kind in ("mirror", "lens", "absorber", "detector")),
        ("detector", {"reflectance": 0.0}, "reflectance = 0.0: must be left out for kind 'detector'"),
        ("detector", {"transmittance": 0.5}, "transmittance = 0.5: must be left out for kind 'detector'"),
        ("absorber", {"radius": 1.0}, "radius: unknown key; did you mean radius_mm?"),
        ("absorber", {"name": None}, f"name: missing; needs {NAME}"),
        ("absorber", {"kind": None}, f"kind: missing; needs {CHOICES}"),
        ("absorber", {"facing_mm": None}, f"facing_mm: missing; needs {POINT}"),
    ],
)  # fmt: skip
def test_values_that_do_not_go_together_are_refused_in_one_line(kind, values, line):
    assert refusal(with_elements(element(kind, **values))) == f"my.toml: element[2].{line}"


@pytest.mark.parametrize(
    "values",
    [
        {"radius_mm": 25.01},
        {"radius_mm": -25.01},
        {"radius_mm": 20.0, "conic": -1.0},  # a paraboloid has no end
        {"radius_mm": 20.0, "conic": -2.0, "off_axis_mm": 500.0},
        {"radius_mm": 25.01, "diameter_mm": None, "size_mm": [30.0, 40.0]},  # half a diagonal is 25
        {"obscuration_mm": 49.9},
        {"facing_mm": [1e-3, 7.0, 2000.0]},
        {"kind": "refractor", "index_front": 1.3, "index_back": 1.5, "coating_index": 1.3},
        {"kind": "refractor", "index_front": 1.3, "index_back": 1.5, "coating_index": 2.3},
    ],
)
def test_what_is_just_within_is_accepted(values):
    scene = Scene.from_dict(with_elements(element(**values)))
    assert scene.element[2].name == "thing"


@pytest.mark.parametrize("name", RESERVED)
def test_names_of_the_scenes_own_parts_are_refused(name):
    line = "must be none of screen, mirror, lens, stop, detector, which the scene has anyway"
    assert refusal(with_elements(element(name=name))) == f"my.toml: element[2].name = '{name}': {line}"


def test_equal_names_and_too_many_elements_are_refused():
    many = [element(name=f"thing{k}") for k in range(MAX_ELEMENTS - 1)]  # beside the two that BASE has
    assert refusal(with_elements(element(name="lens.front"))) == (
        "my.toml: element[2].name = 'lens.front': must be different from the names of the elements before it"
    )
    assert refusal(with_elements(*many)) == "my.toml: element = 17: must be at most 16 tables [[element]]"
    assert len(Scene.from_dict(with_elements(*many[1:])).element) == MAX_ELEMENTS


@pytest.mark.parametrize("value", [3, {"name": "thing"}])
def test_what_is_no_list_of_tables_is_refused(value):
    assert refusal({**BASE, "element": value}).endswith(": must be tables [[element]]")
    assert refusal({**BASE, "element": [3]}).startswith("my.toml: element[0] = 3: must be ")


def test_a_constructor_refuses_as_a_file_does():
    with pytest.raises(SceneError, match=r"^Element: index_back = None: must be given for kind 'refractor'$"):
        Element(**element("refractor", index_back=None))


@pytest.mark.parametrize("name", ["sphere-singlet", "sphere-doublet", "sphere-window", "ghosts", "baffled"])
def test_a_preset_with_elements_comes_back_from_toml(name):
    scene = load_scene(name)
    assert scene.element
    assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene


def test_every_field_of_an_element_comes_back_from_toml():
    tables = [element(kind, name=f"of.{kind}", **ACCEPTED[kind]) for kind in KINDS]
    tables.append(element(name="curved", radius_mm=-1e3, conic=-0.5, off_axis_mm=1 / 3, obscuration_mm=0.1))
    tables.append(element("refractor", name="coated", **COATED, scatter=SCATTER_TABLES[1]))
    tables.append(element(name="oblong", diameter_mm=None, size_mm=[1 / 7, 2.0], facing_mm=[0.1, 0.0, -1e-9]))
    scene = Scene.from_dict(with_elements(*tables))
    for field in dataclasses.fields(Element):  # so that a field that is added is added here
        assert len({getattr(e, field.name) for e in scene.element}) > 1, field.name
    assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene


@pytest.mark.parametrize("estimator", ["forward", "adjoint", "analytic"])
def test_the_other_estimators_refuse_what_they_do_not_see(estimator):
    must = f"must be left out with estimator {estimator}, or estimator be nonsequential"
    bare = dataclasses.replace(load_scene("sphere-singlet"), element=())
    plain = load_scene("sphere")
    scattering = dataclasses.replace(plain, mirror=dataclasses.replace(plain.mirror, scatter=Lambertian(tis=0.01)))
    for scene, what in (
        (load_scene("baffled"), "scene baffled: element[0].name = 'baffle'"),
        (load_scene("ghosts"), "scene ghosts: element[0].name = 'window.front'"),
        (bare, "scene sphere-singlet: camera.lens = 'elements'"),
        (scattering, "scene sphere: mirror.scatter.model = 'lambertian'"),
    ):
        with pytest.raises(ValueError, match=".") as caught:
            trace(scene, estimator=estimator, rays_per_pixel=1, replicates=1)
        assert str(caught.value) == f"{what}: {must}"


def test_a_hole_larger_than_a_rectangle_is_refused():
    with pytest.raises(SceneError, match="obscuration_mm = 50.0: must be below the diagonal of size_mm"):
        Element("a", "absorber", (0.0, 0.0, 9.0), (0.0, 0.0, 0.0), size_mm=(1.0, 1.0), obscuration_mm=50.0)


def with_scatter(table):
    data = tomllib.loads(load_scene("sphere").to_toml())
    data["mirror"]["scatter"] = table
    return data


@pytest.mark.parametrize("table", SCATTER_TABLES, ids=str)
def test_scenes_with_scatter_survive_a_round_trip(table):
    scene = Scene.from_dict(with_scatter(table), "my.toml")
    assert tomllib.loads(scene.to_toml())["mirror"]["scatter"] == table
    assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene and not scene.is_sequential


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"model": "harvy"}, "mirror.scatter.model = 'harvy': unknown model; did you mean harvey?"),
        ({"tis": 0.1}, "mirror.scatter.model: missing; needs one of lambertian, harvey, abg"),
        ({"model": "lambertian", "tis": 1.5}, "mirror.scatter.tis = 1.5: must be "),
        ({"model": "harvey", "l": 0.01, "s": -1.5}, "mirror.scatter.b0 = None: must be "),
        ({"model": "lambertian", "tis": 0.1, "l": 1.0}, "mirror.scatter.l: unknown key; "),
    ],
    ids=str,
)
def test_wrong_scatter_tables_are_refused_in_one_line(table, line):
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(with_scatter(table), "my.toml")
    assert str(caught.value).startswith(f"my.toml: {line}") and "\n" not in str(caught.value)


# --- scatter of elements ------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["mirror", "refractor", "absorber"])
@pytest.mark.parametrize("table", SCATTER_TABLES, ids=str)
def test_an_elements_scatter_survives_a_round_trip(kind, table):
    """Of one between others: a table [element.scatter] belongs to the [[element]] before it."""
    scene = Scene.from_dict(with_elements(element(kind, scatter=table), element(name="last")), "my.toml")
    again = tomllib.loads(scene.to_toml())
    assert [entry.get("scatter") for entry in again["element"]] == [None, None, table, None]
    assert Scene.from_dict(again) == scene
    assert scene.element[2].scatter.tis_at() > 0


@pytest.mark.parametrize(
    ("kind", "table", "line"),
    [
        ("lens", {"model": "lambertian", "tis": 0.1},
         "scatter = Lambertian(tis=0.1): must be left out for kind 'lens'"),
        ("detector", {"model": "lambertian", "tis": 0.1},
         "scatter = Lambertian(tis=0.1): must be left out for kind 'detector'"),
        ("absorber", {"model": "phong"}, "scatter.model = 'phong': unknown model; allowed: lambertian, harvey, abg"),
        ("absorber", {"tis": 0.1}, "scatter.model: missing; needs one of lambertian, harvey, abg"),
        ("mirror", {"model": "lambertian", "tis": 1.5},
         "scatter.tis = 1.5: must be a finite number above 0 and at most 1"),
        ("mirror", {"model": "abg", "a": 1.0},
         "scatter.b: missing; needs a finite number at least 1e-30 and at most 1e+12"),
        ("refractor", 3, "scatter = 3: must be a table with the key model, one of lambertian, harvey, abg"),
    ],
)  # fmt: skip
def test_an_elements_wrong_scatter_is_refused_in_one_line(kind, table, line):
    assert refusal(with_elements(element(kind, scatter=table))) == f"my.toml: element[2].{line}"


def test_a_constructor_refuses_what_is_no_model():
    with pytest.raises(SceneError, match=r"^Element: scatter = 'harvey': must be a model of irtscots_cl.scatter$"):
        Element(**element(scatter="harvey"))
