"""The closed form of a pixel's light: the chord of Eq. 2, its integrals, pixels whole and cut, against many rays."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.pixellight import chord_cdf

A, D = 0.5, 0.2  # the paper's aperture radius and line width [mm]


def test_chord_cdf_is_the_share_of_a_disk_left_of_a_line():
    """Paper Eq. 2: F(u) = u sqrt(a^2 - u^2) + a^2 asin(u / a), against the disk's area strip by strip."""
    edges = np.linspace(-1, 1, 200_001)
    middle = (edges[1:] + edges[:-1]) / 2
    area = np.concatenate([[0.0], np.cumsum(2 * np.sqrt(1 - middle**2) * (edges[1] - edges[0]))]) / np.pi
    np.testing.assert_allclose(
        chord_cdf(edges),
        area,
        atol=1e-7,  # strips at the ends: the 3/2 power of their width
    )
    np.testing.assert_array_equal(chord_cdf(np.array([-7.0, -1.0, 1.0, 7.0])), [0, 0, 1, 1])
    assert chord_cdf(np.array(0.0)) == 0.5


@pytest.mark.parametrize("offset", [0.0, 0.03, 0.1, -0.077])
def test_all_lines_together_let_through_the_whole_aperture(offset):
    lines = (np.arange(21) - 10) * D
    share = chord_cdf((lines - offset + D / 2) / A) - chord_cdf((lines - offset - D / 2) / A)
    assert share.sum() == pytest.approx(1, abs=1e-14)  # rounding
    assert (share >= 0).all()


def test_the_light_curve_s_full_base_width_is_1_2_mm():
    line = np.array([-0.6001, -0.5999, 0.5999, 0.6001])
    share = chord_cdf((line + D / 2) / A) - chord_cdf((line - D / 2) / A)
    np.testing.assert_array_equal(share > 0, [False, True, True, False])
