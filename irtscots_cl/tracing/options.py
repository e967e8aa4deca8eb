"""How to trace a scene: the choices that a user has, checked."""

from __future__ import annotations

from dataclasses import dataclass

from irtscots_cl.opencl.structs import PRECISIONS
from irtscots_cl.scene.model import Scene
from irtscots_cl.tracing.samplers import SAMPLERS

ESTIMATORS = ("forward", "adjoint")  # that trace rays on a device
AIMS = ("mirror", "camera")  # of the forward estimator
ANALYTIC = "analytic"  # the one that does not
NONSEQUENTIAL = "nonsequential"  # from element to element in any order, by path
BRANCHES = ("roulette", "both")  # of a ray at an interface: one by chance, or both
MAX_SMOOTHED_RAYS = 2**32  # per pixel and replicate: a sum of so many 32-bit amounts stays below 2^63


@dataclass(frozen=True)
class TraceOptions:
    """How to trace. Refuses what is out of range with a ValueError that names the command line's option.

    estimator: "forward", "adjoint", "analytic" or "nonsequential". sampler: a name of samplers.SAMPLERS. precision:
    "fp32" or "fp64". seed: 64 bits. aim: forward only, "mirror" or "camera" (aiming.py). overfill: forward only, solid
    angle of the emission over the least that covers what it is aimed at. smoothing: adjoint only,
    every ray stands for its whole chord through the camera's aperture (kernels/entry/trace_lines.cl); a central hole
    must be wider than the aperture's blur on the mirror, or its rim is told only roughly.
    """

    estimator: str = "adjoint"
    sampler: str = "philox"
    precision: str = "fp32"
    seed: int = 1
    aim: str = "mirror"
    overfill: float = 1.0
    smoothing: bool = False

    def __post_init__(self) -> None:
        for option, value, allowed in (
            ("estimator", self.estimator, (*ESTIMATORS, ANALYTIC, NONSEQUENTIAL)),
            ("sampler", self.sampler, SAMPLERS),
            ("precision", self.precision, tuple(PRECISIONS)),
            ("aim", self.aim, AIMS),
        ):
            if value not in allowed:
                raise ValueError(f"--{option} = {value!r}: must be one of {', '.join(allowed)}")
        if not 0 <= self.seed < 2**64:
            raise ValueError(f"--seed = {self.seed}: must be 0 to 2^64 - 1")
        if not 1.0 <= self.overfill <= 1e4:
            raise ValueError(f"--overfill = {self.overfill}: must be 1 to 10000")
        if self.aim != "mirror" and self.estimator != "forward":
            raise ValueError(f"--aim {self.aim}: must go with --estimator forward, not {self.estimator}")
        if self.smoothing and self.estimator != "adjoint":
            raise ValueError(f"--smoothing: must go with --estimator adjoint, not {self.estimator}")


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
    raise ValueError(f"scene {scene.name}: {what}: {must}")
