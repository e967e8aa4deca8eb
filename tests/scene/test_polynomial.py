"""The tables [[mirror.polynomial]] and annular [[mirror.zernike]]: what is taken, and what is refused in one line."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import pytest
from freeform import ANNULAR, DESIGN, freeform
from fuzz import NUMBERS, OTHERS, TEXTS
from loaded_modules import loaded_modules
from refusals import BASE, changed, refusal

from irtscots_cl.maths.zernike.indices import index_to_nm
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms, _azimuthal_order, _radial_order
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.polynomial import Polynomial
from irtscots_cl.scene.validation import SceneError

GOOD = {"basis": "legendre", "half_size_mm": [540.0, 540.0], "coefficients_um": [[2, 0, 0.3], [1, 1, -0.1]]}
POWERS = {"basis": "monomial", "coefficients_mm": [[3, 0, 1e-12]]}


def with_tables(*tables):
    return changed("mirror", "polynomial", to=list(tables))


def test_tables_become_checked_values():
    scene = Scene.from_dict(with_tables(GOOD, POWERS | {"part": "design", "centre_mm": [1.0, 2.0]}))
    first, second = scene.mirror.polynomial
    assert first == Polynomial("legendre", (540.0, 540.0), coefficients_um=((2, 0, 0.3), (1, 1, -0.1)))
    assert (first.centre_mm, first.part, second.part, second.half_size_mm) == ((0.0, 0.0), "deviation", "design", None)
    assert scene.nominal().mirror.polynomial == (second,)


def test_toml_text_loads_back_to_an_equal_scene():
    for scene in (freeform(), Scene.from_dict(with_tables(GOOD, POWERS))):
        again = Scene.from_dict(tomllib.loads(scene.to_toml()))
        assert again == scene and hash(again) == hash(scene)
    assert freeform().to_toml().count("obscuration = 0.25") == 1


def test_powers_of_mm_are_those_of_their_rectangle():
    table = Polynomial("monomial", centre_mm=(0.0, 20.0), coefficients_mm=((2, 1, 3.0),))
    assert table.rectangle_mm(100.0) == (100.0, 120.0)
    assert table.terms_mm(100.0) == [(2, 1, 3.0 * 100.0**2 * 120.0)]
    assert DESIGN.terms_mm(500.0)[0] == (2, 0, 900.0 * 1e-3)


@pytest.mark.parametrize(
    ("change", "key", "must"),
    [
        ({"basis": "zernike"}, "basis = 'zernike'", "must be one of chebyshev, legendre, monomial"),
        ({"half_size_mm": None}, "half_size_mm", "must be given with coefficients_um"),
        ({"half_size_mm": [540.0, 500.0]}, "half_size_mm = [540.0, 500.0]",
         "must be at least [532.0, 532.0], to cover the mirror"),
        ({"centre_mm": [20.0, 0.0]}, "half_size_mm", "must be at least [552.0, 532.0], to cover the mirror"),
        ({"half_size_mm": [540.0, -1.0]}, "half_size_mm", "two lengths from 1e-12"),
        ({"half_size_mm": 540.0}, "half_size_mm = 540.0", "[x, y], two lengths"),
        ({"centre_mm": [20.0]}, "centre_mm", "two finite numbers"),
        ({"coefficients_um": []}, "coefficients_um = []", "must be given, or coefficients_mm of a monomial basis"),
        ({"coefficients_mm": [[0, 0, 1.0]]}, "coefficients_um", "and not both"),
        ({"coefficients_um": [], "coefficients_mm": [[0, 0, 1.0]]}, "coefficients_mm", "only monomials"),
        ({"coefficients_um": [[31, 0, 0.1]]}, "coefficients_um", "whole numbers from 0 to 30"),
        ({"coefficients_um": [[-1, 0, 0.1]]}, "coefficients_um", "whole numbers from 0 to 30"),
        ({"coefficients_um": [[1.5, 0, 0.1]]}, "coefficients_um", "whole numbers from 0 to 30"),
        ({"coefficients_um": [[1, 0]]}, "coefficients_um", "an array of [i, j, value]"),
        ({"coefficients_um": [[1, 0, float("nan")]]}, "coefficients_um", "a finite number within 1e6"),
        ({"coefficients_um": {"1,0": 0.1}}, "coefficients_um", "an array of [i, j, value]"),
        ({"coefficients_um": [[1, 0, 0.1], [0, 1, 0.2], [1, 0, 0.3]]}, "coefficients_um = [1, 0]",
         "every pair of powers once"),
        ({"part": "nominal"}, "part = 'nominal'", "must be one of deviation, design"),
        ({"basis": "monomial", "half_size_mm": None, "coefficients_um": [], "coefficients_mm": [[30, 0, 1e-70]]},
         "coefficients_mm = '5.99e+11 mm'", "magnitudes add up to at most 100000 mm on the mirror"),
        ({"radius_mm": 3.0}, "radius_mm", "unknown key"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_refused_with_key_value_and_what_is_allowed(change, key, must):
    table = {key: value for key, value in (GOOD | change).items() if value is not None}
    message = refusal(with_tables(POWERS, table))
    assert message.startswith(f"my.toml: mirror.polynomial[1].{key}"), message
    assert must in message, message


@pytest.mark.parametrize("value", [[1], "text", 3, {"basis": "legendre"}])
def test_the_tables_are_tables(value):
    assert "mirror.polynomial" in refusal(changed("mirror", "polynomial", to=value))


def test_a_rectangle_with_powers_of_mm_is_refused():
    message = refusal(with_tables(POWERS | {"half_size_mm": [600.0, 600.0]}))
    assert message.endswith("polynomial[0].half_size_mm = [600.0, 600.0]: must be left out with coefficients_mm")


def test_a_power_beyond_all_numbers_is_refused():
    far = BASE["mirror"] | {"radius_mm": float("inf"), "diameter_mm": 1e12, "zernike": []}
    with pytest.raises(SceneError, match=r"coefficients_mm = 'inf mm': must have terms"):
        Mirror(**far | {"polynomial": (Polynomial("monomial", coefficients_mm=((30, 0, 1e-12),)),), "zernike": ()})


def test_any_value_of_any_key_is_taken_or_refused_in_one_line():
    taken = 0
    for k, key in enumerate(GOOD | POWERS | {"centre_mm": 0, "part": 0}):
        for value in (NUMBERS + TEXTS + OTHERS)[k % 3 :: 3]:
            try:
                data = tomllib.loads(f"{key} = {value}")
            except (ValueError, RecursionError):
                continue
            try:
                Scene.from_dict(with_tables(GOOD | data), "my.toml").to_toml()
                taken += 1
            except SceneError as refused:
                assert str(refused).startswith("my.toml: mirror.polynomial") and str(refused).isprintable()
    assert taken > 0  # a centre, and an empty array of the other coefficients


def test_something_else_is_refused():
    with pytest.raises(SceneError, match="be a Polynomial of irtscots_cl.scene.polynomial"):
        replace(freeform().mirror, polynomial=("chebyshev",))


# --- annular Zernike terms ----------------------------------------------------------------------------------


def ring(**changes):
    return changed("mirror", "zernike", to=[{"radius_mm": 540.0, "noll_um": {"6": 0.1}} | changes])


def test_the_obscuration_is_a_ratio():
    assert Scene.from_dict(ring(obscuration=0.3)).mirror.zernike[0].obscuration == 0.3
    assert Scene.from_dict(ring()).mirror.zernike[0].obscuration == 0.0
    for wrong in (-0.1, 1.0, "0.2", float("nan")):
        message = refusal(ring(obscuration=wrong))
        assert "mirror.zernike[0].obscuration = " in message and "at least 0 and below 1" in message
    assert "did you mean obscuration?" in refusal(ring(obscuraton=0.2))


def test_terms_that_grow_without_bounds_in_the_hole_are_refused():
    """Noll 211 is (20, 0): ten steps of (1 + e) / (1 - e) = 3."""
    message = refusal(ring(obscuration=0.5, noll_um={"6": 0.1, "211": 0.1}))
    assert message == (
        "my.toml: mirror.zernike[0].obscuration = 0.5: must be so small that no term grows 10000-fold in the hole, "
        "as 211 does"
    )
    assert Scene.from_dict(ring(obscuration=0.25, noll_um={"211": 0.1}))
    assert Scene.from_dict(ring(obscuration=0.99, noll_um={"6": 0.1, "14": 0.1}))  # (2, 2) and (4, 4): no steps


@pytest.mark.parametrize("ordering", ["noll", "fringe", "osa"])
def test_orders_of_indices(ordering):
    for index in range(0 if ordering == "osa" else 1, 200):
        n, m = index_to_nm(index, ordering)
        assert (_radial_order(ordering, index), _azimuthal_order(ordering, index)) == (n, abs(m))


def test_disks_and_rings_may_differ():
    mirror = Mirror(4000.0, 1000.0, zernike=(*ANNULAR, ZernikeTerms(500.0, "osa", {5: 0.1})))
    assert len({hash(terms) for terms in mirror.zernike}) == 3
    assert replace(ANNULAR[0], obscuration=0.0) != ANNULAR[0]


def test_scenes_without_polynomials_do_not_import_their_module():
    loaded = loaded_modules("from irtscots_cl.scene.presets import load_scene; load_scene('sphere-deviated')")
    assert "irtscots_cl.scene.model" in loaded and "irtscots_cl.scene.polynomial" not in loaded
