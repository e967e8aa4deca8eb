"""What the images of a design cannot know, all of it: errors that each unknown makes, weak directions, what to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.calibration.height_response import HeightResponse
from irtscots_cl.calibration.jacobian import centroid_jacobian
from irtscots_cl.calibration.lookalikes import Lookalike, lookalikes
from irtscots_cl.calibration.measures import Measure, plan, ranked_measures
from irtscots_cl.calibration.observability import (
    NOLLS,
    Direction,
    Observation,
    ZernikeError,
    covariance_of,
    observe,
    weak_directions,
    zernike_errors,
)
from irtscots_cl.calibration.parameters import known_parameters
from irtscots_cl.calibration.priors import Priors, scene_priors
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene


@dataclass(frozen=True)
class Identification:
    """sources: {unknown: rms height error [4] in nm per unit, less LEFT_AFTER}, for an unknown that is off by so much
    while the design is taken for true. posterior: {unknown: standard deviation after the images}. height_nm,
    height_of_noise_nm [4]: rms height uncertainty after the images, and the part of the centroids' noise."""

    observation: Observation
    sources: dict[str, FloatArray]
    posterior: dict[str, float]
    directions: list[Direction] = field(repr=False)
    alike: list[Lookalike] = field(repr=False)
    zernikes: tuple[ZernikeError, ...] = field(repr=False)
    measures: list[Measure] = field(repr=False)
    plan: list[Measure] = field(repr=False)
    height_nm: FloatArray
    height_of_noise_nm: FloatArray


def identify(
    scene: Scene | Setup,
    priors: Priors | None = None,
    noise_mm: float | None = None,
    nolls: Sequence[int] = NOLLS,
    method: str = "southwell",
) -> Identification:
    """What the images of a scene's design say and leave open. Needs no images and no device.

    priors: by default those of scene_priors. noise_mm: standard error of each centroid, by default a hundredth of the
    screen's pitch. nolls: Zernike terms of the mirror, of whole radial orders from 4 on. method: of integrate_slopes.
    Raises ValueError for a design whose screen or mirror the pixels do not see, and for what observe refuses.
    """
    setup = Setup.of(scene).nominal
    priors = priors or scene_priors(setup.scene)
    response = HeightResponse.of(setup, method=method)
    observation = observe(setup, priors, noise_mm, nolls, response)
    names = list(dict.fromkeys((*known_parameters(setup.scene), *priors.names)))
    jacobian = centroid_jacobian(setup, names, response.seen.pixels)
    heights = response.heights_mm(np.moveaxis(jacobian, -1, 0))
    left = response.left(heights) * 1e6
    free = [names.index(name) for name in priors.names]
    p, covariance = observation.count, observation.covariance()
    spread = np.sqrt(np.diag(observation.root @ covariance[:p, :p] @ observation.root.T))
    noise = covariance_of([observation.columns[:, p:]])
    return Identification(
        observation,
        sources=dict(zip(names, left, strict=True)),
        posterior=dict(zip(priors.names, spread.tolist(), strict=True)),
        directions=weak_directions(observation, heights[free]),
        alike=lookalikes(priors.names, jacobian.reshape(-1, len(names))[:, free], heights[free], response),
        zernikes=zernike_errors(observation),
        measures=ranked_measures(observation),
        plan=plan(observation),
        height_nm=observation.rms_nm(covariance[p:, p:]),
        height_of_noise_nm=observation.rms_nm(noise),
    )
