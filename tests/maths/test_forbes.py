"""Forbes's polynomials against a peer, and the properties that define them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from irtscots_cl.maths.forbes import sum_q_bfs, sum_q_con

U = np.linspace(0.0, 1.0, 41)
ROUNDING = 4e-14  # of sums whose terms reach C(m + 4, 4) = 7315 for Qcon


@pytest.mark.parametrize("m", range(19))
def test_single_terms_are_a_peers(m):
    peer = pytest.importorskip("prysm.polynomials.qpoly")
    bfs = np.array([x * (1 - x) * sum_q_bfs({m: 1.0}, x) for x in U**2])
    con = np.array([x * x * sum_q_con({m: 1.0}, x) for x in U**2])
    np.testing.assert_allclose(bfs, peer.Qbfs(m, U), atol=ROUNDING)
    np.testing.assert_allclose(con, peer.Qcon(m, U), atol=ROUNDING)


def test_sums_add_terms():
    terms = {0: 0.3, 2: -1.5, 7: 0.25}
    for total in (sum_q_con, sum_q_bfs):
        for x in (0.0, 0.3, 1.0):
            assert total(terms, x) == pytest.approx(math.fsum(c * total({m: 1.0}, x) for m, c in terms.items()))
            assert total({}, x) == 0


def test_qcon_is_one_at_the_rim():
    assert [sum_q_con({m: 1.0}, 1.0) for m in range(19)] == pytest.approx([1.0] * 19)


def test_slopes_of_qbfs_terms_are_orthonormal():
    """The mean over the angle t, u = sin(t), of the product of two terms' slopes by u is 1 or 0 (Forbes 2007)."""
    u, step = np.sin((np.arange(200) + 0.5) * (np.pi / 400)), 1e-5

    def height(m, at):
        return np.array([x * (1 - x) * sum_q_bfs({m: 1.0}, x) for x in (at * at).tolist()])

    slopes = [(height(m, u + step) - height(m, u - step)) / (2 * step) for m in range(6)]
    products = np.array([[np.mean(a * b) for b in slopes] for a in slopes])
    np.testing.assert_allclose(products, np.eye(6), atol=1e-6)  # central differences
