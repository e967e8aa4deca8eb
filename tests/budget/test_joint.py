"""Sources that were calibrated together."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import CALIBRATED as NAMES
from small_budget import calibration_report as report
from small_budget import small_scene

from irtscots_cl.budget.assess import own_sensitivities
from irtscots_cl.budget.intervals import ErrorSamples
from irtscots_cl.budget.joint import Joint
from irtscots_cl.budget.linear import linear_budget
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.monte_carlo import monte_carlo
from irtscots_cl.budget.tolerances import QuadraticError
from irtscots_cl.budget.trials import Trials
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.validation import SceneError


def trials_of(path: str, count: int = 64, sources=None):
    budget = Budget(sources=sources or {}, trials=count, calibrated=path)
    return Trials.of(MeasuredDesign.of(Setup(small_scene(31))), budget)


def budget_of(trials: Trials):
    found = own_sensitivities(trials)
    return found, linear_budget(trials.design, found, trials.budget.sources, trials.joint)


@pytest.mark.parametrize("correlation", [1.0, -1.0, 0.6])
def test_the_root_is_that_of_the_covariance(correlation):
    covariance = np.array([[4.0, correlation * 6.0], [correlation * 6.0, 9.0]])
    root = Joint.of(NAMES, covariance).root
    assert root @ root.T == pytest.approx(covariance, abs=1e-12) and root[0, 1] == pytest.approx(0, abs=1e-12)
    assert (np.diag(root) >= 0).all()
    if abs(correlation) < 1:
        assert root == pytest.approx(np.linalg.cholesky(covariance))


@pytest.mark.parametrize("correlation", [1.0, -1.0])
def test_perfectly_correlated_sources_are_one(tmp_path, correlation):
    """Their maps add, or cancel, in the prediction, the trials, the tolerances and the intervals alike."""
    trials = trials_of(report(tmp_path, correlation))
    a, b = (trials.values[name] for name in NAMES)
    assert np.abs(a - correlation * b).max() < 1e-12 and a.std() == pytest.approx(0.1, rel=0.05)
    found, linear = budget_of(trials)
    whole = 0.1 * (found[NAMES[0]].height_mm + correlation * found[NAMES[1]].height_mm)
    expected = trials.design.response.left(whole[None])[0] * 1e6
    assert linear.total_nm == pytest.approx(expected, rel=1e-6)
    assert linear.total[NAMES[0]] == linear.total[NAMES[1]] == pytest.approx(1)
    spread = monte_carlo(trials)
    assert np.sqrt(np.mean(spread.rms_nm[:, 0] ** 2)) == pytest.approx(expected[0], rel=0.05)
    quadratic = QuadraticError(trials.design, found, trials.budget.sources, joint=trials.joint)
    assert quadratic.nm() == pytest.approx(1.96 * expected[0], rel=0.01)
    samples = ErrorSamples(trials.design, found, trials.budget.sources, np.ones(len(whole), bool), trials.joint)
    interval = samples.zernikes(np.zeros(len(whole)))[7 if correlation > 0 else 6]
    own = np.sqrt(np.diag(linear.zernike_covariance_nm2))[6 if correlation > 0 else 5]
    assert interval.high == pytest.approx(1.96 * own, rel=0.01)


def test_without_correlation_they_are_as_without_a_calibration(tmp_path):
    _, joint = budget_of(trials_of(report(tmp_path, 0.0)))
    apart = Trials.of(MeasuredDesign.of(Setup(small_scene(31))), Budget(sources=dict.fromkeys(NAMES, 0.1)))
    _, linear = budget_of(apart)
    assert joint.total_nm == pytest.approx(linear.total_nm, rel=1e-9)
    assert joint.zernike_covariance_nm2 == pytest.approx(linear.zernike_covariance_nm2, abs=1e-6)
    assert sum(linear.first[name] for name in NAMES) < joint.first[NAMES[0]] == pytest.approx(1)


def test_what_is_no_calibration_is_one_line(tmp_path):
    cases = [("", "must be a report.json"), ("{}", "must be a report.json"), ("[]", "must be a report.json")]
    for text, told in cases:
        (tmp_path / "no.json").write_text(text)
        with pytest.raises(SceneError, match=told):
            trials_of(str(tmp_path / "no.json"))
    with pytest.raises(SceneError, match="not a readable file"):
        trials_of(str(tmp_path / "none.json"))
    with pytest.raises(SceneError, match="without negative variance"):
        trials_of(report(tmp_path, 1.5))
    with pytest.raises(SceneError, match="unknown source"):
        trials_of(report(tmp_path, 0.5, ("camera.x_mm", "camera.w_mm")))
    with pytest.raises(SceneError, match=r"camera.x_mm'?: must be left out: budget.calibrated") as error:
        trials_of(report(tmp_path, 0.5), sources={"camera.x_mm": 0.1})
    assert "\n" not in str(error.value)
