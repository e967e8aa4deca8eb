"""Scenes: what is accepted, the one line that refuses the rest, and the way to TOML and back."""

from __future__ import annotations

import copy
import dataclasses
import math
import pickle
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refusal

from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import preset_text
from irtscots_cl.scene.toml import _toml_value
from irtscots_cl.scene.validation import SceneError

BASE = tomllib.loads(preset_text("sphere-deviated"))
LENGTH = "a finite number above 0 and at most 1e+12"
POINT = "[x, y, z], three finite numbers within 1e+12"
GRID = "[columns, rows], two integers from 1 to 16384"
NAME = "1 to 64 characters of A-Z a-z 0-9 . _ - without a leading dot"
FRACTION = "a finite number above 0 and at most 1"
MILLION = "a finite number at least -1e+06 and at most 1e+06"
NOLL = "a noll index from 1 to 861, of radial order at most 40"
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


# --- ranges and types ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "shown", "allowed"),
    [
        ("mirror.diameter_mm", -3.0, "-3.0", LENGTH),
        ("mirror.diameter_mm", 0, "0", LENGTH),
        ("mirror.radius_mm", -4000.0, "-4000.0", LENGTH),
        ("mirror.radius_mm", 1.1e12, "1100000000000.0", LENGTH),
        ("mirror.radius_mm", True, "True", LENGTH),
        ("mirror.radius_mm", "3", "'3'", LENGTH),
        ("mirror.radius_mm", math.nan, "nan", LENGTH),
        ("mirror.radius_mm", math.inf, "inf", LENGTH),
        ("mirror.radius_mm", 10**400, f"1{'0' * 36}...", LENGTH),
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
        ("screen.radiance", 0.0, "0.0", LENGTH),
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


def test_a_zernike_table_needs_exactly_one_ordering():
    line = "my.toml: mirror.zernike[0]: needs exactly one of noll_um, fringe_um, osa_um"
    assert refusal(without(*TERMS, "noll_um")) == line
    assert refusal(changed(*TERMS, "osa_um", to={"3": 0.1})) == line
    assert refusal(changed("mirror", "zernike", to=[3])) == (
        "my.toml: mirror.zernike[0] = 3: must be a table [[mirror.zernike]]"
    )


@pytest.mark.parametrize(
    ("ordering", "accepted", "refused"),
    [
        ("noll", (1, 861), (0, -1, 862)),  # 41 * 42 / 2 terms up to order 40
        ("osa", (0, 860), (-1, 861)),
        # Group g = (n + |m|) / 2 ends at (g + 1)^2: the last three of group 21 have n = 41, 41 and 42.
        ("fringe", (1, 441, 481, 1602), (0, 482, 483, 484, 1603, 1681)),
    ],
)
def test_zernike_indices_end_at_radial_order_40(ordering, accepted, refused):
    for index in accepted:
        assert ZernikeTerms(1.0, ordering, {index: 0.1}).coefficients_um == {index: 0.1}
    for index in refused:
        with pytest.raises(SceneError, match=f"coefficients_um.{index} = 0.1: must have a {ordering} index"):
            ZernikeTerms(1.0, ordering, {index: 0.1})


def test_fringe_order_bound_is_that_of_the_index_table():
    """Accepted fringe indices against an enumeration of n and m by n + |m|, then falling |m|."""
    pairs = [(g + k, m) for g in range(41) for k in range(g + 1) for m in ((1, -1) if k < g else (0,))]
    allowed = {index for index, (n, _) in enumerate(pairs, start=1) if n <= 40}
    for index in range(1, 1682):
        if index in allowed:
            ZernikeTerms(1.0, "fringe", {index: 0.1})
        else:
            with pytest.raises(SceneError):
                ZernikeTerms(1.0, "fringe", {index: 0.1})


# --- keys ---------------------------------------------------------------------------------------------------


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
        "my.toml: xyz: unknown key; allowed: name, mirror, screen, camera, element"
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


# --- what single ranges cannot tell -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "shown", "must"),
    [
        ("mirror.obscuration_mm", 1064, "1064.0", "be below diameter_mm (1064.0)"),
        ("mirror.diameter_mm", 8333.494, "8333.494", "be below 8333.494, where the conic ends"),
        ("mirror.off_axis_mm", 5000, "5000.0", "be below 4166.747, where the conic ends"),
        ("screen.pixels", [8193, 8192], "[8193, 8192]", "be at most 67108864 pixels in all"),
        ("camera.detector.pixels", [4097, 4096], "[4097, 4096]", "be at most 16777216 pixels in all"),
        ("screen.position_mm", [0, 0, 0], "[0.0, 0.0, 0.0]",
         "differ from look_at_mm, for a direction to look in"),
        ("screen.position_mm", [0, 9, 0], "[0.0, 9.0, 0.0]", "not lie along Y from look_at_mm: no x axis"),
        ("screen.position_mm", [0, 0, -1], "[0.0, 0.0, -1.0]", "lie in front of the mirror: z above 0"),
        # R - sqrt(R^2 - 532^2) = 34.101774238
        ("camera.position_mm", [800, 0, 34], "[800.0, 0.0, 34.0]",
         "lie in front of the mirror: z above 34.10177424"),
        ("screen.look_at_mm", [0, 0, 9000], "[0.0, 0.0, 9000.0]",
         "look from position_mm within 89 degrees of the mirror's vertex"),
        ("camera.focal_length_mm", 4166.747, "4166.747",
         "be below 4166.746983, the distance to look_at_mm, which is in focus"),
        ("camera.focus_distance_mm", 16, "16.0", "be above focal_length_mm (16.0)"),
    ],
)  # fmt: skip
def test_parts_that_do_not_fit_together_are_refused(key, value, shown, must):
    assert refusal(changed(*key.split("."), to=value)) == f"my.toml: {key} = {shown}: must {must}"


