"""A whole calibration: the unknowns that are fitted, the mirror terms beside them, and what came of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field

from irtscots_cl.calibration.bundle_adjustment import Adjustment, Problem, adjust
from irtscots_cl.calibration.consequences import HeightEffects, Wide, candidates, height_effects, widened
from irtscots_cl.calibration.judgement import GAIN, judge, verdict
from irtscots_cl.calibration.known import GROUPS, Prior, distances_of, priors_of
from irtscots_cl.calibration.measured import Measurement, base_name
from irtscots_cl.calibration.parameters import moved, zernike_names, zernike_noll
from irtscots_cl.measurement.quality import Check
from irtscots_cl.scene.calibration_known import Calibration, Knowledge, distance_ends
from irtscots_cl.scene.model import Scene

FITTED = (*GROUPS["camera"], *GROUPS["screen"])  # by default
FIRST_ORDER, LAST_ORDER = 4, 8  # radial orders of the mirror terms that are fitted beside them, as needed
MAX_ORDER = 20


@dataclass(frozen=True)
class Calibrated:
    """A calibration. scene: the fitted geometry, its mirror the design's. order: radial order of the mirror terms."""

    scene: Scene
    fit: Adjustment = field(repr=False)
    wide: Wide = field(repr=False)
    effects: HeightEffects = field(repr=False)
    priors: dict[str, Prior] = field(repr=False)
    checks: list[Check]
    order: int

    @property
    def verdict(self) -> str:
        """One line in plain words."""
        return verdict(self.checks)


@dataclass(frozen=True)
class Unknowns:
    """What is fitted, and what is known of it beforehand.

    names: of the geometry. mirror_order: radial order up to which Zernike terms of the mirror are fitted, too; 0: none,
    None: FIRST_ORDER, and more where the residuals ask for it, up to LAST_ORDER; no terms where every measurement is of
    a known mirror. hold: names that are not fitted. default_priors: whether unknowns without a prior of the scene get a
    default. source: the scene's file, for messages.
    """

    names: tuple[str, ...] = FITTED
    mirror_order: int | None = None
    hold: tuple[str, ...] = ()
    default_priors: bool = True
    source: str = "scene"

    def up_to(self, order: int) -> tuple[str, ...]:
        """All names that are fitted, with mirror terms up to a radial order."""
        every = dict.fromkeys((*self.names, *mirror_terms(order)))
        return tuple(name for name in every if name not in self.hold)


def calibrate(measurements: Sequence[Measurement], scene: Scene, unknowns: Unknowns | None = None) -> Calibrated:
    """Fit the geometry of a scene to measurements, and say what that means.

    Heights are those of the first measurement whose mirror is not known, or of the first. Raises ValueError for unknown
    names, for unknowns that nothing determines, and for measurements that contradict each other.
    """
    fit, wide, priors, order = fit_geometry(measurements, scene, unknowns)
    effects = height_effects(wide)
    return Calibrated(fitted_geometry(scene, fit), fit, wide, effects, priors, judge(fit, wide, effects), order)


def fit_geometry(
    measurements: Sequence[Measurement], scene: Scene, unknowns: Unknowns | None = None
) -> tuple[Adjustment, Wide, dict[str, Prior], int]:
    """The fit alone, its further derivatives, the priors, and the radial order of the mirror terms."""
    unknowns = unknowns or Unknowns()
    measurements = sorted(measurements, key=lambda m: m.knows_mirror)  # stable: the mirror under test comes first
    wanted = unknowns.mirror_order
    grows = wanted is None and not all(m.knows_mirror for m in measurements)
    order = FIRST_ORDER if grows else (wanted or 0)
    while True:
        names = unknowns.up_to(order)
        own = {name for m in measurements for name in m.own} - set(names)
        priors = priors_of([*names, *own], scene, defaults=unknowns.default_priors, source=unknowns.source)
        fit = adjust(Problem.of(measurements, names, priors, distances_of(scene)))
        wide = widened(fit, [*candidates(fit), *_next_terms(fit, order)])
        if not grows or order >= LAST_ORDER or not _asks_for_terms(wide):
            return fit, wide, priors, order
        order += 2


def mirror_terms(order: int) -> tuple[str, ...]:
    """Names of the Zernike terms of the mirror up to a radial order, without piston and tilt."""
    return zernike_names(range(4, (order + 1) * (order + 2) // 2 + 1))


def _next_terms(fit: Adjustment, order: int) -> list[str]:
    """Mirror terms of the next two radial orders that are not looked at anyway."""
    there = {*fit.names, *candidates(fit)}
    return [name for name in mirror_terms(order + 2) if order and name not in there]


def _asks_for_terms(wide: Wide) -> bool:
    """Whether a further mirror term explains more of what is left than any other unknown would."""
    name, gain = max(wide.gains().items(), key=lambda item: item[1])
    return gain > GAIN and zernike_noll(name) is not None


def fitted_geometry(scene: Scene, fit: Adjustment) -> Scene:
    """The scene with the fitted geometry, its mirror the design's; what is known is the fit's standard deviations."""
    changes = {
        name: value
        for name, value in zip(fit.names, fit.values.tolist(), strict=True)
        if name == base_name(name) and zernike_noll(name) is None
    }
    errors = dict(zip(fit.names, fit.errors.tolist(), strict=True))
    known = {name: Knowledge(sigma=errors[name], source="irtscots calibrate") for name in changes}
    own = scene.calibration.known if scene.calibration is not None else {}
    known |= {name: knowledge for name, knowledge in own.items() if name not in known and not distance_ends(name)}
    for distance in distances_of(scene):
        known[distance.name] = Knowledge(sigma=distance.sigma, mm=distance.mm, source=distance.source)
    fitted = moved(scene.nominal(), changes)
    return dataclasses.replace(fitted, calibration=Calibration(known=known))
