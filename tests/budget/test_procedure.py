"""What is made of height maps: compensators, exposures, turns of the mirror."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.assess import assess_budget, own_sensitivities
from irtscots_cl.budget.averaging import left_by_turns
from irtscots_cl.budget.ledger import ledger
from irtscots_cl.budget.linear import linear_budget
from irtscots_cl.budget.measured_design import NOLLS, MeasuredDesign
from irtscots_cl.budget.monte_carlo import monte_carlo
from irtscots_cl.budget.tolerances import QuadraticError
from irtscots_cl.budget.trials import Trials
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.outline import Outline
from irtscots_cl.scene.validation import SceneError


@pytest.fixture(scope="module")
def design():
    return MeasuredDesign.of(Setup(small_scene(31)))


def trials_of(design, sources, count=16, **more):
    return Trials.of(design, Budget(sources=dict(sources), trials=count, **more))


def test_a_source_that_is_its_own_compensator_costs_nothing(design):
    """In sensitivity, prediction and tolerances; in trials and ledger what is not in proportion is left: 0.3 um of
    height, most of it power, by half a millimetre of distance, of which second orders are 1e-3."""
    plain = trials_of(design, {"screen.z_mm": 0.5})
    trials = trials_of(design, {"screen.z_mm": 0.5}, compensators=("screen.z_mm",))
    before, after = own_sensitivities(plain), own_sensitivities(trials)
    nm = before["screen.z_mm"].left_nm[0]
    assert after["screen.z_mm"].left_nm.max() < 1e-9 * nm
    assert linear_budget(design, after, trials.budget.sources).total_nm.max() < 1e-9 * nm
    assert QuadraticError(design, after, trials.budget.sources).nm() < 1e-9 * nm
    whole, left = monte_carlo(plain).rms_nm[:, 0].max(), monte_carlo(trials).rms_nm[:, 0].max()
    assert 0 < left < 5e-3 * whole
    row = ledger(trials, 3).rows[0]
    assert design.response.left(row.height_mm[None]).max() * 1e6 < 5e-3 * whole


def test_a_combination_leaves_what_neither_compensator_has(design):
    """By plain least squares over piston, tilt and both maps."""
    names = ("screen.z_mm", "camera.tilt_x_rad")
    source = {"camera.x_mm": 0.1}
    plain = own_sensitivities(trials_of(design, source | dict.fromkeys(names, 1e-3)))
    found = own_sensitivities(trials_of(design, source, compensators=names))["camera.x_mm"]
    seen, own = design.seen, plain["camera.x_mm"].height_mm
    x, y = seen.x_mm[seen.mask], seen.y_mm[seen.mask]
    columns = np.stack([np.ones_like(x), x / 500, y / 500, *(plain[name].height_mm for name in names)], -1)
    columns = columns / np.linalg.norm(columns, axis=0)
    left = own - columns @ np.linalg.lstsq(columns, own)[0]
    assert found.left_nm[0] == pytest.approx(np.sqrt(np.mean(left**2)) * 1e6, rel=1e-6)
    assert found.left_nm[0] < plain["camera.x_mm"].left_nm[0]


def test_compensators_that_do_the_same_or_nothing_are_no_trouble(design):
    names = ("screen.z_mm", "mirror.z_mm", "mirror.clocking_rad", "camera.z_mm")
    found = own_sensitivities(trials_of(design, {"screen.z_mm": 0.5}, compensators=names))
    assert found["screen.z_mm"].left_nm.max() < 1e-3


def test_exposures_take_down_processes_alone(design):
    sources = {"screen.x_mm": 0.1, "noise.place_mm": 1e-2, "screen.brightness_random": 0.1}
    one, four = (own_sensitivities(trials_of(design, sources, exposures=n)) for n in (1, 4))
    assert four["noise.place_mm"].left_nm == pytest.approx(one["noise.place_mm"].left_nm / 2)
    for name in ("screen.x_mm", "screen.brightness_random"):  # the screen's pixels stay as they are
        assert np.array_equal(four[name].left_nm, one[name].left_nm)
    trials = trials_of(design, {"noise.place_mm": 1e-2}, count=32, exposures=4)
    rms = np.sqrt(np.mean(monte_carlo(trials).rms_nm[:, 0] ** 2))
    # 32 maps of low orders mostly: to 10 %
    assert rms == pytest.approx(1e-2 * four["noise.place_mm"].left_nm[0], rel=0.3)


@pytest.mark.parametrize("turns", [2, 3])
def test_turns_leave_of_an_instruments_error_what_the_rule_says(design, turns):
    sources = {"screen.x_mm": 0.1, "zernike.6_um": 0.1}
    one, many = (trials_of(design, sources, mirror_turns=n) for n in (1, turns))
    before, after = own_sensitivities(one), own_sensitivities(many)
    left = before["screen.x_mm"].zernike_nm * left_by_turns(NOLLS, turns)
    assert np.abs(after["screen.x_mm"].zernike_nm - left).max() < 2e-3 * np.abs(before["screen.x_mm"].zernike_nm).max()
    assert np.array_equal(after["zernike.6_um"].height_mm, before["zernike.6_um"].height_mm)  # turns with the mirror
    linear = linear_budget(design, after, many.budget.sources).total_nm
    rms = np.sqrt(np.mean(monte_carlo(many).rms_nm ** 2, axis=0))
    assert rms == pytest.approx(linear, rel=0.2, abs=0.02)  # second orders: 0.02 nm
    whole = ledger(many, 3)
    assert np.abs(sum(row.height_mm for row in whole.rows) - whole.total_mm).max() < 1e-12


def test_turns_take_down_noise_as_exposures_do(design):
    found = {
        key: own_sensitivities(trials_of(design, {"noise.place_mm": 1e-2}, **{key: 4}))["noise.place_mm"]
        for key in ("exposures", "mirror_turns")
    }
    assert found["mirror_turns"].left_nm[0] == pytest.approx(found["exposures"].left_nm[0], rel=0.1)
    trials = trials_of(design, {"noise.place_mm": 1e-2}, count=8, mirror_turns=4)
    rms = np.sqrt(np.mean(monte_carlo(trials).rms_nm[:, 0] ** 2))
    assert rms == pytest.approx(1e-2 * found["mirror_turns"].left_nm[0], rel=0.5)  # 8 maps


def test_without_any_nothing_is_changed(design):
    plain = trials_of(design, {"screen.x_mm": 0.1, "noise.place_mm": 1e-3})
    assert plain.procedure.text == ""
    height = plain.heights_mm([(3, None)])[0]
    assert np.array_equal(height, design.heights_mm(plain.changes_mm(3)[None])[0])


def test_turns_need_an_outline_that_turns_into_itself():
    """A hexagon does after a third of a turn, whose mean leaves no coma, and not after a fifth."""
    hexagon = replace(small_scene(31).mirror, outline=Outline(shape="hexagon", across_flats_mm=900.0))
    design = MeasuredDesign.of(Setup(replace(small_scene(31), mirror=hexagon)))
    left = own_sensitivities(trials_of(design, {"camera.x_mm": 0.1}, mirror_turns=3))["camera.x_mm"].left_nm
    assert left[1] < 0.02 * left[0]  # all but power is gone
    with pytest.raises(SceneError, match="budget.mirror_turns = 5: must turn the mirror's outline, .*is not seen"):
        trials_of(design, {"camera.x_mm": 0.1}, mirror_turns=5)


def test_refusals(design):
    with pytest.raises(
        SceneError, match="budget.compensators = 'screen.w_mm': must be a number of the geom.*; did you mean"
    ):
        trials_of(design, {}, compensators=("screen.w_mm",))
    with pytest.raises(SceneError, match="must name each once"):
        Budget(compensators=("screen.z_mm", "screen.z_mm"))
    scene = small_scene(31, "off-axis")
    with pytest.raises(SceneError, match="budget.mirror_turns = 3: must be 1 with mirror.off_axis_mm") as error:
        assess_budget(replace(scene, budget=Budget(sources={"screen.x_mm": 0.1}, mirror_turns=3)))
    assert "\n" not in str(error.value)
