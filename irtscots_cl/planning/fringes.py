"""Whether a set of fringes can be shown, seen and told apart on a scene's screen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from irtscots_cl.measurement.pattern_design.camera import camera_of
from irtscots_cl.measurement.pattern_design.fringe_errors import Fringes, phase_errors
from irtscots_cl.measurement.pattern_design.orders import wrong_orders
from irtscots_cl.measurement.pattern_design.pixels import seen_pixels
from irtscots_cl.measurement.pattern_design.safe_periods import SAFE
from irtscots_cl.optics.pixel.light import whole_flux_w
from irtscots_cl.optics.setup import Setup
from irtscots_cl.planning.finding import Finding

LEAST_PIXELS = 4.0  # of the screen to a period: fewer are no sinusoid
LEAST_MODULATION = 0.2  # what the light of one pixel leaves of the fringes


def check_fringes(setup: Setup, periods: Sequence[float], steps: int = 4) -> list[Finding]:
    """Findings about fringes of these numbers of periods over the screen, of `steps` steps, along x and y.

    Raises ValueError where no pixel sees the screen.
    """
    finest, screen = max(periods), setup.scene.screen
    if min(screen.pixels) / finest < LEAST_PIXELS:
        fine = min(screen.pixels) / finest
        text = f"{finest:g} periods over {min(screen.pixels)} screen pixels: {fine:.2g} pixels a period, at least "
        text += f"{LEAST_PIXELS:.0f} make a sinusoid: at most {min(screen.pixels) / LEAST_PIXELS:g} periods"
        return [Finding("fringes-too-fine", "error" if fine < 2 else "warning", text)]
    seen = seen_pixels(setup)
    left = min(abs(float(np.median(seen.least_modulation_at(axis, finest)))) for axis in (0, 1))
    if left < LEAST_MODULATION:
        text = f"{finest:g} periods: the light of one camera pixel covers so much of a period that {left:.0%} of the "
        text += f"modulation is left; about {seen.most_periods:.3g} periods are the most"
        return [Finding("fringes-blurred", "warning", text)]
    table = setup.scene.camera.detector.noise
    camera = camera_of(table, seen.white_share * whole_flux_w(setup.chief_rays))
    fringes = Fringes("", tuple(sorted(periods)), steps)
    wrong = np.zeros(len(seen.bright))
    for axis in (0, 1):
        errors = phase_errors(seen, camera, axis, fringes, fringes.frames)
        wrong = np.maximum(wrong, wrong_orders(fringes.periods, errors, seen.fraction(axis)))
    if float(wrong.max()) <= SAFE:
        return []
    share = float(np.mean(wrong > SAFE))
    text = (
        f"periods {', '.join(f'{p:g}' for p in sorted(periods))} leave the fringe's order open in {share:.0%} of the "
    )
    text += f"pixels (probability of a wrong one up to {wrong.max():.1g}): add a series of 0.9 periods, or take "
    text += "`irtscots design-patterns`"
    return [Finding("fringes-ambiguous", "error" if share > 0.5 else "warning", text)]
