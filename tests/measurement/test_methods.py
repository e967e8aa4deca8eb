"""Ready-made ways to measure: their names, their settings, and that the settings reach those who do the work."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import noise_free_stack, small_scene

from irtscots_cl.cli.common import LAB_MEASURE
from irtscots_cl.measurement import methods as measures
from irtscots_cl.measurement.methods import BEST, MEASURES, NOISE_FREE, Measure, check_measure, measure_by
from irtscots_cl.measurement.reconstruction import reconstruct


@pytest.fixture(scope="module")
def sphere():
    scene = small_scene("sphere", 25)
    return scene, noise_free_stack(scene)


@pytest.fixture
def spied(monkeypatch):
    """Stands in for the workers; the calls they got: [(name, positional, keywords)]."""
    calls = []

    def stand_in(name):
        def worker(*positional, **keywords):
            calls.append((name, positional, keywords))
            return f"by {name}"

        return worker

    for name in ("reconstruct", "refine"):
        monkeypatch.setattr(measures, name, stand_in(name))
    return calls


def test_there_are_three_for_images_free_of_noise_and_two_for_a_laboratory_s():
    assert list(MEASURES) == [*NOISE_FREE, "windowed", "likelihood"]
    assert NOISE_FREE == ("paper", "fine", "refined") and BEST == LAB_MEASURE == "likelihood"
    for name in ("windowed", "likelihood"):
        assert MEASURES[name].light_curve == name and MEASURES[name].rounds > 0
        assert (MEASURES[name].method, MEASURES[name].pixel_average) == ("cubic", False)
    assert MEASURES["paper"] == Measure()
    fine, refined = MEASURES["fine"], MEASURES["refined"]
    assert fine.rounds == 0 < refined.rounds
    assert (fine.light_curve, fine.method, fine.pixel_average) == (
        refined.light_curve,
        refined.method,
        refined.pixel_average,
    )


def test_the_paper_s_is_what_reconstruct_does_unasked(sphere):
    scene, stack = sphere
    found, plain = measure_by("paper", stack, scene), reconstruct(stack, scene)
    np.testing.assert_array_equal(found.deviation_mm, plain.deviation_mm)
    assert (found.light_curve, found.method, found.pixel_average) == ("centroid", "southwell", True)
    assert found.updates_nm == ()


@pytest.mark.parametrize("name", ["fine", "refined"])
def test_a_result_tells_how_it_was_made(sphere, name):
    scene, stack = sphere
    found = measure_by(name, stack, scene)
    assert (found.light_curve, found.method, found.pixel_average) == ("chord", "cubic", False)
    assert 1 <= len(found.updates_nm) <= 4 if name == "refined" else found.updates_nm == ()


@pytest.mark.parametrize("name", MEASURES)
def test_every_setting_is_passed_on(spied, name):
    how = MEASURES[name]
    threshold = 0.0 if how.rounds else 0.2
    found = measure_by(name, "stack", "nominal", threshold=threshold)
    settings = {"light_curve": how.light_curve, "method": how.method, "pixel_average": how.pixel_average}
    assert spied[0] == ("reconstruct", ("stack", "nominal"), settings | {"threshold": threshold, "estimates": None})
    if how.rounds:
        ending = {"rounds": how.rounds, "tolerance_nm": how.tolerance_nm}
        assert spied[1:] == [("refine", ("by reconstruct", "stack"), ending)]
        assert found == "by refine"
    else:
        assert len(spied) == 1 and found == "by reconstruct"


def test_estimates_that_are_there_serve_the_likelihood_alone(spied):
    """The best measure's estimates check the images; other measures must not take them for their own."""
    for name in MEASURES:
        measure_by(name, "stack", "nominal", estimates="of likelihood")
    passed = [keywords["estimates"] for worker, _, keywords in spied if worker == "reconstruct"]
    assert passed == [None, None, None, None, "of likelihood"]


def test_without_a_threshold_every_sample_counts(spied):
    measure_by("refined", "stack", "nominal")
    assert spied[0][2]["threshold"] == 0.0


@pytest.mark.parametrize("name", ["refined", "windowed", "likelihood"])
def test_refinement_with_a_threshold_is_refused(spied, name):
    with pytest.raises(ValueError, match=rf"threshold = 0.2: measure {name} needs whole light curves; must be 0"):
        measure_by(name, "stack", "nominal", threshold=0.2)
    assert spied == []


@pytest.mark.parametrize("name", ["", "Paper", "finest", "paper "])
def test_an_unknown_name_is_refused_before_anything_is_done(spied, name):
    for refuse in (check_measure, lambda bad: measure_by(bad, None, None)):
        with pytest.raises(ValueError, match="must be one of paper, fine") as caught:
            refuse(name)
        assert str(caught.value) == f"measure = {name!r}: must be one of paper, fine, refined, windowed, likelihood"
    assert spied == []


@pytest.mark.parametrize("name", MEASURES)
def test_a_known_name_gives_its_settings(name):
    assert check_measure(name) is MEASURES[name]
