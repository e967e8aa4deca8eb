"""Checked values of scenes: ranges, types and keys, and the one line that refuses the rest; any damage."""

from __future__ import annotations

import copy
import math
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import BASE, TERMS, changed, refusal, without

from irtscots_cl.scene.instrument import Detector
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError

LENGTH = "a finite number at least 1e-12 and at most 1e+12"
RADIUS = "a number from 1e-12 to 1e+12 on either side of 0, below 0 for a convex mirror, or inf for a flat one"
POINT = "[x, y, z], three finite numbers within 1e+12"
GRID = "[columns, rows], two integers from 1 to 16384"
NAME = "1 to 64 characters of A-Z a-z 0-9 . _ - without a leading dot"
FRACTION = "a finite number above 0 and at most 1"
MILLION = "a finite number at least -1e+06 and at most 1e+06"
NOLL = "a noll index from 1 to 861, of radial order at most 40"


@pytest.mark.parametrize(
    ("key", "value", "shown", "allowed"),
    [
        ("mirror.diameter_mm", -3.0, "-3.0", LENGTH),
        ("mirror.diameter_mm", 0, "0", LENGTH),
        ("mirror.radius_mm", 0.0, "0.0", RADIUS),
        ("mirror.radius_mm", -0.0, "-0.0", RADIUS),
        ("mirror.radius_mm", 1.1e12, "1100000000000.0", RADIUS),
        ("mirror.radius_mm", -1.1e12, "-1100000000000.0", RADIUS),
        ("mirror.radius_mm", True, "True", RADIUS),
        ("mirror.radius_mm", "3", "'3'", RADIUS),
        ("mirror.radius_mm", math.nan, "nan", RADIUS),
        ("mirror.radius_mm", -math.inf, "-inf", RADIUS),
        ("mirror.radius_mm", 10**400, f"1{'0' * 36}...", RADIUS),
        ("mirror.diameter_mm", math.inf, "inf", LENGTH),
        ("mirror.off_axis_mm", -1.0, "-1.0", "a finite number at least 0 and at most 1e+12"),
        ("mirror.conic", -2e6, "-2000000.0", MILLION),
        ("mirror.reflectance", 0.0, "0.0", FRACTION),
        ("mirror.reflectance", 1.5, "1.5", FRACTION),
        ("mirror.zernike", {}, "{}", "tables [[mirror.zernike]]"),
        ("mirror", 3, "3", "a table [mirror]"),
        ("camera.transmittance", 2, "2", FRACTION),
        ("camera.detector", [], "[]", "a table [camera.detector]"),
        ("camera.detector.pitch_mm", 0.0, "0.0", LENGTH),
        ("camera.detector.pixels", [125], "[125]", GRID),
        ("camera.focus_distance_mm", -5, "-5", LENGTH),
        ("screen.pixels", [0, 21], "[0, 21]", GRID),
        ("screen.pixels", [21, 16385], "[21, 16385]", GRID),
        ("screen.pixels", [21, 21.0], "[21, 21.0]", GRID),
        ("screen.pixels", [True, 21], "[True, 21]", GRID),
        ("screen.position_mm", [0.0, 9.0], "[0.0, 9.0]", POINT),
        ("screen.position_mm", [0, 1, "2"], "[0, 1, '2']", POINT),
        ("screen.centre_offset_mm", [math.nan, 0], "[nan, 0]", "[x, y], two finite numbers within 1e+12"),
        ("screen.radiance", 0.0, "0.0", "a finite number above 0 and at most 1e+12"),
        ("screen.emission", "cosine", "'cosine'", "'lambertian'"),
        ("name", ".hidden", "'.hidden'", NAME),
        ("name", "a/b", "'a/b'", NAME),
        ("name", "a\n", "'a\\n'", NAME),
        ("name", "n" * 65, f"'{'n' * 36}...", NAME),
        ("name", "", "''", NAME),
    ],
)
def test_a_value_out_of_range_is_refused_in_one_line(key, value, shown, allowed):
    assert refusal(changed(*key.split("."), to=value)) == f"my.toml: {key} = {shown}: must be {allowed}"


