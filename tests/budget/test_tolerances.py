"""From nm back to tolerances."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from small_budget import SOURCES, small_trials

from irtscots_cl.budget.monte_carlo import monte_carlo
from irtscots_cl.budget.sensitivity import sensitivities
from irtscots_cl.budget.tolerances import QuadraticError, tolerances
from irtscots_cl.scene.error_sources import Distribution


@pytest.fixture(scope="module")
def trials():
    return small_trials(trials=256, pixels=31)


@pytest.fixture(scope="module")
def found(trials):
    return {one.source.name: one for one in sensitivities(trials.design, trials.sources)}


@pytest.fixture(scope="module")
def error(trials, found):
    return QuadraticError(trials.design, found, trials.budget.sources)


def test_the_quantile_is_that_of_trials(trials, error):
    spread = monte_carlo(trials)
    # a 95 % quantile of 256 trials is known to 6 %; theirs are evenly placed
    assert error.nm() == pytest.approx(spread.percentile_nm(0.95)[0], rel=0.1)
    assert error.nm(coverage=0.5) == pytest.approx(spread.percentile_nm(0.5)[0], rel=0.1)


def test_a_single_normal_source_has_the_normal_quantile(trials, found):
    given = {"screen.z_mm": Distribution(normal=0.05)}
    only = QuadraticError(trials.design, found, given)
    assert only.nm() == pytest.approx(1.95996 * found["screen.z_mm"].left_nm[0] * 0.05, rel=0.01)


def test_with_its_largest_tolerance_the_test_just_meets_it(error):
    told = tolerances(error, 1.5 * error.nm())
    for one in told.each:
        if np.isfinite(one.largest):
            assert error.nm({one.name: one.largest / one.given}) == pytest.approx(told.allow_nm, rel=1e-4)
    assert error.nm(dict.fromkeys(SOURCES, told.common_factor)) == pytest.approx(told.allow_nm, rel=1e-9)
    assert told.plan == ()  # nothing to do
    assert told.cap_nm == np.inf and all(one.together == one.given for one in told.each)


def test_where_the_others_cost_too_much_no_tolerance_helps(error):
    told = tolerances(error, 5.0)
    assert {one.name: one.largest for one in told.each}["noise.place_mm"] == 0.0


def test_sizes_that_meet_it_together(error, found):
    """The dear ones cost the same, the cheap ones stay."""
    told = tolerances(error, 5.0)
    together = {one.name: one.together for one in told.each}
    assert error.nm({one.name: one.together / one.given for one in told.each}) == pytest.approx(5.0, rel=1e-4)
    cost = {name: found[name].left_nm[0] * replace(one, **{one.kind: together[name]}).sigma
            for name, one in error.given.items()}  # fmt: skip
    dear = [name for name, one in error.given.items() if together[name] < one.size]
    assert 2 <= len(dear) < len(cost)
    assert all(cost[name] == pytest.approx(told.cap_nm, rel=1e-6) for name in dear)
    assert all(nm <= told.cap_nm * (1 + 1e-9) for nm in cost.values())


def test_the_plan_reaches_what_is_allowed(error):
    told = tolerances(error, 5.0)
    assert told.plan and told.plan[-1].after_nm <= 5.0
    nm = [error.nm(), *(step.after_nm for step in told.plan)]
    assert all(a > b for a, b in pairwise(nm))
    assert error.nm({step.name: 0.0 for step in told.plan}) == pytest.approx(told.plan[-1].after_nm)


def test_cheap_calibrations_come_first(trials, found):
    given = dict(trials.budget.sources)
    first = tolerances(QuadraticError(trials.design, found, given), 5.0).plan[0].name
    costs = {name: replace(one, cost=1e6 if name == first else 1.0) for name, one in given.items()}
    plan = tolerances(QuadraticError(trials.design, found, costs), 5.0).plan
    assert plan[0].name != first and plan[0].cost == 1.0
    none = {name: replace(one, cost=1.0 if name == "screen.x_mm" else None) for name, one in given.items()}
    only = tolerances(QuadraticError(trials.design, found, none), 5.0).plan
    assert [step.name for step in only] == ["screen.x_mm"] and only[0].after_nm > 5.0
