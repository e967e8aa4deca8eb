"""The ledger of a trial: maps that add up."""

from __future__ import annotations

import random

import numpy as np
import pytest
from small_budget import SOURCES, small_trials

from irtscots_cl.budget.ledger import ledger


@pytest.fixture(scope="module")
def trials():
    return small_trials()


@pytest.fixture(scope="module")
def whole(trials):
    return ledger(trials, 3)


def test_the_maps_add_up_to_the_whole_error(trials, whole):
    everything = trials.design.heights_mm(trials.changes_mm(3))
    assert np.abs(whole.total_mm - everything).max() < 1e-12  # mm
    assert np.abs(sum(row.height_mm for row in whole.rows) - everything).max() < 1e-12
    assert {row.name for row in whole.rows} == set(SOURCES)


def test_the_order_changes_a_row_by_no_more_than_its_second_order_part(trials, whole):
    own = {row.name: row for row in whole.rows}
    for seed in range(3):
        names = list(SOURCES)
        random.Random(seed).shuffle(names)
        for row in ledger(trials, 3, names).rows:
            change = row.height_mm - own[row.name].height_mm
            assert np.abs(change).max() <= own[row.name].second_order_mm, row.name
            left = trials.design.response.left(change[None])[0, 0] * 1e6
            assert left <= own[row.name].second_order_nm, row.name


def test_second_order_parts_are_small_and_not_idle(whole):
    parts = {row.name: row.second_order_mm for row in whole.rows}
    assert max(parts.values()) < 1e-3 * np.abs(whole.total_mm).max()
    assert all(part > 0 for part in parts.values())


def test_camera_and_screen_moved_together_add_and_against_each_other_cancel(trials):
    together, apart = (
        trials.design.heights_mm(trials.changes_mm(0, {"camera.x_mm": 0.1, "screen.x_mm": sign * 0.1}))
        for sign in (1, -1)
    )
    left = trials.design.response.left(np.stack([together, apart])) * 1e6
    astigmatism = np.sqrt(left[:, 1] ** 2 - left[:, 2] ** 2)
    assert astigmatism[1] == pytest.approx(2 * 8.8, rel=0.03) and astigmatism[0] < 0.15  # nm: of each 8.8 of 10.75
    assert left[0, 2] == pytest.approx(2 * 6.2, rel=0.03) and left[1, 2] < 0.1  # and 6.2, nearly all coma


def test_a_ledger_without_sources_is_empty():
    nothing = ledger(small_trials(sources={}), 0)
    assert nothing.rows == () and not nothing.total_mm.any()
