"""Periods of half response and of Nyquist, aliases, and what is said to be unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import coarse, with_part

from irtscots_cl.measurement.transfer_function import TransferFunction
from irtscots_cl.measurement.transfer_summary import summarise


def summary_of(measure="fine", fringes=None, pixels=21, **options):
    return summarise(TransferFunction.of(coarse("sphere", pixels).nominal(), measure, fringes), **options)


def test_at_the_periods_found_the_response_is_half_and_the_turn_pi():
    found = summary_of(angle_deg=20.0)
    way = 2 * np.pi * np.array([np.cos(np.radians(20)), np.sin(np.radians(20))])
    along = found.directions[2]
    for period, wanted in ((along.nyquist_mm, np.pi), (along.half_mm, None)):
        response = found.transfer.response(found.geometry, way[None] / period)
        if wanted is None:
            assert response.height[0, 0] == pytest.approx(0.5, abs=1e-4)
        else:
            assert np.abs(response.turns).max() == pytest.approx(wanted)


def test_an_alias_has_the_period_of_the_frequency_mirrored_at_nyquist_s():
    pixel = summary_of().geometry.pixel[0, 0, 0]
    found = summary_of(periods_mm=np.array([pixel * 1.5]))
    assert found.response.aliased[0, 0]
    assert found.seen_period_mm[0] == pytest.approx(1 / (1 / pixel - 1 / (1.5 * pixel)), rel=1e-9)
    assert abs(found.seen_angle_deg[0]) == pytest.approx(180.0)
    assert any("alias" in text for text in found.warnings)


def test_extremes_hold_the_place_s_response():
    found = summary_of(place_mm=(200.0, -100.0))
    assert np.hypot(found.geometry.x_mm[0] - 200, found.geometry.y_mm[0] + 100) < 40
    assert (found.lowest <= found.response.height[0]).all() and (found.response.height[0] <= found.highest).all()
    assert found.periods_mm[0] > found.periods_mm[-1] > found.directions[0].nyquist_mm


def test_what_is_not_known_is_said():
    words = {
        "likelihood": ("weighs a pixel's light by its noise", "Zernike terms up to radial order"),
        "refined": ("Zernike terms up to radial order",),
    }
    for measure, texts in words.items():
        said = " ".join(summary_of(measure).warnings)
        assert all(text in said for text in texts)
    assert not summary_of("fine", periods_mm=np.array([400.0])).warnings
    scene = coarse("sphere", 21).nominal()
    wide = with_part(scene, "screen", pixels=(401, 401), pitch_mm=0.05)
    said = summarise(TransferFunction.of(wide, fringes=24.0), ripple_nm=3e4).warnings
    assert any("leaves" in text and "% of the fringes" in text for text in said)
    assert any("moves the fringes by" in text for text in said)


def test_diffraction_is_spoken_of_where_it_counts():
    scene = coarse("sphere", 125).nominal()
    said = summarise(TransferFunction.of(scene, "fine"), np.array([20.0])).warnings
    assert any("at 550 nm it would take 15 % of the shortest wave" in text for text in said)
    sharper = replace(scene, camera=replace(scene.camera, aperture_diameter_mm=1.0))
    assert not summarise(TransferFunction.of(sharper, "fine", None, 550.0), np.array([20.0])).warnings
