"""What pixels see of the screen."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup


@pytest.fixture(scope="module")
def design():
    return MeasuredDesign.of(Setup(small_scene()))


def test_shares_of_lines_are_those_of_the_closed_form(design):
    """Of the middle of the mirror: near the rim the closed form counts what the mirror reflects alone."""
    row, column = design.seen.pixels
    inside = np.hypot(design.seen.x_mm[design.seen.mask], design.seen.y_mm[design.seen.mask]) < 400
    chosen = np.flatnonzero(inside)[::97]
    numbers = (row[chosen] * design.setup.scene.camera.detector.pixels[0] + column[chosen]).astype(int)
    light = PixelLight.of(design.setup.chief_rays, numbers)
    screen = design.setup.scene.screen
    for axis, output in enumerate("uv"):
        shares = design.light.shares[axis]
        edges = shares.lines[chosen][:, :1] + np.arange(shares.share.shape[1] + 1) - screen.pixels[axis] / 2
        exact = light.light(output, edges * screen.pitch_xy_mm[axis])
        exact = exact / exact.sum(-1, keepdims=True)
        assert np.abs(shares.share[chosen] - exact).max() < 0.02  # 1024 points: a line's edge cuts their rows
        assert np.abs(shares.share.sum(-1) - 1).max() < 1e-12
        assert shares.lines[shares.share > 0].min() >= 0 and shares.lines[shares.share > 0].max() < screen.pixels[axis]
        assert np.abs(np.sum(shares.share * shares.away_mm, -1)).max() < 1e-12


def test_shares_of_pixels_add_up_to_those_of_lines(design):
    columns, rows = design.setup.scene.screen.pixels
    of_pixels = design.light.of_pixels[::50].toarray().reshape(-1, rows, columns)
    for axis, over in ((0, 1), (1, 2)):
        shares = design.light.shares[axis]
        whole = of_pixels.sum(over)
        for k, n in enumerate(range(0, design.count, 50)):
            lit = np.zeros(columns if axis == 0 else rows)
            lit[np.clip(shares.lines[n], 0, len(lit) - 1)] += shares.share[n]
            assert np.abs(lit - whole[k]).max() < 1e-12


def test_the_covariance_of_a_pixels_places_is_that_of_rays(design):
    """By 4000 random rays of some pixels, binned to the screen's pixels as a light curve is."""
    random, setup = np.random.default_rng(5), design.setup
    row, column = (values[::171] for values in design.seen.pixels)
    found = design.light.covariance_mm2[:, :, ::171]
    count, aperture = 4000, setup.scene.camera.aperture_diameter_mm / 2
    radius, angle = aperture * np.sqrt(random.random(count)), random.random(count) * 2 * np.pi
    offset = random.random((2, count)) - 0.5
    _, u, v = setup.chief_rays.reverse(
        row[:, None] + offset[0], column[:, None] + offset[1], radius * np.cos(angle), radius * np.sin(angle)
    )
    pitch = setup.scene.screen.pitch_xy_mm
    places = np.stack([np.floor(u / pitch[0]) * pitch[0], np.floor(v / pitch[1]) * pitch[1]])
    for k in range(len(row)):
        covariance = np.cov(places[:, k])
        # sigma of a variance of 4000 is 2.2 %; binning with a few lines to a pixel's light adds as much
        assert np.abs(np.diag(covariance) / np.diag(found[..., k]) - 1).max() < 0.12
        assert abs(covariance[0, 1] - found[0, 1, k]) < 0.1 * found[0, 0, k]
