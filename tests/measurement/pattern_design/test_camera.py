"""The camera of a choice of patterns: from a scene's table, options and usual values."""

from __future__ import annotations

import pytest

from irtscots_cl.measurement.pattern_design.camera import camera_of
from irtscots_cl.scene.detector_noise import DetectorNoise


def test_usual_values_and_options():
    usual = camera_of(None, 1e-9)
    assert (usual.electrons, usual.read_noise_e, usual.shot) == (9000.0, 2.5, True)
    assert usual.step_e == pytest.approx(10000 / 4095)
    own = camera_of(None, 1e-9, full_well_e=20000.0, bits=8, read_noise_e=0.0, frame_s=0.0, exposure_s=0.2)
    assert (own.electrons, own.frame_s, own.exposure_s) == (18000.0, 0.0, 0.2)
    assert own.noise.read == pytest.approx((20000 / 255) ** 2 / 12) and own.noise.gain == 1.0


def test_the_table_and_options_before_it():
    table = DetectorNoise(electrons_at_peak=800.0, read_noise_e=3.0, shot_noise=True, bits=10, gain_e_per_dn=1.5)
    found = camera_of(table, 1e-9)
    assert (found.electrons, found.read_noise_e, found.step_e) == (800.0, 3.0, 1.5)
    found = camera_of(table, 1e-9, electrons=5000.0, read_noise_e=1.0)
    assert (found.electrons, found.read_noise_e) == (5000.0, 1.0)


def test_exposure_of_the_light():
    """550 nm photons of 1e-9 W in 10 ms, half of them counted; dark current adds to the noise."""
    table = DetectorNoise(
        exposure_s=0.01, quantum_efficiency=0.5, wavelength_nm=550.0, shot_noise=True, dark_current_e_per_s=100.0
    )
    found = camera_of(table, 1e-15)
    assert found.electrons == pytest.approx(1e-15 * 0.01 * 0.5 * 550e-9 / (6.62607015e-34 * 299792458))
    assert found.dark_e == 1.0 and found.noise.read == pytest.approx(1.0)
    assert camera_of(table, 1e-15, exposure_s=0.02).electrons == pytest.approx(2 * found.electrons)


def test_refused():
    with pytest.raises(ValueError, match="full well of 100: must be at most"):
        camera_of(None, 1e-9, electrons=200.0, full_well_e=100.0)
    with pytest.raises(ValueError, match="bits = 17: must be from 1 to 16"):
        camera_of(None, 1e-9, bits=17)
    with pytest.raises(ValueError, match="neither read noise nor shot noise"):
        camera_of(DetectorNoise(electrons_at_peak=800.0, offset_dn=1.0), 1e-9)
