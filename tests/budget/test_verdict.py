"""Requirements as on a drawing."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_trials

from irtscots_cl.budget.intervals import ErrorSamples
from irtscots_cl.budget.sensitivity import sensitivities
from irtscots_cl.budget.verdict import MET, NOT_MET, OPEN, judge, requirements
from irtscots_cl.maths.zernike.polynomials import zernike


@pytest.fixture(scope="module")
def samples():
    trials = small_trials()
    found = {one.source.name: one for one in sensitivities(trials.design, trials.sources)}
    return ErrorSamples(trials.design, found, trials.budget.sources, np.ones(trials.design.count, bool))


def height(samples, **um):
    seen, radius = samples.design.seen, samples.design.setup.chief_rays.surface.aperture_radius_mm
    x, y = seen.x_mm[seen.mask] / radius, seen.y_mm[seen.mask] / radius
    return sum(value * 1e-3 * zernike(int(name[1:]), x, y) for name, value in um.items())


@pytest.mark.parametrize(
    "text, limits",
    [
        ("3/2(0.5/0.2)", {"A": 2, "B": 0.5, "C": 0.2}),
        ("3/-(1)", {"B": 1}),
        ("3/4", {"A": 4}),
        ("3/-(-/0.1) RMSi<0.05 RMSa<0.04", {"C": 0.1, "RMSi": 0.05, "RMSa": 0.04}),
        ("RMSt<0.1", {"RMSt": 0.1}),
    ],
)
def test_indications(text, limits):
    assert requirements(text, 600.0) == {name: pytest.approx(300 * value) for name, value in limits.items()}


@pytest.mark.parametrize(
    "text",
    ["", "4/1", "3/", "RMSx<1", "RMSt>1", "3/0", "3/-(-)", "3/..", "RMSt<1.2.3", "RMSt<1 RMSt<2", "3/1 3/-(2) 3/3"],
)
def test_what_is_no_indication(text):
    with pytest.raises(ValueError, match="must"):
        requirements(text)


def test_figures_are_those_of_the_terms(samples):
    """Peak to valley of one um of power 2 sqrt(3), of astigmatism 2 sqrt(6); of spherical aberration 1.5 sqrt(5)."""
    none = ErrorSamples(samples.design, {}, {}, samples.used)
    limits = dict.fromkeys("ABC", 1.0) | {"RMSt": 1.0, "RMSi": 1.0, "RMSa": 1.0}
    found = {j.name: j.interval.estimate for j in judge(none, height(none, z4=1.0), limits)}
    assert found["A"] == pytest.approx(2000 * 3**0.5, rel=1e-3) and found["B"] < 1e-6 and found["RMSi"] < 1e-6
    found = {j.name: j.interval.estimate for j in judge(none, height(none, z6=1.0), limits)}
    assert found["B"] == pytest.approx(2000 * 6**0.5, rel=1e-2) and found["C"] < 1e-6
    assert found["RMSa"] == pytest.approx(1000, rel=0.02)
    found = {j.name: j.interval.estimate for j in judge(none, height(none, z11=1.0), limits)}
    assert (
        found["C"] == pytest.approx(1500 * 5**0.5, rel=2e-2) and found["RMSa"] < 5
    )  # the pixels' disk is no whole one


def test_a_guard_band_leaves_some_undecided(samples):
    measured = height(samples, z6=0.3)
    (rms,) = judge(samples, measured, {"RMSt": 300.0})
    assert rms.verdict == OPEN and rms.interval.low < 300 < rms.interval.high
    assert judge(samples, measured, {"RMSt": 600.0})[0].verdict == MET
    assert judge(samples, measured, {"RMSt": 100.0})[0].verdict == NOT_MET
