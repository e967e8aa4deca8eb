"""Traces that follow both branches at interfaces: closed forms, the same light as by chance, and bookkeeping.

FAILURE_CHANCE, of the whole file, is split among its statistical statements.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from path_scenes import (
    PLATE,
    PLATE_GHOST,
    PLATE_SECOND,
    REPLICATES,
    light_of,
    path_of,
    plate_mean,
    wide,
)
from scenes import coarse_screen
from scipy import stats
from significance import sidak_z
from tracers import path_tracer_of

from irtscots_cl.execution.launch_plan import RateMeter
from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.estimators import nonsequential
from irtscots_cl.tracing.options import NONSEQUENTIAL, TraceOptions
from irtscots_cl.tracing.results.paths import NOT_TRACED

FAILURE_CHANCE = 1e-6
STATEMENTS = 32  # at most
T = float(stats.t.isf(stats.norm.sf(sidak_z(STATEMENTS, FAILURE_CHANCE)), REPLICATES - 1))  # of each: 7.3
SINGLET = "screen > mirror > lens.front > lens.back > detector"
SINGLET_GHOST = "screen > mirror > lens.front > lens.back (r) > lens.front (r) > lens.back > detector"


@cache
def singlet(device, branches, seed):
    return light_of(load_scene("sphere-singlet"), device, rays_per_pixel=2**14, seed=seed, branches=branches)


def assert_closed(light):
    """Every ray that was launched or parted ended somewhere, and so did their light: nothing was lost."""
    assert light.ends["failed"] == 0
    ended = sum(count for end, count in light.ends.items() if end not in ("launched", "parted"))
    assert ended == light.ends["launched"] + light.ends["parted"]
    assert light.ends["parted"] > 0


@pytest.mark.second_device
def test_a_plate_and_its_ghosts(device):
    """(1 - R)^2, (1 - R)^2 R^2 and (1 - R)^2 R^4 of the light without the plate, which the same rays bring."""
    light = light_of(wide(load_scene("sphere-window")), device)
    bare = light_of(wide(load_scene("sphere")), device)
    bare_w = bare.paths[0].flux_w
    rim = 2e-4  # of the flux: the plate moves rays by 0.05 mm of 1064, some off the mirror and as many onto it
    for name, expected in (
        (PLATE, plate_mean(lambda r: (1 - r) ** 2)),
        (PLATE_GHOST, plate_mean(lambda r: (1 - r) ** 2 * r**2)),
        (PLATE_SECOND, plate_mean(lambda r: (1 - r) ** 2 * r**4)),
    ):
        path = path_of(light, name)
        # between rays of the same numbers lies the plate alone: the bare flux has no noise of its own here
        assert abs(path.flux_w / bare_w - expected) < T * path.standard_error_w / bare_w + rim * expected, name
    assert_closed(light)
    passed_w = sum(path.flux_w for path in light.paths)
    assert passed_w / bare_w == pytest.approx(plate_mean(lambda r: (1 - r) / (1 + r)), rel=1e-3, abs=0)


@pytest.mark.slow
def test_both_branches_bring_the_light_that_chance_brings(device):
    first, second = singlet(device, "both", 5), singlet(device, "random", 6)
    for name in (SINGLET, SINGLET_GHOST):
        one, other = path_of(first, name), path_of(second, name)
        assert abs(one.flux_w - other.flux_w) < T * math.hypot(one.standard_error_w, other.standard_error_w), name
    assert second.ends["parted"] == 0
    assert_closed(first)


def test_of_the_same_rays_both_branches_tell_more(device):
    """The error bar of the direct light and of the ghost: of as many rays, and all of them weigh alike."""
    both, chance = singlet(device, "both", 5), singlet(device, "random", 6)
    lower, upper = stats.f.isf([1 - 1e-8, 1e-8], REPLICATES - 1, REPLICATES - 1)
    assert lower > 1 / 12
    # by chance a ghost's ray is drawn with 0.1 twice, and one of a hundred remains
    of_ghost = [path_of(light, SINGLET_GHOST).standard_error_w for light in (both, chance)]
    assert (of_ghost[0] / of_ghost[1]) ** 2 < 1 / 20 * upper and of_ghost[0] < of_ghost[1]
    of_direct = [path_of(light, SINGLET).standard_error_w for light in (both, chance)]
    assert (of_direct[0] / of_direct[1]) ** 2 < upper


def test_the_same_seed_gives_the_same_bits_for_any_cut_into_launches(device, monkeypatch):
    def run():
        return light_of(load_scene("sphere-singlet"), device, replicates=2, rays_per_pixel=3000)

    first, again = run(), run()
    monkeypatch.setattr(nonsequential.PathTask, "max_rays_per_item", 768)
    monkeypatch.setattr(RateMeter, "launch_rays", lambda self, first: 100_000)
    cut = run()
    for light in (again, cut):
        np.testing.assert_array_equal(light.images_w, first.images_w)
        assert light.paths == first.paths and light.ends == first.ends and light.losses == first.losses


def test_how_many_rays_go_side_by_side_changes_no_path(device, monkeypatch):
    """Rays that part are numbered by their path, not by their place in a list; rounding may move a ray in 10,000."""
    runs = []
    for width in (1, 8, 16) if device.kind == "cpu" else (1,):
        monkeypatch.setattr(type(device), "vector_width", lambda self, precision, width=width: width)
        runs.append(light_of(load_scene("sphere-singlet"), device, replicates=2, seed=9))
    for run in runs[1:]:
        for end, count in runs[0].ends.items():
            assert abs(run.ends[end] - count) <= 1e-4 * runs[0].ends["launched"] * (end != "launched"), end
        for name in (SINGLET, SINGLET_GHOST):
            assert path_of(run, name).rays == pytest.approx(path_of(runs[0], name).rays, rel=1e-3, abs=3), name


@pytest.mark.parametrize("limit", [4, 5, 6, 7])
def test_the_ledger_closes_at_any_bounce_limit(device, limit):
    """Rays that part at the limit are given up like those that they part from; shorter paths stay as they are."""
    light = light_of(load_scene("sphere-singlet"), device, bounce_limit=limit, rays_per_pixel=2048)
    assert_closed(light)
    assert light.ends["bounce limit"] > 0
    whole = light_of(load_scene("sphere-singlet"), device, rays_per_pixel=2048)
    assert light.paths[0] == path_of(whole, SINGLET)
    assert (SINGLET_GHOST in {path.name for path in light.paths}) == (limit >= 6)  # so many events
    chance = light_of(load_scene("sphere-singlet"), device, bounce_limit=limit, rays_per_pixel=2048, seed=6,
                      branches="random")  # fmt: skip
    one, other = (found.losses[-1] for found in (light, chance))
    assert one.name == other.name == "bounce limit"
    assert abs(one.flux_w - other.flux_w) < T * math.hypot(one.standard_error_w, other.standard_error_w)
    assert one.flux_w > 0


def test_rays_that_part_at_the_limit_are_given_up_there(device):
    """All meet the window first, and leave two rays each that go no further."""
    scene = coarse_screen(load_scene("sphere-window"))
    tracer = path_tracer_of(scene, device, TraceOptions(NONSEQUENTIAL, seed=7, bounce_limit=1, branches="split"))
    sums, _ = run_rays(tracer, np.array([256]))
    ends = tracer.task.light.ends(sums, 256 * tracer.sources)
    assert ends["bounce limit"] == 2 * ends["launched"] == 2 * ends["parted"]


def half_mirrors(count, reflectance=0.5):
    """The sphere behind plates in front of the screen, all faces of which part the light in halves."""
    scene = coarse_screen(wide(load_scene("sphere")))
    at = np.array(scene.screen.position_mm)
    z = -at / np.linalg.norm(at)
    faces = []
    for k in range(2 * count):
        cursor = at + (10 + 4 * (2 * count - k)) * z
        front, back = (1.0, 1.5) if k % 2 == 0 else (1.5, 1.0)
        faces.append(
            Element(f"face.{k}", "refractor", tuple(cursor.tolist()), tuple((cursor + z).tolist()), diameter_mm=60.0,
                    index_front=front, index_back=back, reflectance=reflectance)
        )  # fmt: skip
    return replace(scene, element=tuple(faces))


@pytest.mark.slow
def test_no_ray_is_lost_where_very_many_part(device):
    """A ray has up to a hundred branches: where the list of those that wait fills, one is followed by chance.

    All faces part in halves, so chance changes no weight, and all light is found again, in steps of 2^-20 of a ray.
    """
    scene, rays = half_mirrors(5), np.array([256])
    tracer = path_tracer_of(scene, device, TraceOptions(NONSEQUENTIAL, seed=7, branches="split"))
    sums, _ = run_rays(tracer, rays)
    ends = tracer.task.light.ends(sums, int(rays.sum()) * tracer.sources)
    assert ends["parted"] > 5 * ends["launched"]
    assert ends["failed"] == 0
    (other,) = tracer.task.light.fluxes(sums, rays)
    losses = tracer.task.light.losses(sums, rays)
    staying_w = sum(stay.flux_w for stay in losses if stay.name != NOT_TRACED)
    # rays of several cones have weights of their own, whose sum scatters by a percent with so few rays
    assert other.flux_w + staying_w == pytest.approx(tracer.task.traced_w, rel=0.02, abs=0)
