"""How many periods are safe, against a search by brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from designed import CAMERA, wide_sphere

from irtscots_cl.measurement.pattern_design.choice import design_patterns
from irtscots_cl.measurement.pattern_design.families import BEATS, GEOMETRIC, periods_of
from irtscots_cl.measurement.pattern_design.fringe_errors import Fringes, phase_errors
from irtscots_cl.measurement.pattern_design.safe_periods import highest_safe, too_dark
from irtscots_cl.measurement.unwrapping import unwrap

DIM = replace(CAMERA, electrons=60.0)


@pytest.fixture(scope="module")
def found():
    return design_patterns(wide_sphere(), frames=16, camera=DIM)


def failures(found, fringes, frames, pixels, draws=8_000):
    """Share of wrong orders of a simulated measurement of these pixels, x and y."""
    random, wrong = np.random.default_rng(5), []
    for axis in range(2):
        p, place = np.array(fringes.periods)[:, None], np.tile(found.seen.fraction(axis)[pixels], draws)
        errors = np.tile(phase_errors(found.seen, DIM, axis, fringes, frames)[:, pixels], draws)
        phase = np.angle(np.exp(1j * (2 * np.pi * p * place + errors * random.standard_normal(errors.shape))))
        wrong.append(np.abs(unwrap(phase, errors, fringes.periods).fraction - place) * p[-1] > 0.5)
    return float(np.mean(wrong))


def test_highest_by_counted_failures(found):
    """A limit that failures can be counted at: half a percent, in the dimmest pixels but a hundredth of all. Found by
    counting at many numbers of periods; 240 failures at the limit leave 1 % of periods."""
    kind, limit = Fringes(GEOMETRIC, (0.9, 0.9), 4), 0.005
    safe = highest_safe(found.seen, DIM, kind, 16, found.heights, limit)
    assert safe.found and safe.why == "ambiguity"
    count = len(found.seen.bright)
    dim = np.argsort(found.seen.bright)[round(0.01 * count) + np.arange(-1, 2)]
    tops = np.linspace(0.85, 1.15, 9) * safe.highest
    shares = np.array([
        failures(found, replace(kind, periods=periods_of(GEOMETRIC, 2, float(top))), 16, dim) for top in tops
    ])  # fmt: skip
    counted = np.interp(limit, shares, tops)
    assert shares[0] < limit < shares[-1]
    assert safe.highest == pytest.approx(counted, rel=0.04)


def test_less_probable_errors_allow_fewer_periods(found):
    kind = Fringes(GEOMETRIC, (0.9, 0.9), 4)
    highest = [highest_safe(found.seen, DIM, kind, 16, found.heights, limit).highest for limit in (1e-2, 1e-4, 1e-6)]
    assert highest[0] > highest[1] > highest[2]


def test_highest_by_modulation(found):
    """Four series and much light: the fringes vanish before their orders do."""
    kind = Fringes(GEOMETRIC, (0.9,) * 4, 4)
    bright = replace(CAMERA, electrons=1e6)
    safe = highest_safe(found.seen, bright, kind, 320, found.heights)
    assert safe.why == "modulation"
    dark = [
        max(np.mean(too_dark(found.seen, bright, k, (safe.highest * f,))) for k in range(2)) for f in (0.98, 1.0, 1.05)
    ]
    assert dark[0] <= dark[1] <= 0.01 < dark[2]
    # by brute force: the first of many numbers of periods at which a hundredth of the pixels has no modulation left
    noise = np.sqrt(bright.noise.variance(bright.electrons * found.seen.bright / 2))
    amplitude = bright.electrons * found.seen.bright / 2 * np.where(found.seen.inverted, -1, 1) * found.seen.modulation
    gone = [(np.minimum.accumulate(amplitude[k]) < noise).mean(1) > 0.01 for k in range(2)]
    first = found.seen.periods[min(np.argmax(g) if g.any() else len(g) - 1 for g in gone)]
    assert safe.highest < first < 1.1 * safe.highest  # the table's next step


def test_periods_of_the_families():
    assert periods_of(GEOMETRIC, 3, 22.5) == (0.9, 4.5, 22.5)
    assert periods_of(BEATS, 3, 22.5) == (0.9, 18.0, 22.5)
    assert periods_of(BEATS, 4, 57.6) == (0.9, 43.2, 54.0, 57.6)  # beats of 3.6 and 14.4
    assert periods_of(GEOMETRIC, 1, 0.9) == (0.9,)


def test_nothing_is_safe_in_the_dark(found):
    kind = Fringes(GEOMETRIC, (0.9, 0.9), 4)
    assert not highest_safe(found.seen, replace(CAMERA, electrons=2.0), kind, 16, found.heights).found
