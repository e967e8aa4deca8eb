"""Shares of pixels beside straight edges, and edges found in them."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.measurement.edge_profile import EdgePixels, edge_share, fit_edges


@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 4, 1.2, np.pi / 2])
@pytest.mark.parametrize("blur", [0.0, 0.6])
def test_a_pixels_share_is_the_area_beside_the_edge(turn, blur):
    """Against points of the square, each spread by the lens."""
    step = (np.arange(300) + 0.5) / 300 - 0.5
    row, column = np.meshgrid(step, step, indexing="ij")
    normal = np.array([np.sin(turn), np.cos(turn)])
    from scipy.special import ndtr

    for distance in (-1.5, -0.6, -0.2, 0.0, 0.4, 0.9):
        points = distance + row * normal[0] + column * normal[1]
        expected = np.mean(ndtr(points / blur)) if blur else np.mean(points > 0)
        found = edge_share(np.array([distance]), normal[None], blur)[0]
        assert found == pytest.approx(expected, abs=0.004)  # 1/300 of a pixel, seen along a side


def straight(seed=0, count=4, each=80, noise=0.0, offset=0.3, blur=0.7):
    random = np.random.default_rng(seed)
    piece = np.repeat(np.arange(count), each)
    distance = random.uniform(-4, 4, piece.size)
    turn = random.uniform(0, 2 * np.pi, count)[piece]
    normal = np.stack([np.sin(turn), np.cos(turn)], -1)
    along = random.uniform(-1, 1, piece.size)
    height = 50 + 2 * np.maximum(distance + offset, 0) + 3 * along
    signal = 7 + height * edge_share(distance + offset, normal, blur) + noise * random.standard_normal(piece.size)
    return EdgePixels(signal, piece, distance, along, normal)


def test_an_edge_is_found_with_its_blur():
    found = fit_edges(straight(), 4)
    np.testing.assert_allclose(found.offset, 0.3, atol=2e-3)
    assert found.blur == pytest.approx(0.7, abs=0.01) and found.known.all()
    np.testing.assert_allclose(found.height, 50, rtol=0.02)
    assert found.noise.max() < 0.05


def test_errors_of_edges_are_those_stated():
    """200 pieces: the pulls' scatter is 1 to 5 %, doubled here (failure chance 1e-4 and less)."""
    found = fit_edges(straight(seed=2, count=200, noise=2.0), 200)
    pulls = (found.offset - 0.3) / found.error
    assert 0.85 < pulls.std() < 1.15 and abs(pulls.mean()) < 0.25


def test_pieces_with_few_pixels_are_not_known():
    pixels = straight(count=2)
    keep = (pixels.piece == 0) | (np.arange(pixels.piece.size) % 8 == 0)
    few = EdgePixels(*(v[keep] for v in (pixels.signal, pixels.piece, pixels.distance, pixels.along, pixels.normal)))
    found = fit_edges(few, 3)
    assert found.known.tolist() == [True, False, False] and np.isnan(found.offset[1:]).all()
