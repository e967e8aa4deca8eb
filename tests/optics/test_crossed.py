"""Pixels that edges of an outline cross: their shares on the mirror, in closed form, by cells and by chief rays."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from outlined import OUTLINED, outline_of
from scenes import coarse, with_part

from irtscots_cl.optics.chief_rays import SUBPIXELS, ChiefRays
from irtscots_cl.optics.pixel.crossed import Crossed
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.pixel.ray_map import RayMap
from irtscots_cl.optics.pixel.traced_light import TracedLight

FINE = 48  # points per axis of a pixel: shares to 1 / FINE, and much better where edges are not level


@pytest.fixture(
    scope="module",
    params=[kind if kind == "hexagon" else pytest.param(kind, marks=pytest.mark.slow) for kind in OUTLINED],
)
def chief(request, tmp_path_factory) -> ChiefRays:
    outline = outline_of(request.param, 1064.0, tmp_path_factory.mktemp("outline"))
    scene = coarse("sphere-deviated", 24)  # with fewer, most pixels have a corner nearby
    return ChiefRays(with_part(scene, "mirror", outline=outline, obscuration_mm=180.0))


@cache
def shares(chief: ChiefRays) -> np.ndarray:
    """Share [pixels] of each pixel on the mirror, from many chief rays of the pixel."""
    row, column = np.divmod(np.arange(np.prod(chief.shape)), chief.shape[1])
    step = (np.arange(FINE) + 0.5) / FINE - 0.5
    down, across = (s.ravel() for s in np.meshgrid(step, step, indexing="ij"))
    points = chief.reverse(row[:, None] + down, column[:, None] + across)[0]
    return np.mean(chief.surface.contains(points[..., 0], points[..., 1]), axis=1)


def test_shares_on_the_mirror_are_those_of_many_rays(chief):
    fine = shares(chief)
    off = np.abs(chief.footprint.coverage.ravel() - fine)
    assert off.max() < 1.5 / SUBPIXELS and np.sqrt(np.mean(off**2)) < 0.2 / SUBPIXELS  # most along edges that are level
    pixels = np.flatnonzero(chief.sees_mirror)
    assert (fine[np.setdiff1d(np.arange(len(fine)), pixels)] == 0).all()  # no light is left out
    light = PixelLight.of(chief, pixels)
    closed = light.closed_form
    off = np.abs(light.coverage() - fine[pixels])
    assert off[closed].max() < 1.5 / FINE and off.max() < 0.05
    cut = closed & (fine[pixels] > 0) & (fine[pixels] < 1)
    if chief.surface.outline.has_grid:
        assert not cut.any()
    else:
        assert cut.any() and closed[fine[pixels] == 1].mean() > 0.8  # others: near a corner


def test_cells_of_traced_light_have_the_shares_of_the_closed_form(chief):
    pixels = np.flatnonzero(chief.sees_mirror)
    light = PixelLight.of(chief, pixels)
    traced = TracedLight.of(chief, pixels)
    both = light.closed_form & traced.valid()
    assert np.abs(traced.coverage() - light.coverage())[both].max() < 0.01


def test_every_crossed_pixel_is_cut_by_one_edge_or_unclear(chief):
    fine = shares(chief)
    row, column = np.divmod(np.arange(len(fine)), chief.shape[1])
    crossed = Crossed.of(chief.surface, RayMap.of(chief, row, column))
    cut = np.zeros(len(fine), int)
    for _, _, pixels in crossed.edges:
        cut[pixels] += 1
    assert cut.max(initial=0) <= 1 and not cut[crossed.unclear | crossed.whole].any()
    partly = (fine > 0) & (fine < 1)
    assert (partly <= (cut > 0) | crossed.unclear).all()
    assert (fine[crossed.whole] == 1).all()
