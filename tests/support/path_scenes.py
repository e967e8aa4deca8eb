"""Scenes of plates and walls that tests of the non-sequential estimator share, and the light of their paths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import coarse_screen

from irtscots_cl.tracing.estimators import nonsequential
from irtscots_cl.tracing.trace import trace_paths

PILOT_RAYS = 2**18  # enough to find what is asked for here
RAYS = 2**12  # of each of a coarse screen's pixels
REPLICATES = 32  # all errors come from their scatter

PLATE = "screen > window.back > window.front > mirror > lens > detector"


PLATE_GHOST = PLATE.replace(" > mirror", " (r) > window.back (r) > window.front > mirror")


PLATE_SECOND = PLATE_GHOST.replace(" > mirror", " (r) > window.back (r) > window.front > mirror")


def wide(scene):
    """With an aperture that takes all light of the mirror: nothing is left to chance but the interfaces."""
    return replace(scene, camera=replace(scene.camera, aperture_diameter_mm=20.0))


def plate_mean(of_reflectance, index=1.52, sine=532.0 / 4166.747):
    """Mean of a function of the interface's reflectance over the light that the mirror takes: uniform in the square of
    the sine of its angle to the plate's normal. Unpolarised light: constant to the third power of the angle."""
    squares = (np.arange(1000) + 0.5) / 1000 * sine**2
    cosine_in, cosine_out = np.sqrt(1 - squares), np.sqrt(1 - squares / index**2)
    s = (cosine_in - index * cosine_out) / (cosine_in + index * cosine_out)
    p = (cosine_out - index * cosine_in) / (cosine_out + index * cosine_in)
    return float(np.mean(of_reflectance((s**2 + p**2) / 2)))


def light_of(scene, device, as_it_is=False, **options):
    """A trace with few rays of the scene with a coarse screen, or as it is."""
    scene = scene if as_it_is else coarse_screen(scene)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(nonsequential, "PILOT_RAYS", PILOT_RAYS)
        given = {"rays_per_pixel": RAYS, "replicates": REPLICATES, "seed": 5, "branches": "both", **options}
        return trace_paths(scene, device=device, **given)


def path_of(light, name):
    (path,) = (path for path in light.paths if path.name == name)
    return path
