"""The budget to first order where a source is a constant: it adds to every test alike."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from small_budget import small_trials

from irtscots_cl.budget.assess import own_sensitivities
from irtscots_cl.budget.linear import linear_budget
from irtscots_cl.budget.monte_carlo import monte_carlo
from irtscots_cl.budget.sensitivity import NM, sensitivities
from irtscots_cl.budget.source import Kind
from irtscots_cl.budget.tolerances import QuadraticError, tolerances
from irtscots_cl.scene.validation import SceneError

CONSTANT = "camera.diffraction_nm"
SOURCES = {CONSTANT: 3000.0, "screen.brightness_xx": 0.05, "camera.x_mm": {"uniform": 0.3}, "noise.place_mm": 5e-3}


@pytest.fixture(scope="module")
def trials():
    return small_trials(trials=256, sources=SOURCES, pixels=31)


@pytest.fixture(scope="module")
def linear(trials):
    return linear_budget(trials.design, own_sensitivities(trials), trials.budget.sources)


def test_a_constant_is_the_mean_of_the_trials(trials, linear):
    spread = monte_carlo(trials)
    noise = linear.deviation_mm / np.sqrt(trials.budget.trials)
    assert np.abs(spread.mean_mm - linear.constant_mm).max() < 4.4 * noise.max()
    assert np.abs(linear.constant_mm).max() > 10 * noise.max()
    assert np.mean(spread.deviation_mm / linear.deviation_mm) == pytest.approx(1, rel=0.05)
    assert spread.root_mean_square_nm == pytest.approx(linear.total_nm, rel=0.12)  # 3 sigma of the noise


def test_a_constant_alone_does_not_spread(linear):
    assert linear.first[CONSTANT] == linear.total[CONSTANT] == 0
    only = small_trials(sources={CONSTANT: 3000.0}, pixels=31)
    found = linear_budget(only.design, own_sensitivities(only), only.budget.sources)
    assert not found.deviation_mm.any() and not found.zernike_covariance_nm2.any()
    assert found.total_nm == pytest.approx(found.nm[CONSTANT], rel=1e-12)


def test_sobol_indices_beside_a_constant_are_those_of_scipy(trials, linear):
    """Products with the constant's map count: of the mean square by Saltelli's estimator of scipy."""
    names = ["camera.x_mm", "screen.brightness_xx"]
    found = own_sensitivities(trials)
    without = trials.design.response.without
    maps = np.stack([without(found[name].height_mm, "piston_tilt") for name in names]) * NM
    given = {name: trials.budget.sources[name] for name in (*names, CONSTANT)}
    only = linear_budget(trials.design, {name: found[name] for name in given}, given)
    sigma = given["screen.brightness_xx"].size
    indices = stats.sobol_indices(
        func=lambda x: np.mean((x.T @ maps + linear.constant_mm * NM) ** 2, axis=-1)[None],
        n=2**11,
        dists=[stats.uniform(-0.3, 0.6), stats.norm(scale=sigma)],
        rng=np.random.default_rng(1),
    )
    for k, name in enumerate(names):
        assert only.first[name] == pytest.approx(indices.first_order[k], abs=0.05)
        assert only.total[name] == pytest.approx(indices.total_order[k], abs=0.05)
    bare = linear_budget(trials.design, {name: found[name] for name in names}, {n: given[n] for n in names})
    assert abs(bare.first[names[1]] - only.first[names[1]]) > 0.1  # the constant matters here


def test_quantiles_have_the_constant_in_every_test(trials):
    error = QuadraticError(trials.design, own_sensitivities(trials), trials.budget.sources)
    spread = monte_carlo(trials)
    for share in (0.05, 0.5, 0.95):
        assert error.nm(coverage=share) == pytest.approx(spread.percentile_nm(share)[0], rel=0.06)
    told = tolerances(error, 0.5 * error.nm())
    assert {one.name: one.largest for one in told.each}["noise.place_mm"] == 0


def test_a_constant_is_taken_at_its_own_size(trials):
    """Of one that is not in proportion to its value."""
    (source,) = (one for one in trials.sources if one.kind is Kind.CONSTANT)
    (usual,), (large,) = (sensitivities(trials.design, [source], sizes={CONSTANT: size}) for size in (550.0, 20000.0))
    change = np.abs(large.height_mm - usual.height_mm).max() / np.abs(usual.height_mm).max()
    assert change > 0.01


def test_a_constant_has_one_size():
    with pytest.raises(SceneError, match=r"noise.place_mm.*normal = 0.001: must be a number; a process has one size"):
        small_trials(sources={"noise.place_mm": {"normal": 1e-3, "set_ups": 2}})
    with pytest.raises(
        SceneError, match=r"camera.diffraction_nm.*uniform = 500.0: must be a number; a constant has one"
    ):
        small_trials(sources={CONSTANT: {"uniform": 500.0}})
