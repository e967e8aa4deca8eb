"""Products with long rows against NumPy's own, and their independence of BLAS's threads."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from irtscots_cl.maths.row_products import dots_of_rows, dual_rows, sums_of_rows, without_rows

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def rows():
    return np.random.default_rng(1).normal(size=(7, 1000))


def test_products_are_those_of_matrices(rows):
    values = np.random.default_rng(2).normal(size=(3, 5, 1000))
    dots = dots_of_rows(values, rows)
    np.testing.assert_allclose(dots, values @ rows.T, rtol=0, atol=1e-11)  # 1000 products of about 1
    np.testing.assert_allclose(sums_of_rows(dots, rows), dots @ rows, rtol=0, atol=1e-11)
    assert dots_of_rows(values, rows[:0]).shape == (3, 5, 0)


def test_the_dual_basis_is_the_pseudoinverse_also_of_rows_that_are_nearly_alike(rows):
    np.testing.assert_allclose(dual_rows(rows), np.linalg.pinv(rows.T), rtol=0, atol=1e-15)  # of 4e-3 at most
    alike = rows[0] + 1e-6 * rows  # condition 1e6
    dual = dual_rows(alike)
    np.testing.assert_allclose(dots_of_rows(alike, dual), np.eye(7), rtol=0, atol=1e-8)  # rounding times 1e6


def test_what_lies_along_orthonormal_rows_is_taken_out(rows):
    own = np.ascontiguousarray(np.linalg.qr(rows.T)[0].T)
    rest = without_rows(rows[2] + 3.0, own)
    np.testing.assert_allclose(rest, without_rows(np.full(1000, 3.0), own), rtol=0, atol=1e-13)
    assert np.abs(dots_of_rows(rest, own)).max() < 1e-12


TRIALS = """
import hashlib
from small_budget import SOURCES, small_trials
from irtscots_cl.budget.monte_carlo import monte_carlo
told = {"compensators": ("screen.z_mm",), "mirror_turns": 3}
found = monte_carlo(small_trials(16, SOURCES | {"air.turbulence_nm": 10.0}, pixels=101, **told))
for array in (found.rms_nm, found.zernike_nm, found.mean_mm, found.deviation_mm):
    print(hashlib.sha256(array.tobytes()).hexdigest())
"""


@pytest.mark.slow
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="BLAS has one thread")
def test_trials_have_the_same_bits_with_any_number_of_threads_of_blas():
    path = os.pathsep.join(map(str, (ROOT, ROOT / "tests" / "support")))
    one, two = (
        subprocess.run([sys.executable, "-c", TRIALS], capture_output=True, text=True, check=True, timeout=300,
                       env=os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": threads}).stdout
        for threads in "12"
    )  # fmt: skip
    assert len(one.split()) == 4 and one == two
