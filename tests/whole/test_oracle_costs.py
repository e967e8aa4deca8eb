"""The oracle's nanometres: what a wrong geometry, and faults of camera and screen that nobody described, cost."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from oracle import sensitivities, undescribed
from oracle.measured import TERMS, heights, left_nm, record
from oracle.rig import Rig

TESTS = Path(__file__).parents[1]
SPHERE = (TESTS.parent / "irtscots_cl" / "scene" / "preset_scenes" / "sphere.toml").read_text(encoding="utf-8")
KEPT = json.loads((TESTS / "oracle" / "sensitivities.json").read_text(encoding="utf-8"))
QUICK = ("both x", "both z", "apart x", "screen.clocking_rad")  # the others: slow


@pytest.fixture(scope="module")
def sphere():
    return record(Rig.of(SPHERE))


def check(sphere, name):
    found = sensitivities.sensitivity(sphere, sensitivities.CASES[name])
    for convention, left in KEPT[name].items():
        for terms, kept in left.items():
            assert math.isclose(found[convention][terms], kept, abs_tol=6e-4), (convention, terms)  # nm: kept to 0.001


@pytest.mark.parametrize("name", QUICK)
def test_sensitivities(sphere, name):
    check(sphere, name)


@pytest.mark.slow
def test_all_sensitivities(sphere):
    for name in sensitivities.CASES:
        check(sphere, name)


def test_the_kept_numbers_are_those_of_the_cases_and_agree_with_known_ones():
    assert list(KEPT) == list(sensitivities.CASES)
    both, turned, apart = KEPT["both z"], KEPT["screen.clocking_rad"], KEPT["apart x"]
    for convention in both:
        assert math.isclose(both[convention]["piston_tilt"], 236, abs_tol=1)
        assert math.isclose(turned[convention]["piston_tilt"], 19.2, abs_tol=0.05)
        assert math.isclose(apart[convention]["piston_tilt"], 10.7, abs_tol=0.05)
        assert math.isclose(apart[convention]["piston_tilt_power"], 8.8, abs_tol=0.05)
    assert math.isclose(both["fixed_points"]["piston_tilt_power"], 1.0, abs_tol=0.05)


def test_a_shift_of_both_devices_shows_the_sphere_moved_the_other_way(sphere):
    # The measured surface is then known in closed form: the same sphere, its centre 0.1 mm away from the axis.
    seen = sphere.through(sensitivities.with_faults(sphere.described, sensitivities.CASES["both x"]))
    x, y, _ = seen.path.mirror.T
    radius = 4166.747
    moved, still = (radius - np.sqrt(radius**2 - (x + dx) ** 2 - y**2) for dx in (0.1, 0.0))
    exact = left_nm(seen, moved - still)
    for terms, found in left_nm(seen, heights(seen)).items():
        assert math.isclose(found, exact[terms], abs_tol=0.05), terms  # nm: the piston is unknown, 1/2 of tilt^2 / R


def test_a_wrong_distance_along_the_axis_shows_as_power(sphere):
    # The slope of a sphere seen from z = R + d, at radius r: r / (R - z) for the centre, so its height is
    # (d / 2) ln(1 - r^2 / R^2) away from the sphere's; the arms of 3 degrees change it by parts of sin(3 degrees)^2.
    seen = sphere.through(sensitivities.with_faults(sphere.described, sensitivities.CASES["both z"]))
    r2 = np.sum(seen.path.mirror[:, :2] ** 2, -1)
    expected = left_nm(seen, 0.05 * np.log(1 - r2 / 4166.747**2))["piston_tilt"]
    assert math.isclose(left_nm(seen, heights(seen))["piston_tilt"], expected, rel_tol=0.003)


def test_a_test_that_is_as_described_shows_nothing(sphere):
    assert max(left_nm(sphere, heights(sphere)).values()) < 1e-4  # nm


def test_faults_that_are_not_described():
    found = undescribed.costs_nm(undescribed.SCENE.read_text(encoding="utf-8"))
    for name, kept in undescribed.COSTS_NM.items():
        assert math.isclose(found[name]["piston_tilt"], kept, abs_tol=0.01), name


def test_coma_of_a_paraboloid_seen_at_the_wrong_place():
    # Against a sphere about the camera a paraboloid deviates by r^4 / (8 R^3); shifted by s that is s x r^2 / (2 R^3),
    # and without tilt its rms is s a^3 / (12 sqrt(2) R^3). Arms and the conic's next order change some percents.
    shift = 0.1 * 0.037 / 16 * 4166.747 * (1 - 16 / 4166.747)
    coma = shift * 532**3 / (12 * math.sqrt(2) * 4166.747**3) * 1e6
    assert math.isclose(undescribed.COSTS_NM["principal point 0.1 px in x"], coma, rel_tol=0.03)
    assert len(TERMS) == 4


def test_the_principal_point_costs_in_proportion_to_a_pixel_on_the_mirror():
    coarse = undescribed.SCENE.read_text(encoding="utf-8")
    coarse = coarse.replace("[125, 125]", "[47, 47]").replace("0.037", "0.0984")
    faults = {name: undescribed.FAULTS[name] for name in ("principal point 0.1 px in x", "camera rolled 0.1 degree")}
    found = undescribed.costs_nm(coarse, faults)
    assert math.isclose(found["principal point 0.1 px in x"]["piston_tilt"], 310, abs_tol=1)
    assert math.isclose(found["camera rolled 0.1 degree"]["piston_tilt"], 33.8, abs_tol=0.1)
