"""Calibrate a set-up from files: read, fit, model the light anew where the fit moved much, fit again, write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from irtscots_cl.calibration.calibrate import Calibrated, calibrate, moves_pixels
from irtscots_cl.calibration.from_images import from_file, is_of_images
from irtscots_cl.calibration.measured import Measurement
from irtscots_cl.calibration.parameters import moved
from irtscots_cl.measurement.quality import WARNING, Check, worst
from irtscots_cl.pipeline.measurement_list import Planned
from irtscots_cl.pipeline.output import told_as_incomplete, version_attributes
from irtscots_cl.report.calibration import CalibrationFacts, calibration_facts, write_calibration
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption
from irtscots_cl.system.atomic_files import check_output_folder, write_json, write_text

MOVED = 0.02  # footprints of a pixel: from there on the light of the images is modelled again
FILES = ("scene.toml", "report.json", "calibration.h5")


def calibrate_files(
    planned: Sequence[Planned], scene: Scene, folder: Path, *, strict: bool = False, **how: Any
) -> CalibrationFacts:
    """Calibrate a scene from measurements and write FILES into a folder.

    strict: refuse a fit with a warning. how: arguments of calibration.calibrate. Returns the facts of report.json.
    Raises ValueError for files that do not fit, unknowns that nothing determines, data that contradict each other.
    """
    measurements, checks = _read(planned, [p.scene for p in planned])
    found = calibrate(measurements, scene, **how)
    if any(_has_moved(found, m) for m, p in zip(measurements, planned, strict=True) if is_of_images(p.path)):
        interruption.check()
        guesses = [_guess(found, m) for m in measurements]
        measurements, checks = _read(planned, guesses)
        found = calibrate(measurements, scene, **how)
    facts = calibration_facts(found, checks)
    doubtful = [check for check in (*checks, *found.checks) if check.level == WARNING]
    if strict and doubtful:
        raise ValueError("; ".join(f"{check.name}: {check.text}" for check in doubtful) + " (--strict)")
    _write(found, facts, folder)
    return facts


def _read(planned: Sequence[Planned], guesses: Sequence[Scene]) -> tuple[list[Measurement], list[Check]]:
    """The measurements, and the checks of their images, of one name the worst."""
    measurements, checks = [], []
    for plan, guess in zip(planned, guesses, strict=True):
        interruption.check()
        measurement, own = from_file(plan.path, plan.scene, guess, **plan.kind)
        measurements.append(measurement)
        checks += own
    worst_of: dict[str, Check] = {}
    for check in checks:
        there = worst_of.get(check.name)
        if there is None or worst([there, check]) != there.level:
            worst_of[check.name] = check
    return measurements, list(worst_of.values())


def _index(found: Calibrated, measurement: Measurement) -> int:
    return next(k for k, m in enumerate(found.fit.problem.measurements) if m is measurement)


def _has_moved(found: Calibrated, measurement: Measurement) -> bool:
    return moves_pixels(measurement, found.fit, _index(found, measurement)) > MOVED


def _guess(found: Calibrated, measurement: Measurement) -> Scene:
    """The measurement's scene as fitted, with the mirror terms found, on the believed grid of the screen."""
    changes = found.fit.changes(_index(found, measurement))
    return moved(measurement.scene, {name: v for name, v in changes.items() if not name.startswith("screen.pitch")})


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
