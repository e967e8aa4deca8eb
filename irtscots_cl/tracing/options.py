"""How to trace a scene: the choices that a user has, checked."""

from __future__ import annotations

from dataclasses import dataclass, fields

from irtscots_cl.opencl.structs import MAX_EVENTS, PRECISIONS
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.option_error import OptionError
from irtscots_cl.tracing.samplers import SAMPLERS

ESTIMATORS = ("forward", "adjoint")  # that trace rays on a device
AIMS = ("mirror", "camera")  # of the forward estimator
ANALYTIC = "analytic"  # the one that does not
NONSEQUENTIAL = "nonsequential"  # from element to element in any order, by path
BRANCHES = ("random", "split")  # of a ray at an interface: one of them, chosen at random, or both
POLARISATION = ("auto", "on", "off")  # of the non-sequential estimator's rays
EARLIER_BRANCHES = {"roulette": "random", "both": "split"}  # names that go on working
EXTRA_EVENTS = 4  # that a ghost may have beside those of the direct light: two reflections between neighbours, twice
MIN_CHANCE = 0.1  # of either branch at an interface
MAX_SMOOTHED_RAYS = 2**32  # per pixel and replicate: a sum of so many 32-bit amounts stays below 2^63


@dataclass(frozen=True)
class TraceOptions:
    """How to trace. Refuses what is out of range with an OptionError, a ValueError of one line.

    estimator: "forward", "adjoint", "analytic" or "nonsequential". sampler: a name of samplers.SAMPLERS. precision:
    "fp32" or "fp64". seed: 64 bits. aim: forward only, "mirror" or "camera". overfill: forward and nonsequential, solid
    angle of the cone that rays leave in over the least one that covers what it is aimed at. smoothing: adjoint only,
    every ray stands for its whole chord through the camera's aperture (kernels/entry/trace_lines.cl); a central hole
    must be wider than the aperture's blur on the mirror, or its rim is told only roughly.

    Of the non-sequential estimator alone: bounce_limit: events after which a ray is given up (and counted), 1 to
    MAX_EVENTS; None: as many as the direct light meets elements, and EXTRA_EVENTS, but at least 10.
    least_chance: probability with which a ray is reflected or refracted at an interface, however small that share of
    its light is; its weight makes up for it. branches: "random" follows one of them, "split" both, as long as the
    weaker one weighs a thousandth of a ray and there is room for more rays. aimed_scatter: scattered rays are also
    aimed at the camera (components.targets_of); without, only what finds it at random counts. polarisation: whether
    rays carry their linear polarisation from interface to interface, "on" or "off"; "auto": where it changes the
    direct light by more than 1e-4 (optics/elements/polarisation.py).
    """

    estimator: str = "adjoint"
    sampler: str = "philox"
    precision: str = "fp32"
    seed: int = 1
    aim: str = "mirror"
    overfill: float = 1.0
    smoothing: bool = False
    bounce_limit: int | None = None
    least_chance: float = MIN_CHANCE
    branches: str = "random"
    aimed_scatter: bool = True
    polarisation: str = "auto"

    def __post_init__(self) -> None:
        object.__setattr__(self, "branches", EARLIER_BRANCHES.get(self.branches, self.branches))
        for option, value, allowed in (
            ("estimator", self.estimator, (*ESTIMATORS, ANALYTIC, NONSEQUENTIAL)),
            ("sampler", self.sampler, SAMPLERS),
            ("precision", self.precision, tuple(PRECISIONS)),
            ("aim", self.aim, AIMS),
            ("branches", self.branches, BRANCHES),
            ("polarisation", self.polarisation, POLARISATION),
        ):
            if value not in allowed:
                raise OptionError(f"--{option} = {value!r}: must be one of {', '.join(allowed)}")
        if not 0 <= self.seed < 2**64:
            raise OptionError(f"--seed = {self.seed}: must be 0 to 2^64 - 1")
        if not 1.0 <= self.overfill <= 1e4:
            raise OptionError(f"--overfill = {self.overfill}: must be 1 to 10000")
        if self.aim != "mirror" and self.estimator != "forward":
            raise OptionError(f"--aim {self.aim}: must go with --estimator forward, not {self.estimator}")
        if self.overfill != 1.0 and self.estimator in ("adjoint", ANALYTIC):
            raise OptionError(f"--overfill = {self.overfill}: must go with --estimator forward, not {self.estimator}")
        if self.smoothing and self.estimator != "adjoint":
            raise OptionError(f"--smoothing: must go with --estimator adjoint, not {self.estimator}")
        if self.bounce_limit is not None and not 1 <= self.bounce_limit <= MAX_EVENTS:
            raise OptionError(f"--bounce-limit = {self.bounce_limit}: must be 1 to {MAX_EVENTS}")
        if not 0 <= self.least_chance <= 0.5:
            raise OptionError(f"--least-chance = {self.least_chance}: must be 0 to 0.5")
        for name, default in PATH_OPTIONS.items():
            if self.estimator != NONSEQUENTIAL and getattr(self, name) != default:
                option = f"--{name.replace('_', '-')} = {getattr(self, name)}"
                option = "--no-aimed-scatter" if name == "aimed_scatter" else option
                raise OptionError(f"{option}: must go with --estimator {NONSEQUENTIAL}, not {self.estimator}")


