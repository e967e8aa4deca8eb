"""What the checks of single frames say."""

from __future__ import annotations

import numpy as np
from fringe_stacks import disk, fringe_stack

from irtscots_cl.measurement.fringe_factors import frame_factors
from irtscots_cl.measurement.fringe_frame_checks import check_brightness
from irtscots_cl.measurement.quality import WARNING


def test_brightness_that_differs_but_is_not_divided_out_is_said():
    uneven = np.random.default_rng(50).normal(1, 0.03, 16)
    found = frame_factors(fringe_stack(seen=0.2, gains=uneven), disk())
    check = check_brightness(found, [4, 4, 4, 4], str)
    assert check.level == WARNING and "differ in brightness" in check.text and "not divided out" in check.text
