"""The errors that a test is expected to have: the table [budget].

Only scenes with that table import this module. A key of [budget.sources] is the name of a source, such as "camera.x_mm"
(irtscots_cl/budget/sources.py has them all). Its value is a standard deviation, or a table.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, Strict, model_validator

from irtscots_cl.scene.calibration_known import flat_names
from irtscots_cl.scene.validation import PositiveMm, Seed, array_of, bounded, checked, refuse

_SIZE = bounded(gt=0, le=1e6)
_Size = Annotated[Annotated[float, Strict(), _SIZE] | None, Field(description=_SIZE.description)]
_COST = bounded(ge=0, le=1e12)
_SET_UPS = "an integer from 1 to 24"
_SetUps = Annotated[int, Strict(), Field(ge=1, le=24, description=_SET_UPS)]
_Periods = Annotated[float, Strict(), bounded(gt=0, le=1e4)]
_NM = bounded(gt=0, le=1e9)
_WIND = bounded(ge=0, le=1e6)
_FRAME = bounded(ge=0, le=1e6)
KINDS = ("normal", "uniform", "triangular")


@checked("sources")
class Distribution:
    """Of one source's value, about 0, in the unit of its name.

    normal: standard deviation. uniform, triangular: half the width. set_ups: number of measurements, of whose mean the
    test is made, that each have a value of their own, such as of a camera that is set up anew. cost: what it costs to
    calibrate this source away, in any unit of money. Raises SceneError for a value that is not allowed.
    """

    normal: _Size = None
    uniform: _Size = None
    triangular: _Size = None
    set_ups: Annotated[_SetUps | None, Field(description=_SET_UPS)] = None
    cost: Annotated[Annotated[float, Strict(), _COST] | None, Field(description=_COST.description)] = None

    @model_validator(mode="after")
    def _check(self) -> Distribution:
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if not given:
            refuse(("normal",), None, "be given, or uniform or triangular")
        for kind in given[1:]:
            refuse((kind,), getattr(self, kind), "be given without another of normal, uniform, triangular")
        return self

    @property
    def kind(self) -> str:
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    @property
    def size(self) -> float:
        return float(getattr(self, self.kind))

    @property
    def values(self) -> int:
        """Number of values whose mean acts."""
        return self.set_ups or 1

    @property
    def sigma(self) -> float:
        """Standard deviation, of the mean."""
        own = self.size / {"normal": 1.0, "uniform": math.sqrt(3), "triangular": math.sqrt(6)}[self.kind]
        return own / math.sqrt(self.values)


def _sources(table: Any) -> Any:
    """The table with one level of keys, and numbers as standard deviations."""
    return flat_names(table, (*KINDS, "set_ups", "cost"), "normal")


@checked("air")
class Air:
    """Turbulent air on the rays' way: its outer scale, its wind across the way, and the time from frame to frame.

    Raises SceneError for a value that is not allowed.
    """

    outer_scale_mm: PositiveMm = 1000.0
    wind_mm_per_s: Annotated[float, Strict(), _WIND] = 100.0
    frame_s: Annotated[float, Strict(), _FRAME] = 0.1


@checked("budget")
class Budget:
    """sources: name -> Distribution. periods, steps: of the fringes; without periods, single lines are scanned.
    allow_nm: what the test may cost. air: of the source air.turbulence_nm; None for that of Air(). compensators:
    numbers of the geometry that are fitted away. exposures, mirror_turns: measurements whose mean is taken.
    calibrated: a report with the covariance of further sources. stray_light: a file with maps of the light of the
    sources stray.ghosts and stray.scatter.

    Raises SceneError for a value that is not allowed.
    """

    sources: Annotated[
        dict[str, Distribution],
        BeforeValidator(_sources),
        Field(description='a table of names with standard deviations: "camera.x_mm" = 0.1, or { uniform = 0.1 }'),
    ] = Field(default_factory=dict)
    periods: Annotated[
        tuple[_Periods, ...], *array_of("an array of numbers of periods over the screen, above 0 and at most 1e4")
    ] = ()
    steps: Annotated[int, Strict(), Field(ge=3, le=1000, description="an integer from 3 to 1000")] = 8
    trials: Annotated[int, Strict(), Field(ge=2, le=2**20, description="an integer from 2 to 1048576")] = 512
    seed: Seed = 1
    allow_nm: Annotated[Annotated[float, Strict(), _NM] | None, Field(description=_NM.description)] = None
    air: Annotated[Air | None, Field(description="a table [budget.air]")] = None
    compensators: Annotated[
        tuple[Annotated[str, Strict()], ...], *array_of('an array of names of the geometry, such as "screen.z_mm"')
    ] = ()
    exposures: Annotated[int, Strict(), Field(ge=1, le=1000, description="an integer from 1 to 1000")] = 1
    mirror_turns: Annotated[int, Strict(), Field(ge=1, le=24, description="an integer from 1 to 24")] = 1
    calibrated: Annotated[
        Annotated[str, Strict(), Field(min_length=1, max_length=4096)] | None,
        Field(description="the path of a report.json of `irtscots calibrate`"),
    ] = None
    stray_light: Annotated[
        Annotated[str, Strict(), Field(min_length=1, max_length=4096)] | None,
        Field(description="the path of a stray-light.h5 of `irtscots paths`"),
    ] = None

    @model_validator(mode="after")
    def _check(self) -> Budget:
        for k, name in enumerate(self.compensators):
            if name in self.compensators[:k]:
                refuse(("compensators",), name, "name each once")
        return self

    def __hash__(self) -> int:  # a dict has none
        given = (self.periods, self.steps, self.trials, self.seed, self.allow_nm, self.air)
        done = (self.compensators, self.exposures, self.mirror_turns, self.calibrated, self.stray_light)
        return hash((frozenset(self.sources.items()), given, done))

    @property
    def fringes(self) -> tuple[tuple[float, ...], int] | None:
        """Numbers of periods and steps; None for scans of single lines."""
        return (self.periods, self.steps) if self.periods else None
