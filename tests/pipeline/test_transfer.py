"""Measured maps for the correction of their spectra: on the pixels' own grid, or on a map's."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from irtscots_cl.formats.height_map import MapOptions
from irtscots_cl.pipeline.transfer import read_measured_map


def written(path, stretch: float = 0.0):
    """A result of 12 x 10 pixels, 2 mm along columns and 3 along rows, the grid turned by 10 degrees."""
    row, column = np.mgrid[:12, :10]
    along, across = 2.0 * column * (1 + stretch * column), 3.0 * row
    turn = np.radians(10.0)
    with h5py.File(path, "w") as file:
        file["mirror/x_mm"] = along * np.cos(turn) - across * np.sin(turn)
        file["mirror/y_mm"] = along * np.sin(turn) + across * np.cos(turn)
        file["deviation_nm"] = np.where(row + column > 2, 1.0 * row, np.nan)
        file["height_standard_error_nm"] = np.full(row.shape, 2.0)
        file["slope/x_standard_error_rad"] = np.full(row.shape, 3e-7)
    return path


def test_a_result_is_taken_on_its_own_grid(tmp_path):
    found, warnings = read_measured_map(written(tmp_path / "result.h5"), MapOptions())
    assert found.own_grid and not warnings
    turn = np.radians(10.0)
    assert found.column_mm == pytest.approx((2 * np.cos(turn), 2 * np.sin(turn)))
    assert found.row_mm == pytest.approx((-3 * np.sin(turn), 3 * np.cos(turn)))
    assert found.height_error_mm == pytest.approx(2e-6)
    assert found.slope_errors[0] == pytest.approx(3e-7) and np.isnan(found.slope_errors[1])
    assert np.nanmax(found.heights_mm) == pytest.approx(11e-6)


def test_uneven_pixels_are_warned_of(tmp_path):
    _, warnings = read_measured_map(written(tmp_path / "result.h5", 0.02), MapOptions())
    assert "of the pixels' distances differ" in warnings[0]


def test_a_map_without_a_scale_is_refused(tmp_path):
    path = tmp_path / "map.npy"
    np.save(path, np.random.default_rng(1).normal(size=(8, 8)))
    with pytest.raises(ValueError, match="give --pitch-mm"):
        read_measured_map(path, MapOptions(unit="nm", kind="surface"))
    found, warnings = read_measured_map(path, MapOptions(unit="nm", kind="surface", pitch_mm=(2.0, 2.0)))
    assert found.column_mm == (2.0, 0.0) and any("change of its grid" in text for text in warnings)


def test_a_result_of_few_pixels_is_refused(tmp_path):
    path = tmp_path / "result.h5"
    with h5py.File(path, "w") as file:
        for name in ("mirror/x_mm", "mirror/y_mm", "deviation_nm"):
            file[name] = np.full((3, 3), np.nan)
    with pytest.raises(ValueError, match="too few valid pixels for a spectrum"):
        read_measured_map(path, MapOptions())
