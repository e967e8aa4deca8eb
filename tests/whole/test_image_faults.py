"""Faults of a laboratory's images, put into noisy images one by one: right all the same, named, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from image_faults import FAULTS, Fault
from noisy_images import Images, height_difference_nm, images_of, setup_of

from irtscots_cl.maths.low_order import rms
from irtscots_cl.measurement import error_bars as bars
from irtscots_cl.measurement.quality import OK, check_images
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.measurement.saturation import find_ceiling
from irtscots_cl.measurement.scan_estimates import estimate_centroids

NOISE = 0.002  # of the peak
DRAWS = 100  # of the error bars: they are then known to 7 %
EXACT_NM = 1.5  # what the height may differ by however small its stated error is


def measured(images: Images, scene):
    """Checks, and the height before any refinement, which costs most of the time and changes no noise."""
    stack, setup = images.stack(), setup_of(scene)
    stack = stack.saturating_at(find_ceiling(stack))
    estimates = estimate_centroids(stack, setup, "likelihood")
    checks = {check.name: check for check in check_images(stack, setup, estimates)}
    result = reconstruct(
        stack, setup, light_curve="likelihood", method="cubic", pixel_average=False, estimates=estimates
    )
    return checks, result


@pytest.fixture(scope="module")
def noise_free():
    """Results of the images without noise or fault, by scene."""
    found = {}

    def of(scene):
        if scene not in found:
            found[scene] = measured(images_of(scene), scene)[1]
        return found[scene]

    return of


@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_a_fault_is_mended_named_or_refused(fault: Fault, noise_free, monkeypatch):
    monkeypatch.setattr(bars, "MAX_DRAWS", DRAWS)
    noisy = images_of(fault.scene).noisy(NOISE, seed=1)
    try:
        checks, result = measured(fault.make(noisy, np.random.default_rng(2)), fault.scene)
    except ValueError as error:
        assert fault.refused and fault.refused in str(error)
        return
    failed = {name: check.level for name, check in checks.items() if check.level != OK}
    if fault.refused:
        assert failed.get(fault.refused) == "error", failed
        return
    assert "error" not in failed.values(), failed
    if fault.named:
        assert failed.keys() & set(fault.named), failed
    if fault.right:
        stated = rms(bars.error_bars(result).height_mm, result.height_mask) * 1e6
        assert height_difference_nm(result, noise_free(fault.scene)) < max(1.3 * stated, EXACT_NM)
        assert result.height_mask.sum() > fault.used * result.on_mirror.sum()
    else:
        assert failed  # a height that may be wrong is never told without a word


def test_the_table_is_long_and_its_names_differ():
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 30
    assert all(fault.right or fault.named or fault.refused for fault in FAULTS)