def test_a_conic_that_ends_inside_the_rim_names_the_largest_diameter():
    line = "my.toml: mirror.diameter_mm = 1064.0: must be below {}, where the conic ends"
    assert refusal(changed("mirror", "conic", to=63)) == line.format(1041.68675)  # 2 R / sqrt(1 + 63)
    assert refusal(changed("mirror", "off_axis_mm", to=4000)) == line.format(333.494)  # 2 (R - 4000)


def test_the_largest_allowed_values_are_accepted():
    for steps, value in (
        (("mirror", "diameter_mm"), 1063.9),
        (("mirror", "obscuration_mm"), 1063.9),
        (("screen", "pixels"), [8192, 8192]),
        (("camera", "detector", "pixels"), [4096, 4096]),
        (("camera", "position_mm"), [800.0, 0, 35.0]),
        (("camera", "focus_distance_mm"), 16.01),
        (("mirror", "radius_mm"), 1e12),
        (("name",), "n" * 64),
    ):
        Scene.from_dict(changed(*steps, to=value))
    for conic in (-1.0, -3.0, -1e6):  # paraboloids and hyperboloids have no rim to reach
        Mirror(100.0, 1e6, conic)
    Mirror(1e-300, 1.0, -1.0)  # its square underflows
    assert Mirror(100.0, 199.9).diameter_mm == 199.9  # almost the whole half sphere


def test_an_integer_is_taken_for_a_float_and_becomes_one():
    mirror = Mirror(radius_mm=4000, diameter_mm=1000, conic=-1)
    assert [type(v) for v in (mirror.radius_mm, mirror.diameter_mm, mirror.conic)] == [float] * 3


# --- Python -------------------------------------------------------------------------------------------------


