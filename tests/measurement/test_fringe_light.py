"""The phases that the design's light makes, against its images under single lines."""

from __future__ import annotations

import numpy as np
import pytest

import irtscots_cl as irt
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.measurement.fringe_light import light_phases
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.optics.setup import Setup


@pytest.mark.needs_device
@pytest.mark.parametrize("levels", [0, 15])
def test_phases_and_modulation_are_those_of_the_light_under_single_lines(levels):
    """To 1e-5 rad: light curves line by line times what each line shows, summed by hand; the sphere itself."""
    scene = irt.load_scene("sphere")
    setup, fringes = Setup(scene), FringeSet.equal("x", (0.9, 2.46), 4)
    u_mm = design_points(setup)[2]
    found = light_phases(setup, fringes, u_mm, levels)
    scan = irt.trace(scene, estimator="analytic").images(irt.LineScan(scene)).x
    place = (np.arange(21) + 0.5) / 21
    centre = u_mm.ravel()[scan.pixels] / 4.2 + 0.5
    inner = setup.chief_rays.footprint.coverage.ravel()[scan.pixels] > 0.5
    for k, periods in enumerate(fringes.periods):
        shown = 0.5 + 0.5 * np.cos(2 * np.pi * periods * place - np.arange(4)[:, None] * np.pi / 2)
        shown = np.rint(shown * levels) / levels if levels else shown
        samples = (scan.mean_w()[:, :, None] * shown.T[scan.lines]).sum(1).T
        phase = np.arctan2(samples[1] - samples[3], samples[0] - samples[2])
        difference = found.difference_rad[k].ravel()[scan.pixels]
        gap = np.angle(np.exp(1j * (phase - 2 * np.pi * periods * centre - difference)))[inner]
        assert np.abs(gap).max() < 1e-5
        if not levels:
            lit = samples[:, inner]
            share = np.hypot(lit[1] - lit[3], lit[0] - lit[2]) / lit.mean(0) / 2
            np.testing.assert_allclose(found.modulation[k].ravel()[scan.pixels][inner], share, rtol=1e-5)
