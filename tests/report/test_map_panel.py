"""What maps say in their titles, and how small maps are magnified."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.report.map_panel import magnified, signed_limit, statistics_text, three, with_prefix


def test_three_digits_with_their_zeros():
    told = {1234.5: "1234", 99.96: "100", 3.0: "3.00", 0.3: "0.300", -0.004567: "-0.00457", 0.0: "0", 1e-9: "1.00e-09"}
    assert {value: three(value) for value in told} == told


def test_statistics_are_of_the_known_values():
    values = np.array([[3.0, -3.0], [np.nan, 3.0]])
    assert statistics_text(values, "nm") == "rms 3.00 nm, PV 6.00 nm"
    assert statistics_text(values + 100, "mm", signed=False) == "rms 2.83 mm, PV 6.00 mm"  # about the mean
    assert statistics_text(values * np.nan, "nm") == "no values"


def test_fluxes_read_from_one_to_a_thousand():
    assert with_prefix(1.09e-6, "W") == (pytest.approx(1e6), "µW")
    assert with_prefix(1.9e-11, "W") == (pytest.approx(1e12), "pW")
    assert with_prefix(3000.0, "DN") == (1.0, "DN") and with_prefix(0.0, "W") == (1.0, "W")


def test_small_maps_are_magnified_by_powers_of_ten_within_the_scale():
    wave = np.sin(np.arange(1000.0))  # rms 0.71
    limit = signed_limit([wave * 10])
    assert [magnified(wave * size, limit) for size in (10, 1, 0.1, 0.002)] == [1, 1, 10, 1000]
    assert magnified(wave * 0, limit) == 1 and magnified(wave * np.nan, limit) == 1
    assert signed_limit([wave * 0, wave * np.nan]) == 1.0
