"""The table [mirror.asphere]: what it takes, what it refuses, and its heights."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace

import pytest

from irtscots_cl.scene.asphere import Asphere
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError

TEXT = load_scene("sphere-deviated").to_toml()
Q = "normalisation_radius_mm = 600.0\n"


def with_table(table: str, **mirror: float) -> Scene:
    data = tomllib.loads(TEXT)
    data["mirror"] |= {**mirror, "asphere": tomllib.loads(table)}
    return Scene.from_dict(data, "f.toml")


def test_a_table_comes_back_from_toml_and_stays_with_the_design():
    for table in ("coefficients_mm = { 4 = 1.2e-12, 7 = -3e-21 }", Q + "q_con_um = { 0 = 3, 5 = -0.25 }",
                  Q + "q_bfs_um = { 1 = 4.5 }\ncoefficients_mm = { 2 = 1e-7 }"):  # fmt: skip
        scene = with_table(table)
        assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene
        assert scene.nominal().mirror.asphere == scene.mirror.asphere
        assert hash(scene.mirror) != hash(replace(scene.mirror, asphere=None))
        assert isinstance(scene.mirror.asphere, Asphere)


def test_heights_are_the_terms_sums():
    terms = Asphere({2: 1e-5, 3: -2e-7, 20: 1e-40}, {1: 2.0}, {0: 5.0}, 120.0)
    r, x = 100.0, (100 / 120) ** 2
    powers = 1e-5 * r**2 - 2e-7 * r**3 + 1e-40 * r**20
    con = 2e-3 * x**2 * (6 * x - 5)  # P_1^(0,4)(2 x - 1)
    bfs = 5e-3 * x * (1 - x) / math.sqrt(1 - (r / 900) ** 2)
    assert terms.height_mm(r, -900.0) == pytest.approx(powers + con + bfs, rel=1e-13)
    assert terms.height_mm(0.0, -900.0) == 0.0
    mirror = Mirror(radius_mm=900.0, diameter_mm=200.0, asphere=terms)
    assert mirror.parent_sag_mm(r) == pytest.approx(900 - math.sqrt(900**2 - r * r) + powers + con + bfs, rel=1e-13)


REFUSED = [
    ("coefficients_mm = { 1 = 1e-3 }", {}, "coefficients_mm.1 = 0.001: must have a power from 2 to 20 as its key"),
    ("coefficients_mm = { 21 = 1e-60 }", {}, "coefficients_mm.21 = 1e-60: must have a power from 2 to 20 as its key"),
    ("coefficients_mm = { 4 = inf }", {}, "coefficients_mm.4 = inf: must be a finite number within 1e+06"),
    ("coefficients_mm = { 4 = true }", {}, "coefficients_mm.4 = True: must be a finite number within 1e+06"),
    ("coefficients_mm = { 04 = 1.0 }", {}, "coefficients_mm.04 = 1.0: must have a power from 2 to 20 as its key"),
    ("coefficients_mm = {}", {}, "coefficients_mm = {}: must be a table { power = mm^(1 - power) }"),
    ("coefficients = 3", {}, "mirror.asphere.coefficients: unknown key; did you mean coefficients_mm?"),
    ("", {}, "coefficients_mm = None: must be given, or q_con_um or q_bfs_um"),
    ("q_con_um = { 0 = 1.0 }", {}, "q_con_um = {0: 1.0}: must come with normalisation_radius_mm"),
    ("coefficients_mm = { 4 = 1e-15 }\n" + Q, {}, "normalisation_radius_mm = 600.0: must be left out without q_con_um"),
    ("normalisation_radius_mm = 500.0\nq_con_um = { 0 = 1.0 }", {}, "= 500.0: must be at least 532, the distance of"),
    (Q + "q_con_um = { 19 = 1.0 }", {}, "q_con_um.19 = 1.0: must have an index m from 0 to 18 as its key"),
    (Q + "q_bfs_um = { 0 = 1.0 }", {"conic": -1.0}, "mirror.conic = -1.0: must be 0 with asphere.q_bfs_um"),
    ("normalisation_radius_mm = 5e3\nq_bfs_um = { 0 = 1.0 }", {}, "= 5000.0: must be below radius_mm's magnitude"),
    ("coefficients_mm = { 4 = 1e-3 }", {}, "must have slopes below 1 on the mirror, not 5.99e+05"),
    ("coefficients_mm = { 20 = 1e6, 19 = -1e6 }", {}, "must have slopes below 1 on the mirror"),
]


@pytest.mark.parametrize("table, mirror, message", REFUSED)
def test_refusals_are_one_line_that_names_the_key(table, mirror, message):
    with pytest.raises(SceneError) as caught:
        with_table(table, **mirror)
    text = str(caught.value)
    assert text.startswith("f.toml: mirror.") and message in text and "\n" not in text


def test_what_is_no_asphere_is_refused():
    with pytest.raises(SceneError, match=r"Mirror: asphere = .*must be an Asphere of irtscots_cl.scene.asphere"):
        Mirror(radius_mm=900.0, diameter_mm=200.0, asphere={4: 1e-9})


def test_devices_must_be_above_the_whole_sag():
    """Terms of 50 mm at the rim lift the mirror's edge above a device that the conic alone leaves free."""
    scene = with_table("coefficients_mm = { 4 = 1e-12 }")
    low = replace(scene.camera, position_mm=(532.0, 0.0, 60.0), look_at_mm=(-100.0, 0.0, 0.0))
    assert replace(scene, camera=low).camera == low
    steep = Asphere({4: 50.0 / 532**4})
    with pytest.raises(SceneError, match=r"camera.position_mm = .*must lie in front of the mirror: z above 8"):
        replace(scene, camera=low, mirror=replace(scene.mirror, asphere=steep))
