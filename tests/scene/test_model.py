"""Scenes: what is accepted, parts that do not fit together, and the way to TOML and back."""

from __future__ import annotations

import dataclasses
import math
import pickle
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_modules import loaded_modules
from refusals import BASE, TERMS, changed, refusal, without

from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.toml import _toml_value
from irtscots_cl.scene.validation import SceneError

# --- Zernike tables -----------------------------------------------------------------------------------------


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
        ("screen.position_mm", [0, 9, 0], "[0.0, 9.0, 0.0]", "lie in front of the mirror: z above 0.009719823939"),
        ("screen.position_mm", [0, 0, -1], "[0.0, 0.0, -1.0]", "lie in front of the mirror: z above 0"),
        # R - sqrt(R^2 - 532^2) = 34.101774238
        ("camera.position_mm", [800, 0, 34], "[800.0, 0.0, 34.0]",
         "lie in front of the mirror: z above 34.10177424"),
        ("screen.look_at_mm", [0, 0, 9000], "[0.0, 0.0, 9000.0]",
         "look from position_mm within 89 degrees of some point of the mirror"),
        ("camera.look_at_mm", [900, 0, 8000], "[900.0, 0.0, 8000.0]",
         "look from position_mm within 89 degrees of some point of the mirror"),
        ("camera.focal_length_mm", 4166.747, "4166.747",
         "be below 4166.746983, the distance to look_at_mm, which is in focus"),
        ("camera.focus_distance_mm", 16, "16.0", "be above focal_length_mm (16.0)"),
    ],
)  # fmt: skip
def test_parts_that_do_not_fit_together_are_refused(key, value, shown, must):
    assert refusal(changed(*key.split("."), to=value)) == f"my.toml: {key} = {shown}: must {must}"


@pytest.mark.parametrize("key", ["camera", "screen"])
def test_a_device_may_look_away_from_the_vertex_at_another_part_of_the_mirror(key):
    near = changed(key, "position_mm", to=[480.0, 0.0, 60.0])
    near[key]["look_at_mm"] = [512.0, 0.0, 31.5]  # outward, at the rim
    if key == "camera":
        near[key]["focal_length_mm"] = 8.0
    Scene.from_dict(near)
    near[key]["look_at_mm"] = [490.0, 0.0, 160.0]  # up
    must = "must look from position_mm within 89 degrees of some point of the mirror"
    assert refusal(near) == f"my.toml: {key}.look_at_mm = [490.0, 0.0, 160.0]: {must}"


def test_a_conic_that_ends_inside_the_rim_names_the_largest_diameter():
    line = "my.toml: mirror.diameter_mm = 1064.0: must be below {}, where the conic ends"
    assert refusal(changed("mirror", "conic", to=63)) == line.format(1041.68675)  # 2 R / sqrt(1 + 63)
    assert refusal(changed("mirror", "off_axis_mm", to=4000)) == line.format(333.494)  # 2 (R - 4000)


@pytest.mark.parametrize(
    ("mirror", "line"),
    [
        # the same limits as of the concave mirror of this radius
        ({"radius_mm": -500.0}, "diameter_mm = 1064.0: must be below 1000, where the conic ends"),
        ({"radius_mm": -4000.0, "off_axis_mm": 3900.0},
         "diameter_mm = 1064.0: must be below 200, where the conic ends"),
        ({"radius_mm": -4000.0, "off_axis_mm": 4000.0},
         "off_axis_mm = 4000.0: must be below 4000, where the conic ends"),
        ({"radius_mm": math.inf, "conic": -1.0},
         "conic = -1.0: must be 0 for a flat mirror; a finite radius_mm makes it curved"),
        ({"radius_mm": math.inf, "off_axis_mm": 5.0},
         "off_axis_mm = 5.0: must be 0 for a flat mirror; a finite radius_mm makes it curved"),
    ],
)  # fmt: skip
def test_a_convex_or_flat_mirror_that_cannot_be_is_refused(mirror, line):
    data = changed("mirror", to=BASE["mirror"] | mirror)
    assert refusal(data) == f"my.toml: mirror.{line}"


@pytest.mark.parametrize("radius", [-4000.0, -600.0, math.inf])
@pytest.mark.parametrize("key", ["camera", "screen"])
def test_a_device_in_front_of_a_convex_or_flat_mirror_is_above_its_vertex(radius, key):
    data = changed("mirror", "radius_mm", to=radius)
    for x in (0.0, 800.0):  # over the mirror, and beside it, where the rim is lower than the vertex
        data[key]["position_mm"], data[key]["look_at_mm"] = [x, 0.0, -0.001], [1.0, 0.0, -500.0]
        line = f"my.toml: {key}.position_mm = [{x}, 0.0, -0.001]: must lie in front of the mirror: z above 0"
        assert refusal(data) == line
        data[key]["position_mm"] = [x, 0.0, 1.0]
        Scene.from_dict(data)


@pytest.mark.parametrize("radius", [4000.0, -4000.0, -600.0])
def test_the_parents_sag_is_that_of_its_sphere(radius):
    for r in (0.0, 3.0, 532.0):
        sag = radius - math.copysign(math.sqrt(radius**2 - r**2), radius)
        assert Mirror(radius, 1064.0).parent_sag_mm(r) == pytest.approx(sag, abs=2e-12)  # mm: rounding of the radius
    assert Mirror(math.inf, 1064.0).parent_sag_mm(532.0) == 0.0


def test_a_device_may_look_along_y():
    data = changed("screen", "position_mm", to=[30.0, 2000.0, 700.0])
    for y in (0.0, -2000.0):
        data["screen"]["look_at_mm"] = [30.0, y, 700.0]
        Scene.from_dict(data)
    data["screen"]["look_at_mm"] = [30.0, 3000.0, 700.0]  # with its back to the mirror
    assert "must look from position_mm within 89 degrees of some point of the mirror" in refusal(data)


def test_the_largest_allowed_values_are_accepted():
    for steps, value in (
        (("mirror", "diameter_mm"), 1063.9),
        (("mirror", "obscuration_mm"), 1063.9),
        (("screen", "pixels"), [8192, 8192]),
        (("camera", "detector", "pixels"), [4096, 4096]),
        (("camera", "position_mm"), [800.0, 0, 35.0]),
        (("camera", "focus_distance_mm"), 16.01),
        (("mirror", "radius_mm"), 1e12),
        (("mirror", "radius_mm"), -1e12),
        (("mirror", "radius_mm"), math.inf),
        (("name",), "n" * 64),
    ):
        Scene.from_dict(changed(*steps, to=value))
    for conic in (-1.0, -3.0, -1e6):  # paraboloids and hyperboloids have no rim to reach
        Mirror(100.0, 1e6, conic)
    Mirror(1e-12, 1.0, -1.0)
    for radius in (100.0, -100.0):
        assert Mirror(radius, 199.9).diameter_mm == 199.9  # almost the whole half sphere


# --- Python -------------------------------------------------------------------------------------------------


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
    assert not {"numpy", "pyopencl"} & loaded_modules("import irtscots_cl.scene")


# --- any scene, to TOML and back ----------------------------------------------------------------------------

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
    sign = draw(st.sampled_from([1, -1]))
    curved = Mirror(sign * radius, diameter, conic, off_axis, hole, draw(fractions), deviation)
    flat = dataclasses.replace(curved, radius_mm=math.inf, conic=0.0, off_axis_mm=0.0)
    mirror = draw(st.sampled_from([curved, flat]))
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
