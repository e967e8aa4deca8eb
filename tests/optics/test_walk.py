"""Rays that are followed from element to element on the host: beside given sequences, and what they tell of scenes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tracers import setup_of

from irtscots_cl.optics.elements.direct_light import chief_walks, crosses_screen, mirror_points
from irtscots_cl.optics.elements.sequential_rays import GHOST, NOMINAL, trace_sequence
from irtscots_cl.optics.elements.walk import distance_to, walk
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene


def rays_to_mirror(setup):
    points = mirror_points(setup.chief_rays)
    start = setup.chief_rays.screen_frame.position_mm
    ways = points - start
    return np.broadcast_to(start, ways.shape), ways / np.linalg.norm(ways, axis=-1, keepdims=True)


@pytest.mark.parametrize("name", ["sphere", "sphere-window", "off-axis"])
def test_the_order_is_found_and_the_rays_are_those_of_the_sequence(name):
    """Through the window, where there is one, to the mirror, back to the camera's plane."""
    setup = setup_of(load_scene(name))
    starts, ways = rays_to_mirror(setup)
    visits = list(walk(setup.components, starts, ways, 3 if name == "sphere-window" else 1))
    order = [int(visit.numbers[0]) for visit in visits]
    names = [setup.components[number].name for number in order]
    assert names == (["window.back", "window.front"] if name == "sphere-window" else []) + ["mirror"]
    points, goes = trace_sequence(setup.components, [(number, NOMINAL) for number in order], starts, ways)
    for visit, at, after in zip(visits, points, goes, strict=True):
        assert (visit.numbers == visit.numbers[0]).all() and len(visit.rays) == len(ways)
        np.testing.assert_allclose(visit.points, at, atol=1e-9)  # mm, of 4 m
        np.testing.assert_allclose(visit.goes, after, atol=1e-12)


def test_refractors_reflect_where_they_are_told_to():
    setup = setup_of(load_scene("sphere-window"))
    starts, ways = rays_to_mirror(setup)
    (first, second) = list(walk(setup.components, starts, ways, 2, reflects=lambda step, rays: rays % 2 == step))[:2]
    back = int(first.numbers[0])
    _, mirrored = trace_sequence(setup.components, [(back, GHOST)], starts, ways)
    even = first.rays % 2 == 0
    np.testing.assert_allclose(first.goes[even], mirrored[0][even], atol=1e-12)
    assert {setup.components[n].name for n in second.numbers} == {"window.front"}  # the others; those go off


def test_absorbers_end_rays_and_screens_too():
    """A baffle in the whole way; and rays from the camera by way of the mirror end at the screen's plane."""
    scene = load_scene("sphere")
    wall = Element("wall", "absorber", (0.0, 0.0, 2000.0), (0.0, 0.0, 4000.0), size_mm=(2000.0, 2000.0))
    walled = setup_of(replace(scene, element=(wall,)))
    visits = list(walk(walled.components, *rays_to_mirror(walled), 5))
    assert [walled.components[int(visit.numbers[0])].name for visit in visits] == ["wall"]
    assert np.isnan(visits[0].goes).all()
    bare = setup_of(scene)
    (back, _), (forth, parts) = chief_walks(bare.chief_rays, bare.components)
    assert [set(visit.numbers.tolist()) for visit in back] == [{0}]
    assert [parts[int(visit.numbers[0])].name for visit in forth] == ["detector"]


def test_light_ends_at_the_screen_only_against_its_own():
    screen = setup_of(load_scene("sphere")).chief_rays.screen_frame
    crosses, normal = crosses_screen(screen), screen.axes[2]
    at = screen.position_mm - 100.0 * normal
    far = np.array([1e3])
    assert crosses(at[None], normal[None], far).all()
    assert not crosses(at[None], -normal[None], far).any()
    assert not crosses(at[None], normal[None], np.array([50.0])).any()
    assert not crosses(at[None] + 200.0 * normal, -normal[None], far).any()  # its own light


@pytest.mark.parametrize("stands", [False, True])
def test_the_distance_to_a_sphere_is_the_textbooks(stands):
    """From within a bowl to its other side; a ray that stands on it meets only that."""
    scene = load_scene("sphere")
    bowl = setup_of(replace(scene, mirror=replace(scene.mirror, radius_mm=600.0, diameter_mm=1000.0))).components[0]
    centre = np.array([0.0, 0.0, 600.0])
    start = np.array([300.0, 0.0, 600.0 - math.sqrt(600.0**2 - 300.0**2)])
    way = np.array([-750.0, 40.0, 120.0])
    way /= np.linalg.norm(way)
    start = start if stands else start + 20.0 * way
    along = (start - centre) @ way
    expected = -along + math.sqrt(along**2 - (start - centre) @ (start - centre) + 600.0**2)
    found = distance_to(bowl, start[None], way[None], np.array([stands]))
    end = start + expected * way
    assert end[2] < 600.0 and np.hypot(end[0], end[1]) < 500.0  # in the bowl
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    narrow = replace(bowl, outer_mm=0.99 * float(np.hypot(end[0], end[1])))
    assert np.isinf(distance_to(narrow, start[None], way[None], np.array([stands]))).all()
