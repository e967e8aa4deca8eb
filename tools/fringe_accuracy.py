#!/usr/bin/env python3
"""Heights from simulated fringes of the presets: print the tables of docs/fringes.md, and check their bounds.

tools/fringe_accuracy.py [clean] [noise] [gamma] [pulls] [--scene NAME] [--seeds N]: all without names. Exits with 1
where a bound fails. Images are those of a scene in closed form with NumPy's noise added. Slow: some 10 minutes.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field, replace

import numpy as np

from irtscots_cl import LineScan, error_bars, load_scene, measure_by, trace
from irtscots_cl.imaging.fringes import FringeScan, FringeSet, FringeStack, equal_steps
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.fringe_light import LightPhases, places_of_light, places_with_harmonics
from irtscots_cl.measurement.harmonics import bias_size, gamma_harmonics
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.screen_coordinates import ScreenCoordinates, screen_coordinates
from irtscots_cl.measurement.screen_places import surface_from_places
from irtscots_cl.optics.setup import Setup
from irtscots_cl.optics.surface import Surface
from irtscots_cl.pipeline.measure_fringes import places_in_mm

SCENES = ("sphere", "sphere-deviated", "off-axis")
STEPS = (4, 5, 8, 16)
PERIODS = {  # over the screen; of the small screens the aperture's image covers a quarter
    "sphere": ((0.9, 2.46), (0.9, 1.7, 2.9)),
    "sphere-deviated": ((0.9, 2.46), (0.9, 1.7, 2.9)),
    "off-axis": ((0.9, 9.0), (0.9, 6.3, 39.0)),
}
UNEQUAL = (0.0, 0.9, 2.0, 3.3, 4.1, 5.2)  # rad
TURNED = (0.3, 1.2, 2.9, 4.0, 5.6)  # rad
PIXELS = 45  # of coarse cameras, for statistics over many seeds
WORSE = 1.2  # than the `fine` line scan, for clean images
NOISE = 0.01  # of the brightest sample
ELECTRONS = 2000.0  # at the brightest sample, for photon noise
GAMMA = 2.2
GAMMA_NM = 1.0  # allowed after correction
WITHIN = 0.1  # relative, of the stated error
SIGMA = 3.0  # of a ratio's own error, beyond which the bound counts as missed


@dataclass(frozen=True)
class Measured:
    """A mirror and the places that it was measured from, with those of uncorrected harmonics and their facts."""

    result: Reconstruction
    found: ScreenCoordinates
    uncorrected: Reconstruction
    phases: dict[str, LightPhases]


class Case:
    """A preset, its light transport and what judges the heights found. pixels: of a coarse camera; None: its own."""

    def __init__(self, name: str, pixels: int | None = None):
        self.name, self.scene = name, load_scene(name)
        if pixels:
            detector = self.scene.camera.detector
            coarse = replace(
                detector, pixels=(pixels, pixels), pitch_mm=detector.pitch_mm * detector.pixels[0] / pixels
            )
            self.scene = replace(self.scene, camera=replace(self.scene.camera, detector=coarse))
        self.run = trace(self.scene, estimator="analytic")
        self.setup = Setup(self.scene.nominal())
        self.surface = Surface.of(self.scene.mirror)
        self.mask = self.setup.chief_rays.footprint.coverage >= 0.5

    def fine_nm(self) -> float:
        return self.error_nm(measure_by("fine", self.run.images(LineScan(self.scene)), self.setup))

    def images(self, periods, steps, gamma: float = 1.0) -> FringeStack:
        """Clean images over their brightest sample. steps: their number, or the steps in rad."""
        own = equal_steps(steps) if isinstance(steps, int) else steps
        sets = tuple(FringeSet(axis, periods, (own,) * len(periods)) for axis in "xy")
        stack = self.run.images(FringeScan(self.scene, sets, gamma=gamma))
        return replace(stack, frames=stack.frames / stack.frames.max())

    def error_mm(self, result: Reconstruction) -> np.ndarray:
        """Height error [rows, columns], piston and tilt removed."""
        truth = self.surface.deviation_at(result.x_mm, result.y_mm)[0]
        return remove_terms(result.x_mm, result.y_mm, result.deviation_mm - truth, result.mask, "piston_tilt")

    def error_nm(self, result: Reconstruction) -> float:
        return rms(self.error_mm(result), result.mask) * 1e6

    def measured(self, stack: FringeStack) -> Measured:
        raw = screen_coordinates(stack, mask=self.mask)
        found, phases = places_of_light(raw, self.setup)
        orientation = self.scene.camera.detector.orientation
        plain = places_with_harmonics(raw, phases, orientation)
        return Measured(self._surface(found), found, self._surface(plain), phases)

    def _surface(self, found: ScreenCoordinates) -> Reconstruction:
        places = places_in_mm(found, self.setup, self.mask)
        return surface_from_places(places, self.setup, method="cubic", pixel_average=False)


def noisy(stack: FringeStack, random: np.random.Generator, read: float, electrons: float = 0.0) -> FringeStack:
    """read: standard deviation; electrons: at the value 1, 0 without photon noise."""
    frames = np.asarray(stack.frames)
    sigma = np.sqrt(read**2 + (frames / electrons if electrons else 0.0))
    return replace(stack, frames=frames + sigma * random.standard_normal(frames.shape))


class Verdicts:
    """Counts what misses its bound."""

    missed = 0

    def word(self, holds: bool) -> str:
        self.missed += not holds
        return "yes" if holds else "**no**"


def clean_table(names: list[str], verdicts: Verdicts, _seeds: int) -> None:
    print(f"\nClean images: height error [nm]; bound: {WORSE} x `fine` line scan\n")
    print("| scene | `fine` | periods | " + " | ".join(f"{n} steps" for n in STEPS) + " | within |")
    print("|---|---|---|" + "---|" * (len(STEPS) + 1))
    for name in names:
        case = Case(name)
        fine = case.fine_nm()
        for periods in PERIODS[name]:
            errors = [case.error_nm(case.measured(case.images(periods, n)).result) for n in STEPS]
            told = " | ".join(f"{e:.2g}" for e in errors)
            word = verdicts.word(max(errors) < WORSE * fine)
            print(f"| {name} | {fine:.2g} | {words(periods)} | {told} | {word} |", flush=True)


def gamma_table(names: list[str], verdicts: Verdicts, _seeds: int) -> None:
    closed = {n: bias_size(np.array(equal_steps(n)), gamma_harmonics(GAMMA)) for n in (4, 5)}
    print(f"\nGamma {GAMMA}, clean images, left in and taken out; bound {GAMMA_NM} nm.")
    print(
        "Closed form of a phase's largest bias: "
        + ", ".join(f"{closed[n]:.4f} rad at {n} steps" for n in closed)
        + "\n"
    )
    print("| scene | periods | steps | gamma found | largest bias, lowest series [rad] | left in [nm] | "
          "taken out [nm] | within |\n|---|---|---|---|---|---|---|---|")  # fmt: skip
    for name in names:
        case = Case(name)
        for periods in PERIODS[name]:
            for n in closed:
                found = case.measured(case.images(periods, n, GAMMA))
                light = found.phases["x"]
                bias = np.nanmax(np.abs(light.harmonics_rad[0][found.result.mask]))
                error = case.error_nm(found.result)
                # the light's blur takes up to a third of the harmonics of the small screens
                word = verdicts.word(error < GAMMA_NM and bias < 1.02 * closed[n])
                print(f"| {name} | {words(periods)} | {n} | {light.gamma.value:.4f} | {bias:.4f} | "
                      f"{case.error_nm(found.uncorrected):.3g} | {error:.2g} | {word} |", flush=True)  # fmt: skip


@dataclass
class Statistics:
    """Of repeats: actual and stated mean squares of height errors, rms pulls of slopes and heights."""

    actual: list[float] = field(default_factory=list)
    stated: list[float] = field(default_factory=list)
    slope: list[float] = field(default_factory=list)
    height: list[float] = field(default_factory=list)

    def add(self, case: Case, found: Measured, seed: int) -> None:
        result = found.result
        bars, error, mask = error_bars(result, seed), case.error_mm(result), result.mask
        truth = case.surface.gradient(result.x_mm, result.y_mm)
        off = [
            ((slope - own) / bar)[mask]
            for slope, own, bar in zip(
                (result.slope_x, result.slope_y), truth, (bars.slope_x, bars.slope_y), strict=True
            )
        ]
        self.actual.append(rms(error, mask) ** 2)
        self.stated.append(rms(bars.height_mm, mask) ** 2)
        self.slope.append(float(np.mean(np.square(off))))
        self.height.append(float(np.mean((error / bars.height_mm)[mask] ** 2)))

    def row(self, verdicts: Verdicts) -> str:
        ratio = np.sqrt(np.mean(self.actual) / np.mean(self.stated))
        own = ratio * relative(self.actual)
        slope, height = (float(np.sqrt(np.mean(v))) for v in (self.slope, self.height))
        slope_own, height_own = slope * relative(self.slope), height * relative(self.height)
        holds = abs(ratio - 1) < WITHIN + SIGMA * own and abs(slope - 1) < WITHIN / 2 + SIGMA * slope_own
        word = verdicts.word(bool(holds and abs(height - 1) < WITHIN / 2 + SIGMA * height_own))
        stated = np.sqrt(np.mean(self.stated)) * 1e6
        return (f"{stated:.3g} | {ratio:.3f} ± {own:.3f} | {slope:.3f} ± {slope_own:.3f} | "
                f"{height:.3f} ± {height_own:.3f} | {word} |")  # fmt: skip


def relative(squares: list[float]) -> float:
    """Relative standard error of the root of a mean of squares."""
    return float(np.std(squares, ddof=1) / np.mean(squares) / 2 / np.sqrt(len(squares)))


HEAD = "stated [nm] | actual / stated | pull of slopes | pull of heights | within |"


def noise_table(names: list[str], verdicts: Verdicts, seeds: int) -> None:
    print(f"\n{NOISE:.0%} of the brightest sample, cameras of {PIXELS} x {PIXELS} pixels, {seeds} seeds\n")
    print(f"| scene | periods | steps | {HEAD}\n|---|---|---|---|---|---|---|---|")
    for name in names:
        case = Case(name, PIXELS)
        for periods in PERIODS[name]:
            for n in STEPS:
                found = repeats(case, case.images(periods, n), seeds, NOISE)
                print(f"| {name} | {words(periods)} | {n} | {found.row(verdicts)}", flush=True)


def pulls_table(_names: list[str], verdicts: Verdicts, seeds: int) -> None:
    name, periods = "sphere-deviated", PERIODS["sphere-deviated"][1]
    case = Case(name, PIXELS)
    print(f"\n{name}, periods {words(periods)}, camera of {PIXELS} x {PIXELS} pixels, {seeds} seeds\n")
    print(f"| steps | noise | gamma | {HEAD}\n|---|---|---|---|---|---|---|---|")
    kinds = {"read 1 %": (NOISE, 0.0), f"{ELECTRONS:g} electrons": (0.0, ELECTRONS), "both": (NOISE, ELECTRONS)}
    for steps, told in ((3, "3"), (4, "4"), (UNEQUAL, "6 unequal"), (TURNED, "5 unequal"), (16, "16")):
        for kind, (read, electrons) in kinds.items():
            for gamma in (1.0, GAMMA) if steps != 3 else (1.0,):  # three steps show no gamma
                found = repeats(case, case.images(periods, steps, gamma), seeds, read, electrons)
                print(f"| {told} | {kind} | {gamma:g} | {found.row(verdicts)}", flush=True)


def repeats(case: Case, clean: FringeStack, seeds: int, read: float, electrons: float = 0.0) -> Statistics:
    found = Statistics()
    for seed in range(seeds):
        stack = noisy(clean, np.random.default_rng(seed), read, electrons)
        found.add(case, case.measured(stack), seed)
    return found


def words(periods) -> str:
    return ", ".join(f"{p:g}" for p in periods)


TABLES = {"clean": clean_table, "gamma": gamma_table, "noise": noise_table, "pulls": pulls_table}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"of {', '.join(TABLES)}; default all")
    parser.add_argument("--scene", action="append", choices=SCENES, help="only this preset; may be repeated")
    parser.add_argument("--seeds", type=int, default=50, metavar="N", help="of the noise; default 50")
    options = parser.parse_args()
    verdicts = Verdicts()
    for name in options.tables or TABLES:
        if name not in TABLES:
            parser.error(f"{name!r}: must be one of {', '.join(TABLES)}")
        TABLES[name](options.scene or list(SCENES), verdicts, options.seeds)
    if verdicts.missed:
        print(f"\n{verdicts.missed} rows are not within their bound", file=sys.stderr)
    return int(verdicts.missed > 0)


if __name__ == "__main__":
    sys.exit(main())
