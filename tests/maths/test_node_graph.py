"""The graph of a mask's nodes, least squares over it by both solvers, reuse, removal of low-order terms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nodes import BRIDGE, ISLANDS, disk, islands_of, lines, ring, sheared_grid
from scipy import fft
from scipy.sparse import linalg

from irtscots_cl.maths.integration import node_graph as zonal
from irtscots_cl.maths.low_order import TERMS, remove_terms, rms

MASKS = {
    "full": np.ones((12, 15), bool),
    "disk": disk(31, 40),
    "ring": ring(31),
    "islands": ISLANDS,
    "bridge": BRIDGE,
    "diagonal": np.eye(5, dtype=bool),
    "holes": np.random.default_rng(3).random((40, 40)) < 0.7,
    "off centre": np.pad(disk(9, 13), ((0, 20), (11, 3))),
}


def dense_heights(mask: np.ndarray, graph: zonal.NodeGraph, rises: np.ndarray) -> np.ndarray:
    """Minimum-norm least squares of the written-out pair equations; the null space is the pistons."""
    rows = np.zeros((rises.shape[1], mask.sum()))
    rows[np.arange(len(rows)), graph.pairs[0]] = -1
    rows[np.arange(len(rows)), graph.pairs[1]] = 1
    return np.linalg.lstsq(rows, rises.T)[0].T if len(rows) else np.zeros((len(rises), mask.sum()))


def test_chains_are_the_unbroken_runs_in_order():
    mask = lines("##.##", "#.#..", "#####")
    # numbers by hand: 01.23 / 4.5.. / 6789A
    rows = [[0, 1], [2, 3], [6, 7, 8, 9, 10]]
    columns = [[0, 4, 6], [5, 8]]
    graph = zonal.NodeGraph.from_mask(mask)
    assert [chain.tolist() for chain in graph.chains] == rows + columns
    assert graph.pairs.T.tolist() == [list(pair) for chain in rows + columns for pair in pairwise(chain)]


@pytest.mark.parametrize("name", MASKS)
def test_pairs_and_islands_are_those_of_the_mask(name):
    mask = MASKS[name]
    graph = zonal.NodeGraph.from_mask(mask)
    nodes = np.argwhere(mask)
    step = nodes[graph.pairs[1]] - nodes[graph.pairs[0]]
    assert {tuple(s) for s in step.tolist()} <= {(0, 1), (1, 0)}
    assert len(np.unique(graph.pairs, axis=1).T) == graph.pairs.shape[1]
    assert graph.pairs.shape[1] == (mask[1:] & mask[:-1]).sum() + (mask[:, 1:] & mask[:, :-1]).sum()
    expected = islands_of(mask)
    assert {frozenset(np.flatnonzero(graph.islands == k).tolist()) for k in np.unique(graph.islands)} == expected


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 7), st.integers(1, 7), st.integers(0, 2**32 - 1), st.floats(0.1, 1), st.booleans())
def test_equals_dense_least_squares_on_any_mask(rows, columns, seed, fill, iterate):
    random = np.random.default_rng(seed)
    mask = random.random((rows, columns)) < fill
    mask[random.integers(rows), random.integers(columns)] = True
    graph = zonal.NodeGraph.from_mask(mask)
    rises = random.normal(size=(2, graph.pairs.shape[1]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(zonal, "_DIRECT_NODES", 0 if iterate else 10**9)
        got = graph.heights(rises)
    # 49 nodes, rises of up to 4, smallest eigenvalue about (pi/49)^2 for a snake: 1e-13 x 4 x 250
    assert np.abs(got - dense_heights(mask, graph, rises)).max() < 1e-10


def smooth_and_rough(mask: np.ndarray) -> tuple[zonal.NodeGraph, np.ndarray]:
    """Rises that no heights fit, of two maps: of a smooth surface, with noise on the second."""
    graph = zonal.NodeGraph.from_mask(mask)
    row, column = np.argwhere(mask).T
    height = np.sin(row / 30) + np.cos(column / 20 + row / 50)
    rises = height[graph.pairs[1]] - height[graph.pairs[0]]
    noise = np.random.default_rng(1).normal(size=rises.size) * 0.05
    return graph, np.stack([rises, rises + noise])


@pytest.mark.parametrize("name", MASKS)
def test_both_solvers_agree(name, monkeypatch):
    graph, rises = smooth_and_rough(MASKS[name])
    direct = graph.heights(rises)
    monkeypatch.setattr(zonal, "_DIRECT_NODES", 0)
    solved = []
    monkeypatch.setattr(zonal.NodeGraph, "_solved", lambda *_: solved.append(1))
    assert np.abs(graph.heights(rises) - direct).max() < 1e-12  # heights of 2, RESIDUAL 1e-13
    assert not solved


def test_a_start_near_the_heights_saves_steps_and_a_larger_residual_too(monkeypatch):
    graph, rises = smooth_and_rough(MASKS["ring"])
    direct = graph.heights(rises)
    monkeypatch.setattr(zonal, "_DIRECT_NODES", 0)
    steps: list[int] = []
    monkeypatch.setattr(zonal, "_between_steps", lambda _: steps.append(1))

    def taken(**how) -> int:
        steps.clear()
        assert np.abs(graph.heights(rises, **how) - direct).max() < 1e-3  # of heights of 2
        return len(steps)

    whole = taken()
    near = direct + 1e-6 * np.random.default_rng(0).normal(size=direct.shape)
    assert taken(residual=1e-5) < 0.6 * whole
    assert taken(start=near) < 0.7 * whole


def test_what_iteration_cannot_solve_in_time_is_factored(monkeypatch):
    graph, rises = smooth_and_rough(MASKS["holes"])
    direct = graph.heights(rises)
    monkeypatch.setattr(zonal, "_DIRECT_NODES", 0)
    monkeypatch.setattr(zonal, "_STEPS", 3)
    assert np.array_equal(graph.heights(rises), direct)


@pytest.mark.parametrize("name", ["disk", "ring", "dead pixels"])
@pytest.mark.parametrize("size", [80, 320])
def test_iteration_takes_few_steps_on_mirrors_of_any_size(name, size, monkeypatch):
    mask = ring(size) if name == "ring" else disk(size, size)
    if name == "dead pixels":
        mask &= np.random.default_rng(0).random(mask.shape) > 0.01
    graph, rises = smooth_and_rough(mask)
    steps = []
    real = fft.dctn
    monkeypatch.setattr(fft, "dctn", lambda *a, **k: steps.append(1) or real(*a, **k))
    monkeypatch.setattr(zonal, "_DIRECT_NODES", 0)
    graph.heights(rises[:1])
    assert 5 < len(steps) <= 45  # 30 at most were seen; unconditioned, some five times the nodes across


def test_every_island_has_mean_zero():
    graph, rises = smooth_and_rough(ISLANDS)
    heights = graph.heights(rises)
    for island in np.unique(graph.islands):
        assert np.abs(heights[:, graph.islands == island].mean(axis=1)).max() < 1e-15  # an ulp of heights of 1
    assert np.ptp(heights) > 0.01


def test_the_factorisation_is_reused(monkeypatch):
    zonal._cached_graph.cache_clear()
    calls = []
    real = linalg.splu
    monkeypatch.setattr(linalg, "splu", lambda *a, **k: calls.append(1) or real(*a, **k))
    mask = disk(12, 15)
    for seed in range(3):
        graph = zonal.node_graph(mask.copy())
        graph.heights(np.random.default_rng(seed).normal(size=(4, graph.pairs.shape[1])))
    assert len(calls) == 1
    other = mask.copy()
    other[6, 7] = False
    for changed in (other, mask.reshape(15, 12)):  # the second has the same bytes
        graph = zonal.node_graph(changed)
        graph.heights(np.zeros((1, graph.pairs.shape[1])))
    assert len(calls) == 3
    zonal._cached_graph.cache_clear()


def test_the_graph_does_not_see_later_changes_of_the_mask():
    mask = np.ones((6, 6), bool)
    graph = zonal.NodeGraph.from_mask(mask)
    mask[:] = False
    assert graph.mask.all()
    for array in (graph.mask, graph.islands, graph.pairs, graph.chains[0]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_remove_terms_takes_out_what_its_name_says_and_no_more():
    x, y = sheared_grid(21, 24)
    x, y, mask = x + 500.0, y - 80.0, disk(21, 24)
    shapes = [np.full_like(x, 3.0), 0.02 * x - 0.01 * y, 1e-3 * (x * x + y * y)]
    astigmatism = x * y * 1e-3
    for k, terms in enumerate(TERMS):
        got = remove_terms(x, y, sum(shapes[:k], astigmatism), mask, terms)
        plain = remove_terms(x, y, astigmatism, mask, terms)
        assert np.array_equal(np.isnan(got), ~mask)
        assert np.nanmax(np.abs(got - plain)) < 1e-12  # sums of up to 300, off-centre by ten radii
        if k < 3:
            more = remove_terms(x, y, sum(shapes[: k + 1], astigmatism), mask, terms)
            assert rms(more - plain, mask) > 0.1  # the next term stays
    assert np.array_equal(remove_terms(x, y, x, mask, "none")[mask], x[mask])


def test_remove_terms_is_a_projection_over_the_finite_samples():
    x, y = sheared_grid(21, 24)
    mask = disk(21, 24)
    z = np.random.default_rng(2).normal(size=mask.shape)
    z[10, 10] = np.nan
    used = mask & np.isfinite(z)
    got = remove_terms(x, y, z, mask, "piston_tilt_power")
    assert np.array_equal(np.isfinite(got), used)
    for column in (np.ones_like(x), x, y, x * x + y * y):
        assert abs(np.sum(got[used] * column[used])) < 1e-10  # 400 samples of up to 5000, rounding
    assert np.isnan(z[10, 10]) and np.isfinite(z[0, 0])  # the input is left alone


def test_remove_terms_does_not_care_where_the_origin_is():
    x, y = sheared_grid(21, 24)
    mask = disk(21, 24)
    z = np.random.default_rng(2).normal(size=mask.shape)
    near = remove_terms(x, y, z, mask, "piston_tilt_power")
    far = remove_terms(x + 1e6, y - 2e6, z, mask, "piston_tilt_power")
    assert np.nanmax(np.abs(far - near)) < 1e-10  # the shifted positions round at 2e-10 of 50 mm


def test_rms_is_about_zero_and_inside_the_mask():
    z = np.array([[3.0, 4.0, 100.0, np.nan]])
    mask = np.array([[True, True, False, True]])
    assert rms(z, mask) == pytest.approx(np.sqrt(12.5), rel=1e-15)  # one rounding


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda x, m: remove_terms(x, x, x, m, "tilt"), "'tilt'; allowed: none, piston, piston_tilt, "),
        (lambda x, m: remove_terms(x, x, x[:2], m, "piston"), "^z has shape"),
        (lambda x, m: remove_terms(x[:2], x, x, m, "piston"), "^x_mm has shape"),
        (lambda x, m: remove_terms(x, x[:2], x, m, "piston"), "^y_mm has shape"),
        (lambda x, m: remove_terms(x, x / 0, x, m, "piston"), "^y_mm is not finite at 9 of 9"),
        (lambda x, m: remove_terms(x, x, x * np.nan, m, "piston"), "1 terms cannot be fitted to 0"),
        (lambda x, m: remove_terms(x, x, x, ~m, "none"), "^mask is empty"),
        (lambda x, m: rms(x * np.nan, m), "no finite sample"),
        (lambda x, m: rms(x[:2], m), "^z has shape"),
        (lambda x, m: rms(x, m * 1), "^mask must be boolean"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero:RuntimeWarning")
def test_helpers_refuse_bad_input(call, words):
    with pytest.raises(ValueError, match=words):
        call(np.ones((3, 3)), np.ones((3, 3), bool))
