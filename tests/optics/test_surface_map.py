"""A map on top of a surface: its places, its slopes, and that rays see it."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import coarse, scene_of

from irtscots_cl.maths.zernike.series import radial_series
from irtscots_cl.optics import surface_map
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.departure import ZernikeDeparture
from irtscots_cl.optics.surface import Surface
from irtscots_cl.optics.surface_map import MappedChiefRays, PixelMap, tabulated


@pytest.fixture(scope="module")
def design() -> ChiefRays:
    return ChiefRays(scene_of("lopsided").nominal())


def test_a_pixel_s_value_lies_where_its_chief_ray_meets_the_design(design):
    height = np.random.default_rng(0).standard_normal(design.shape)
    row, column = np.meshgrid(np.arange(5, 55, 7), np.arange(6, 80, 9), indexing="ij")
    points, _, _ = design.reverse(row, column)
    found = PixelMap.of(design, height).height(points[..., 0], points[..., 1])
    np.testing.assert_allclose(found, height[row, column], atol=1e-9)  # the spline goes through its values


def test_slopes_are_those_of_the_heights(design):
    smooth = np.sin(np.arange(61) / 4)[:, None] * np.cos(np.arange(90) / 5)
    extra = PixelMap.of(design, smooth)
    x, y = np.random.default_rng(1).uniform(-80, 80, (2, 50))
    for found, (dx, dy) in zip(extra.gradient(x, y), ((0.01, 0.0), (0.0, 0.01)), strict=True):
        rise = extra.height(x + dx, y + dy) - extra.height(x - dx, y - dy)
        np.testing.assert_allclose(found, rise / 0.02, atol=1e-3 * np.abs(found).max())


def test_beyond_its_values_the_nearest_counts(design):
    height = np.where(np.arange(90) < 40, 2.0, np.nan) * np.ones((61, 1))
    points, _, _ = design.reverse(np.array([30.0]), np.array([70.0]))
    np.testing.assert_allclose(PixelMap.of(design, height).height(points[:, 0], points[:, 1]), 2.0, rtol=1e-12)


def test_rays_land_where_a_mirror_with_the_same_zernikes_sends_them():
    """The deviation once as Zernike terms, once as a map on the design."""
    scene = coarse("sphere-deviated", 61)
    design, deviated = ChiefRays(scene.nominal()), ChiefRays(scene)
    row, column = np.meshgrid(np.arange(61), np.arange(61), indexing="ij")
    points, _, _ = design.reverse(row, column)
    x, y = points[..., 0], points[..., 1]
    height = np.where(np.hypot(x, y) < 540, Surface.of(scene.mirror).deviation_at(x, y)[0], np.nan)
    mapped = MappedChiefRays(scene.nominal(), PixelMap.of(design, height))
    inner = np.hypot(x, y) < 450
    for found, wanted, plain in zip(mapped.reverse(row, column)[1:], deviated.reverse(row, column)[1:],
                                    design.reverse(row, column)[1:], strict=True):  # fmt: skip
        assert np.abs(wanted - plain)[inner].max() > 0.01  # mm
        assert np.abs(found - wanted)[inner].max() < 6e-4  # mm, of 0.1: 0.05 urad, the spline between pixels of 17 mm


def test_a_table_of_a_long_series_is_the_series(monkeypatch):
    """To 1e-4 of the heights and slopes on the mirror, terms of the highest order included; finite beyond it."""
    monkeypatch.setattr(surface_map, "TABLE_TERMS", 3)  # few terms, of the order of the longest series
    monkeypatch.setattr(surface_map, "TABLE_NODES", 600)
    series = radial_series({(28, 0): 1e-6, (28, 28): 1e-6, (27, 5): 1e-6, (4, 2): 1e-6})
    departure = ZernikeDeparture(series, 50.0)
    radius, angle = 50 * np.sqrt(np.random.default_rng(0).random(2000)), np.linspace(0, 300, 2000)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    table = tabulated(departure)
    assert table is not departure and table.radius_mm == 50.0
    for found, expected in zip(table.at(x, y), departure.at(x, y), strict=True):
        assert np.sqrt(np.mean((found - expected) ** 2)) < 1e-3 * np.sqrt(np.mean(expected**2))
    assert np.abs(table.at(np.array([80.0]), np.array([80.0]))[0]).max() < 1e-3


def test_short_series_and_small_detectors_have_no_table(monkeypatch):
    scene = scene_of("lopsided")
    departure = ChiefRays(scene).surface.deviation[0]
    assert tabulated(departure) is departure
    monkeypatch.setattr(surface_map, "TABLE_TERMS", 1)
    assert isinstance(MappedChiefRays(scene).surface.deviation[0], ZernikeDeparture)
    monkeypatch.setattr(surface_map, "TABLE_PIXELS", 10)
    assert not isinstance(MappedChiefRays(scene).surface.deviation[0], ZernikeDeparture)