@pytest.mark.parametrize(
    ("key", "value", "line"),
    [
        ("radius_mm", 531.9, " = 531.9: must be at least half of diameter_mm (532.0), to cover the mirror"),
        ("radius_mm", "x", f" = 'x': must be {LENGTH}"),
        ("noll_um", {}, " = {}: must be a table { index = micrometres } of at least one term"),
        ("noll_um", 3, " = 3: must be a table { index = micrometres } of at least one term"),
        ("noll_um", {"0": 1.0}, f".0 = 1.0: must have {NOLL}"),
        ("noll_um", {"862": 1.0}, f".862 = 1.0: must have {NOLL}"),
        ("noll_um", {"06": 1.0}, ".06 = 1.0: must have an integer index as its key"),
        ("noll_um", {"\u0666": 1.0}, ".'\u0666' = 1.0: must have an integer index as its key"),
        ("noll_um", {"6": True}, f".6 = True: must be {MILLION}"),
        ("noll_um", {"6": {"5": 1.0}}, f".6 = {{'5': 1.0}}: must be {MILLION}"),  # the key 6.5
        ("nol_um", {"6": 1.0}, ": unknown key; did you mean noll_um?"),
    ],
)
def test_a_bad_zernike_table_is_refused_under_the_name_the_file_uses(key, value, line):
    assert refusal(changed(*TERMS, key, to=value)) == f"my.toml: mirror.zernike[0].{key}{line}"


def test_an_unknown_key_is_answered_with_the_nearest_one():
    data = changed("mirror", "diametre_mm", to=1064.0)
    del data["mirror"]["diameter_mm"]  # misspelt, so the right one is missing too
    assert refusal(data) == "my.toml: mirror.diametre_mm: unknown key; did you mean diameter_mm?"
    assert refusal(changed("camera", "detector", "pich_mm", to=1)) == (
        "my.toml: camera.detector.pich_mm: unknown key; did you mean pitch_mm?"
    )
    assert refusal(changed("camra", to={})) == "my.toml: camra: unknown key; did you mean camera?"


def test_an_unknown_key_with_nothing_near_is_answered_with_the_list():
    assert refusal(changed("xyz", to=1)) == (
        "my.toml: xyz: unknown key; allowed: name, mirror, screen, camera, element, calibration, budget"
    )
    assert refusal(changed("q\n\x1b[0m", to=1)).startswith(r"my.toml: 'q\n\x1b[0m': unknown key; ")


@pytest.mark.parametrize(
    ("steps", "line"),
    [
        (("camera", "focal_length_mm"), f"camera.focal_length_mm: missing; needs {LENGTH}"),
        (("camera", "detector"), "camera.detector: missing; needs a table [camera.detector]"),
        (("mirror",), "mirror: missing; needs a table [mirror]"),
        (("name",), f"name: missing; needs {NAME}"),
        ((*TERMS, "radius_mm"), f"mirror.zernike[0].radius_mm: missing; needs {LENGTH}"),
    ],
)
def test_a_missing_key_is_named_with_what_it_needs(steps, line):
    assert refusal(without(*steps)) == f"my.toml: {line}"


def test_an_integer_is_taken_for_a_float_and_becomes_one():
    mirror = Mirror(radius_mm=4000, diameter_mm=1000, conic=-1)
    assert [type(v) for v in (mirror.radius_mm, mirror.diameter_mm, mirror.conic)] == [float] * 3


def test_constructors_refuse_with_the_same_lines():
    cases = [
        (lambda: Mirror(0.0, 2.0), f"Mirror: radius_mm = 0.0: must be {RADIUS}"),
        (lambda: Mirror(1.0), f"Mirror: diameter_mm: missing; needs {LENGTH}"),
        (lambda: Detector((1, 1), pich_mm=1.0), "Detector: pich_mm: unknown key; did you mean pitch_mm?"),
        (lambda: Detector({1, 2}, 1.0), f"Detector: pixels = {{1, 2}}: must be {GRID}"),  # a set has no order
        (lambda: ZernikeTerms(1.0, "noll", {"6": 1.0}),
         "ZernikeTerms: coefficients_um.6 = '6': must be an integer index"),
        (lambda: ZernikeTerms(1.0, "born", {6: 1.0}),
         "ZernikeTerms: ordering = 'born': must be one of noll, fringe, osa"),
    ]  # fmt: skip
    for build, line in cases:
        with pytest.raises(SceneError) as caught:
            build()
        assert str(caught.value) == line


