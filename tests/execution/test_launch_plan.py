"""How rays are cut into launches: every one once, from any place on, of about the wanted size."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from counting_job import PER_ITEM, RAYS, SOURCES
from hypothesis import given, settings
from hypothesis import strategies as st

from irtscots_cl.execution.launch_plan import (
    LAUNCH_SECONDS,
    Cursor,
    RateMeter,
    RayBlock,
    cut_block,
    plan_launches,
    share_rays,
)


@settings(max_examples=300, deadline=None)
@given(
    st.integers(1, 40),
    st.integers(1, 200),
    st.integers(1, 30),
    st.lists(st.integers(1, 10_000), min_size=1, max_size=20),
)
def test_launches_cover_every_ray_of_every_stream_once(sources, rays, per_item, sizes):
    wanted = iter(sizes * 10_000)  # the timed size may change from launch to launch
    covered = np.zeros((sources, rays), int)
    for first_source, count, first_ray, ray_count in plan_launches(sources, rays, lambda: next(wanted), per_item):
        assert count >= 1 and ray_count >= 1
        assert first_source + count <= sources and first_ray + ray_count <= rays
        covered[first_source : first_source + count, first_ray : first_ray + ray_count] += 1
    assert (covered == 1).all()


def test_launches_are_of_about_the_wanted_size():
    plan = list(plan_launches(10_000, 2**20, lambda: 2**24))
    sizes = [count * rays for _, count, _, rays in plan]
    assert sum(sizes) == 10_000 * 2**20 and max(sizes) <= 2**24
    assert np.median(sizes) > 2**23


def plan_from(cursor, rays, launch_rays):
    """(part, place after it) of what is left of a replicate."""
    for part in plan_launches(SOURCES, rays, lambda: launch_rays, PER_ITEM, cursor):
        cursor = cursor.after(part, SOURCES, rays)
        yield part, cursor


@pytest.mark.parametrize("rays", [1, 4, 5, 13, 16])
@pytest.mark.parametrize("sizes", list(itertools.product([1, 3, 13, 40, 1000], repeat=2)))
def test_a_plan_goes_on_from_any_launch_with_launches_of_another_size(rays, sizes):
    first = list(plan_from(Cursor(), rays, sizes[0]))
    assert first[-1][1] == Cursor(1)
    for stop in range(len(first)):
        cursor = first[stop - 1][1] if stop else Cursor()
        parts = [part for part, _ in first[:stop]] + [part for part, _ in plan_from(cursor, rays, sizes[1])]
        traced = np.zeros((SOURCES, rays), int)
        for source, sources, ray, count in parts:
            assert ray % PER_ITEM == 0
            traced[source : source + sources, ray : ray + count] += 1
        assert (traced == 1).all()
        done = sum(sources * count for _, sources, _, count in parts[:stop])
        assert cursor.rays_before(np.array([rays]), SOURCES) == done
        cursor.check(np.array([rays]), SOURCES, PER_ITEM)


@pytest.mark.parametrize(
    "cursor",
    [(-1, 0, 0, 0), (4, 0, 0, 0), (3, 4, 0, 0), (0, 3, 0, 0), (0, -4, 0, 0), (0, 16, 0, 0), (0, 0, 4, 0), (0, 0, 4, 5),
     (0, 0, 4, -1), (0, 0, 0, 1), (0, 0, 3, 1), (0, 12, 4, 1), (0, 0, -4, 1), (0.0, 0, 0, 0), (True, 0, 0, 0),
     (2, 12, 0, 0), (10**30, 0, 0, 0), (0, 10**30, 0, 0), ("0", 0, 0, 0), (None, 0, 0, 0), (3, 0, 1, 1)],
)  # fmt: skip
def test_places_that_no_plan_passes_are_refused(cursor):
    with pytest.raises(ValueError, match="place"):
        Cursor(*cursor).check(RAYS, SOURCES, PER_ITEM)


@pytest.mark.parametrize("cursor", [(0, 0, 0, 0), (0, 12, 1, 4), (1, 8, 4, 1), (0, 4, 9, 2), (3, 0, 0, 0)])
def test_places_that_a_plan_passes_are_not(cursor):
    Cursor(*cursor).check(RAYS, SOURCES, PER_ITEM)


def test_rays_are_shared_as_equally_as_whole_numbers_allow():
    assert share_rays(11, 4).tolist() == [3, 3, 3, 2]
    assert share_rays(4, 4).tolist() == [1, 1, 1, 1]
    for rays, replicates in ((3, 4), (2**40 + 1, 4)):
        with pytest.raises(ValueError, match=f"rays_per_pixel = {rays}: must be at least the 4 replicates"):
            share_rays(rays, replicates)
    for replicates in (0, 1025):
        with pytest.raises(ValueError, match=f"replicates = {replicates}: must be 1 to 1024"):
            share_rays(2**20, replicates)


@pytest.mark.parametrize("part", [(0, 5, 0, 16), (2, 3, 8, 7), (4, 1, 12, 1)])
@pytest.mark.parametrize("launch_rays", [1, 6, 13, 1000])
def test_a_part_is_cut_into_launches_that_cover_it_once(part, launch_rays):
    first_source, sources, first_ray, rays = part
    traced = np.zeros((10, 40), int)
    for source, count, ray, per_source in cut_block(RayBlock(*part), lambda: launch_rays, PER_ITEM):
        assert ray % PER_ITEM == 0
        traced[source : source + count, ray : ray + per_source] += 1
    wanted = np.zeros_like(traced)
    wanted[first_source : first_source + sources, first_ray : first_ray + rays] = 1
    np.testing.assert_array_equal(traced, wanted)


def test_the_next_launch_takes_as_long_as_is_aimed_at():
    meter = RateMeter()
    assert meter.launch_rays(77) == 77  # nothing timed yet
    meter.launched(10**9, 4.0)
    assert meter.launch_rays(77) == pytest.approx(0.25e9 * LAUNCH_SECONDS, rel=1e-8)  # a whole number
    meter.launched(0, 1.0)  # no rays say nothing about the rate
    assert meter.rays_per_second == 0.25e9
    meter.launched(10, 0.0)  # a clock that does not tick: no division by zero
    assert meter.rays_per_second == 1e7
    assert meter.kernel_seconds == 5.0
