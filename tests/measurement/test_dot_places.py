"""Dots found in images, their places with error bars, and the map between them."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.measurement.dot_places import LEAST_DOTS, DotPlaces, find_dots, image_noise, interpolated

SIZE, SCALE = 60, 0.1  # pixels; mm on the screen for each
NOISE = 0.02


def design():
    """Places [rows, columns] of the design: a turned and sheared grid."""
    row, column = np.mgrid[:SIZE, :SIZE]
    return SCALE * (column - 0.1 * row), SCALE * (row + 0.05 * column)


def seen(u, v, centres, noise=NOISE, seed=1):
    """Shares of pixels that see (u, v): a disk of 0.3 mm, softly edged."""
    share = np.zeros(u.shape)
    for cx in centres[0]:
        for cy in centres[1]:
            share += 1 / (1 + np.exp((np.hypot(u - cx, v - cy) - 0.3) / 0.03))
    return share + noise * np.random.default_rng(seed).standard_normal(u.shape)


CENTRES = np.arange(0.5, 6.0, 1.5), np.arange(1.0, 6.5, 1.5)
MASK = np.hypot(*(np.mgrid[:SIZE, :SIZE] - SIZE / 2)) < 26


def test_noise_of_an_image():
    random = np.random.default_rng(1)
    smooth = np.sin(np.linspace(0, 3, SIZE))[:, None] * np.ones(SIZE)
    assert image_noise(smooth + 0.02 * random.standard_normal((SIZE, SIZE)), MASK) == pytest.approx(0.02, rel=0.1)


def test_places_have_no_bias_and_the_stated_errors():
    """A mirror that sends light 0.04 mm further: pulls of 40 images have a mean of 0 and a width of 1.

    About 300 dots: limits of 4 standard errors, and 0.25 on the width for the pixels that a window cuts differently.
    """
    u, v = design()
    pulls = []
    for seed in range(40):
        shift = np.random.default_rng(seed).uniform(-0.05, 0.05, 2)
        dots, _ = find_dots(seen(u + 0.04 + shift[0], v - 0.02 + shift[1], CENTRES, seed=seed), MASK, CENTRES, (u, v))
        pulls += [
            (dots.u_mm - dots.design_u_mm - 0.04 - shift[0]) / dots.u_error_mm,
            (dots.v_mm - dots.design_v_mm + 0.02 - shift[1]) / dots.v_error_mm,
        ]
    pull = np.concatenate(pulls)
    assert len(pull) > 300
    assert abs(pull.mean()) < 4 / np.sqrt(len(pull)) and pull.std() == pytest.approx(1.0, abs=0.25)


def test_dots_at_the_edge_are_left_out_and_those_far_from_the_grid_too():
    u, v = design()
    dots, count = find_dots(seen(u, v, CENTRES), MASK, CENTRES, (u, v))
    assert 3 <= len(dots) < count
    inside = np.hypot(dots.row - SIZE / 2, dots.column - SIZE / 2)
    assert inside.max() < 26 - 3  # a dot has a radius of 3 pixels
    few, _ = find_dots(seen(u, v, CENTRES), MASK, (CENTRES[0][:2], CENTRES[1]), (u, v))
    assert len(few) < len(dots)
    none, count = find_dots(NOISE * np.random.default_rng(2).standard_normal(u.shape), MASK, CENTRES, (u, v))
    assert (len(none), count) == (0, 0)


def test_the_map_s_error_is_seen_by_leaving_dots_out_and_grows_with_the_distance():
    u, v = design()
    row = np.mgrid[:SIZE, :SIZE][0]
    parts = []
    for k in range(4):
        centres = CENTRES[0] + 0.75 * (k % 2), CENTRES[1] + 0.75 * (k // 2)
        bent = 1e-4 * (row - 30.0) ** 2  # mm
        parts.append(find_dots(seen(u + bent, v, centres, 1e-4, k), MASK, centres, (u, v))[0])
    found = interpolated(DotPlaces.joined(parts), (u, v))
    inside = np.isfinite(found.u_mm)
    assert 0.3 < inside[MASK].mean() < 1
    error = (found.u_mm - u - bent)[inside]
    assert np.sqrt(np.mean(error**2)) < 2 * np.sqrt(np.mean(found.u_error_mm[inside] ** 2))
    assert found.tested_mm[0] > 3 * found.tested_mm[1]  # u is bent, v is not
    far = found.distance_px > np.nanmedian(found.distance_px)
    assert found.u_error_mm[inside & far].mean() > found.u_error_mm[inside & ~far].mean()
    assert np.nanmax(found.distance_px) < 8


def test_too_few_dots_are_no_map():
    u, v = design()
    few = DotPlaces(*np.ones((9, LEAST_DOTS - 1)))
    with pytest.raises(ValueError, match="5 found whole and matched; a map needs at least 6"):
        interpolated(few, (u, v))
    on_line = DotPlaces(np.arange(9.0), np.arange(9.0), *np.ones((7, 9)))
    with pytest.raises(ValueError, match="lie on one line"):
        interpolated(on_line, (u, v))
