"""Calibrate a set-up from files: a rough fit of few pixels first, since the light's model needs a geometry."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from irtscots_cl.calibration.bundle_adjustment import Adjustment
from irtscots_cl.calibration.calibrate import Calibrated, Unknowns, calibrate, fit_geometry
from irtscots_cl.calibration.from_images import FEW_PIXELS, MOST_PIXELS, from_file, is_of_images
from irtscots_cl.calibration.measured import Measurement
from irtscots_cl.calibration.parameters import moved
from irtscots_cl.measurement.quality import WARNING, Check, worst
from irtscots_cl.pipeline.measurement_list import Planned
from irtscots_cl.pipeline.output import told_as_incomplete, version_attributes
from irtscots_cl.report.calibration import CalibrationFacts, calibration_facts, write_calibration
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption
from irtscots_cl.system.atomic_files import check_output_folder, write_json, write_text

FILES = ("scene.toml", "report.json", "calibration.h5")


def calibrate_files(
    planned: Sequence[Planned], scene: Scene, folder: Path, unknowns: Unknowns, *, strict: bool = False
) -> CalibrationFacts:
    """Calibrate a scene from measurements and write FILES into a folder.

    strict: refuse a calibration with a warning. Returns the facts of report.json. Raises ValueError for files that do
    not fit, unknowns that nothing determines, data that contradict each other.
    """
    guesses = [plan.scene for plan in planned]
    if any(is_of_images(plan.path) for plan in planned):
        rough, _ = _read(planned, guesses, FEW_PIXELS)
        guesses = _guesses(fit_geometry(rough, scene, unknowns)[0], rough)
    measurements, checks = _read(planned, guesses, MOST_PIXELS)
    found = calibrate(measurements, scene, unknowns)
    facts = calibration_facts(found, checks)
    doubtful = [check for check in (*checks, *found.checks) if check.level == WARNING]
    if strict and doubtful:
        raise ValueError("; ".join(f"{check.name}: {check.text}" for check in doubtful) + " (--strict)")
    _write(found, facts, folder)
    return facts


def _read(planned: Sequence[Planned], guesses: Sequence[Scene], most: int) -> tuple[list[Measurement], list[Check]]:
    """The measurements, and the checks of their images, of one name the worst."""
    measurements, worst_of = [], dict[str, Check]()
    for plan, guess in zip(planned, guesses, strict=True):
        interruption.check()
        measurement, checks = from_file(plan.path, plan.scene, guess, most, **plan.kind)
        measurements.append(measurement)
        for check in checks:
            there = worst_of.setdefault(check.name, check)
            if worst([there, check]) != there.level:
                worst_of[check.name] = check
    return measurements, list(worst_of.values())


def _guesses(fit: Adjustment, measurements: Sequence[Measurement]) -> list[Scene]:
    """The scenes of measurements as fitted, with the mirror terms found, on the believed grid of the screen."""
    found = []
    for m in measurements:
        index = next(k for k, other in enumerate(fit.problem.measurements) if other is m)
        changes = {name: v for name, v in fit.changes(index).items() if not name.startswith("screen.pitch")}
        found.append(moved(m.scene, changes))
    return found


def _write(found: Calibrated, facts: CalibrationFacts, folder: Path) -> None:
    """report.json comes last: where it is, the others are complete."""
    interruption.check()
    check_output_folder(folder, FILES)
    with told_as_incomplete(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "report.json").unlink(missing_ok=True)
        toml = found.scene.to_toml()
        write_text(folder / "scene.toml", toml)
        write_calibration(folder / "calibration.h5", found, {"scene": toml} | version_attributes())
        write_json(folder / "report.json", facts)