def test_constructors_refuse_with_the_same_lines():
    cases = [
        (lambda: Mirror(-1.0, 2.0), f"Mirror: radius_mm = -1.0: must be {LENGTH}"),
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


def test_all_zernike_tables_share_one_disk():
    first, second = ZernikeTerms(532.0, "noll", {5: 0.1}), ZernikeTerms(600.0, "osa", {5: 0.1})
    with pytest.raises(SceneError) as caught:
        Mirror(4000.0, 1000.0, zernike=(first, second))
    must = "must be the first table's (532.0): all terms share one disk"
    assert str(caught.value) == f"Mirror: zernike[1].radius_mm = 600.0: {must}"


def test_scenes_are_frozen_hashable_and_survive_pickling():
    scene = Scene.from_dict(BASE)
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene.mirror.radius_mm = 1.0
    assert pickle.loads(pickle.dumps(scene)) == scene
    assert hash(scene) == hash(Scene.from_dict(BASE))
    with pytest.raises(SceneError, match="Camera: focal_length_mm = 0.0"):
        dataclasses.replace(scene.camera, focal_length_mm=0.0)


def test_nominal_removes_the_deviation_and_nothing_else():
    scene = Scene.from_dict(BASE)
    nominal = scene.nominal()
    assert scene.mirror.zernike and nominal.mirror.zernike == ()
    deviated = dataclasses.replace(nominal.mirror, zernike=scene.mirror.zernike)
    assert dataclasses.replace(nominal, mirror=deviated) == scene
    assert nominal.nominal() == nominal


def test_the_lens_images_what_is_in_focus():
    camera = Scene.from_dict(BASE).camera
    assert camera.focus_mm == pytest.approx(4166.747, abs=2e-5)  # the preset's position has 4 decimals
    assert camera.image_distance_mm == pytest.approx(16.0616757, abs=1e-7)  # all printed digits
    near = dataclasses.replace(camera, focus_distance_mm=32.0)
    assert near.focus_mm == 32.0
    assert near.image_distance_mm == pytest.approx(32.0, rel=1e-15)  # rounding: 2 f images to 2 f


def test_reading_a_scene_imports_no_numpy():
    code = "import sys, irtscots_cl.scene; print('numpy' in sys.modules, 'pyopencl' in sys.modules)"
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root)
    assert done.stdout.split() == ["False", "False"]


# --- any scene, any damage ----------------------------------------------------------------------------------

lengths = st.floats(1e-3, 1e6)
offsets = st.floats(-1e3, 1e3)
grids = st.tuples(st.integers(1, 4096), st.integers(1, 4096))
fractions = st.floats(1e-6, 1.0)
names = st.from_regex(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,63}", fullmatch=True)


@st.composite
def scenes(draw):
    radius, conic = draw(st.floats(100.0, 1e12)), draw(st.floats(-5.0, 5.0))
    reach = radius / math.sqrt(1 + conic) if conic > -1 else radius
    diameter = min(draw(st.floats(0.1, 0.9)) * reach, 1e5)
    terms = st.builds(
        ZernikeTerms,
        st.just(draw(st.floats(diameter / 2, diameter))),  # all tables share one disk
        st.sampled_from(["noll", "fringe", "osa"]),
        st.dictionaries(st.integers(1, 400), st.floats(-1e6, 1e6), min_size=1, max_size=4),
    )
    off_axis = min(draw(st.floats(0.0, 0.4)) * reach, 1e6)
    hole = draw(st.floats(0.0, 0.99)) * diameter
    deviation = tuple(draw(st.lists(terms, max_size=2)))
    mirror = Mirror(radius, diameter, conic, off_axis, hole, draw(fractions), deviation)
    height = diameter * 6 + draw(lengths) + 1e4
    position = st.tuples(offsets, offsets, st.just(height))
    target = st.tuples(offsets, offsets, st.just(0.0))
    screen = Screen(
        draw(position), draw(grids), draw(lengths), draw(target), draw(lengths),
        centre_offset_mm=(draw(offsets), draw(offsets)),
    )  # fmt: skip
    camera = Camera(
        draw(position), draw(lengths), draw(st.floats(1.0, 90.0)), Detector(draw(grids), draw(lengths)),
        draw(target), draw(st.none() | st.floats(100.0, 1e6)), draw(fractions),
    )  # fmt: skip
    return Scene(draw(names), mirror, screen, camera)


@settings(max_examples=60, deadline=None)
@given(scenes())
def test_toml_text_loads_back_to_an_equal_scene(scene):
    assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_any_string_survives_toml(text):
    """The scene's own strings are plain; the writer does not rely on that."""
    assert tomllib.loads(f"text = {_toml_value(text)}") == {"text": text}


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
    line = f"my.toml: mirror.radius_mm = <{{}}>: must be {LENGTH}"
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
        "obscuration_mm, reflectance, zernike, scatter"
    )
    for data in (3, None, [], "x"):
        assert refusal(data) == f"my.toml: {data!r}: must be a table"