# What only the non-sequential estimator has a choice of, with the defaults.
PATH_OPTIONS = {
    field.name: field.default
    for field in fields(TraceOptions)
    if field.name in ("bounce_limit", "least_chance", "branches", "aimed_scatter", "polarisation")
}


def check_traceable(scene: Scene, options: TraceOptions) -> None:
    """Refuse, with a ValueError, a scene that a sequential estimator or its smoothing cannot trace."""
    check_sequential(scene, options.estimator)
    if options.smoothing and not can_smooth(scene):
        must = "must be one convex polygon with --smoothing, or rays be traced without it"
        raise OptionError(f"scene {scene.name}: mirror.outline: {must}")


def check_sequential(scene: Scene, estimator: str) -> None:
    """Refuse, with a ValueError, a scene with what only the non-sequential estimator sees."""
    if scene.is_sequential:
        return
    if scene.element:
        what = f"element[0].name = {scene.element[0].name!r}"
    elif scene.mirror.scatter is not None:
        what = f"mirror.scatter.model = {type(scene.mirror.scatter).__name__.lower()!r}"
    else:
        what = f"camera.lens = {scene.camera.lens!r}"
    must = f"must be left out with --estimator {estimator}, or --estimator be {NONSEQUENTIAL}"
    raise OptionError(f"scene {scene.name}: {what}: {must}")


def can_smooth(scene: Scene) -> bool:
    """Whether a ray's chord through the camera's aperture stays in one piece on the mirror, as smoothing needs it."""
    return scene.mirror.outline is None or scene.mirror.outline.is_convex


def check_nonsequential(scene: Scene) -> None:
    """Refuse, with a ValueError, a scene with what the non-sequential estimator does not see."""
    camera, screen = scene.camera, scene.screen
    for key, given in (
        ("camera.intrinsics.distortion", camera.is_distorted and list(camera.intrinsics.distortion)),
        ("camera.aperture_offset_mm", any(camera.aperture_offset_mm) and list(camera.aperture_offset_mm)),
        ("mirror.outline", scene.mirror.outline is not None and "no whole disk"),
        ("screen.shape", screen.shape is not None and "a bent screen"),
        ("screen.cover_glass", screen.cover_glass is not None and "a plate on the pixels"),
    ):
        if given:
            sequential = ", ".join((*ESTIMATORS, ANALYTIC))
            must = f"must be left out with --estimator {NONSEQUENTIAL}, or --estimator be {sequential}"
            raise OptionError(f"scene {scene.name}: {key} = {given}: {must}")