junk = st.one_of(
    st.none(), st.booleans(), st.text(max_size=8), st.binary(max_size=3), st.dates(), st.floats(),
    st.sampled_from([10**400, -(10**400), 5e-324, 1e308, -0.0, "x" * 100_000, "\x00\n\x1b", "\ud800"]),
    st.integers(), st.lists(st.integers() | st.floats(), max_size=4), st.sets(st.integers(), max_size=3),
    st.dictionaries(st.text(max_size=3) | st.integers(), st.floats() | st.text(max_size=3), max_size=2),
)  # fmt: skip


def places(part, path=()):
    """Every path into nested dicts and lists."""
    yield path
    for step in part if isinstance(part, dict) else range(len(part)) if isinstance(part, list) else ():
        yield from places(part[step], (*path, step))


PLACES = [path for path in places(BASE) if path]
KEYS = [path for path in PLACES if isinstance(path[-1], str)]
OPTIONAL = [("mirror", "off_axis_mm"), ("camera", "focus_distance_mm"), ("screen", "centre_offset_mm")]


def loads_or_is_refused(data):
    try:
        scene = Scene.from_dict(data, source="my.toml")
    except SceneError as error:
        assert str(error).startswith("my.toml: ") and str(error).isprintable() and len(str(error)) < 400
    else:
        assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene


@settings(max_examples=400, deadline=None)
@given(st.sampled_from(PLACES + OPTIONAL), junk, st.sampled_from(PLACES), junk)
def test_any_damaged_value_is_refused_or_loads(first, value, second, other):
    data = changed(*first, to=value)
    loads_or_is_refused(data)
    try:
        data = copy.deepcopy(data)
        part = data
        for step in second[:-1]:
            part = part[step]
        part[second[-1]] = other
    except (TypeError, KeyError, IndexError):  # the first damage took this place away
        return
    loads_or_is_refused(data)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(KEYS), junk | st.tuples(st.integers()))
def test_any_damaged_key_is_refused_or_loads(path, key):
    try:
        hash(key)
    except TypeError:
        return
    data = changed(*path, to=1.0)
    part = data
    for step in path[:-1]:
        part = part[step]
    part[key] = part.pop(path[-1])
    loads_or_is_refused(data)


@settings(max_examples=200, deadline=None)
@given(
    st.sampled_from(KEYS + OPTIONAL),
    st.floats(-1e12, 1e12) | st.sampled_from([5e-324, 1e-300, 1e-9, 1e12, 0]),
    st.integers(0, 2),
)
def test_any_finite_number_anywhere_is_refused_or_loads(path, number, element):
    """The cross checks meet lengths near the ends of their range: no division by zero, no overflow."""
    old = BASE
    for step in path:
        old = old.get(step) if isinstance(old, dict) else old[step]
    new = [number if k == element else v for k, v in enumerate(old)] if isinstance(old, list) else number
    loads_or_is_refused(changed(*path, to=new))


def test_values_that_cannot_be_printed_are_refused():
    line = f"my.toml: mirror.radius_mm = <{{}}>: must be {RADIUS}"
    digits = 10**5000  # repr raises above 4300 of them
    assert refusal(changed("mirror", "radius_mm", to=digits)) == line.format("int")
    deep = []
    for _ in range(100_000):
        deep = [deep]
    assert refusal(changed("mirror", "radius_mm", to=deep)) == line.format("list")


def test_data_that_holds_itself_or_is_no_table_is_refused():
    own = {}
    own["mirror"] = own
    assert refusal(changed("mirror", to=own)) == (
        "my.toml: mirror.mirror: unknown key; allowed: radius_mm, diameter_mm, conic, off_axis_mm, "
        "obscuration_mm, reflectance, zernike, map, scatter, polynomial, asphere, outline"
    )
    for data in (3, None, [], "x"):
        assert refusal(data) == f"my.toml: {data!r}: must be a table"
