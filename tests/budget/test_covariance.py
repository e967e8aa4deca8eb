"""Which sources are alike, and the covariance of the height map by its modes."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_trials

from irtscots_cl.budget.assess import own_sensitivities
from irtscots_cl.budget.covariance import error_modes, map_correlation
from irtscots_cl.budget.linear import error_parts, linear_budget

SOURCES = {
    "camera.x_mm": 0.1, "screen.x_mm": 0.2, "screen.z_mm": 0.05, "camera.z_mm": {"uniform": 0.1},
    "camera.diffraction_nm": 550.0, "noise.place_mm": 2e-3, "mirror.clocking_rad": 1e-3,
}  # fmt: skip


@pytest.fixture(scope="module")
def trials():
    return small_trials(sources=SOURCES, pixels=31)


@pytest.fixture(scope="module")
def found(trials):
    return own_sensitivities(trials)


def test_maps_that_are_alike(trials, found):
    """Both distances make power. Of a step along x the camera and the screen make the same astigmatism with power, the
    other coma: of 10.75 nm each, 12.4 nm are coma together and 17.7 nm astigmatism against each other."""
    names, matrix = map_correlation(trials.design, found)
    assert set(names) == set(SOURCES) - {"noise.place_mm"} and matrix == pytest.approx(matrix.T, abs=1e-14)
    at = {name: k for k, name in enumerate(names)}
    assert matrix[at["screen.z_mm"], at["camera.z_mm"]] == pytest.approx(1, abs=1e-3)
    still = at["mirror.clocking_rad"]  # a sphere turned about its axis: rounding alone
    assert np.diag(np.delete(np.delete(matrix, still, 0), still, 1)) == pytest.approx(1)
    terms = [found[name].zernike_nm[3:] for name in ("camera.x_mm", "screen.x_mm")]
    told = terms[0] @ terms[1] / np.linalg.norm(terms[0]) / np.linalg.norm(terms[1])
    assert matrix[at["camera.x_mm"], at["screen.x_mm"]] == pytest.approx(told, abs=0.05)
    assert -0.5 < told < 0.5


def test_modes_have_the_covariance(trials, found):
    given = trials.budget.sources
    linear = linear_budget(trials.design, found, given)
    modes, share = error_modes(trials.design, error_parts(found, given, trials.joint), 10**6)
    assert share == pytest.approx(1) and len(modes) > 100
    assert np.sqrt(np.sum(modes**2, axis=0)) == pytest.approx(linear.deviation_mm, rel=1e-9)
    size = np.sum(modes**2, axis=1)
    assert np.all(np.diff(size) <= 0)
    apart = modes[:5] @ modes[:5].T - np.diag(size[:5])
    assert np.abs(apart).max() < 1e-10 * size[0]
    few, part = error_modes(trials.design, error_parts(found, given, trials.joint), 2)
    assert np.abs(few) == pytest.approx(np.abs(modes[:2]), abs=1e-12) and part == pytest.approx(
        size[:2].sum() / size.sum()
    )


def test_nothing_that_varies_has_no_modes(trials):
    modes, share = error_modes(trials.design, [], 5)
    assert modes.shape == (0, trials.design.count) and share == 1
