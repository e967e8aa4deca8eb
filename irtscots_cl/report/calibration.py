"""What `irtscots calibrate` tells: its facts as in report.json, as tables, and its arrays in calibration.h5."""

from __future__ import annotations

from pathlib import Path
from typing import TypedDict

import h5py
import numpy as np

from irtscots_cl.calibration.bundle_adjustment import Adjustment
from irtscots_cl.calibration.calibrate import Calibrated
from irtscots_cl.calibration.heights import TERMS
from irtscots_cl.calibration.judgement import FROM_DATA, FROM_PRIOR, prior_pulls
from irtscots_cl.calibration.measured import base_name
from irtscots_cl.calibration.parameters import parameter, zernike_noll
from irtscots_cl.formats.hdf5 import write_dataset
from irtscots_cl.maths.low_order import rms
from irtscots_cl.measurement.quality import OK, Check
from irtscots_cl.report.quality import check_facts
from irtscots_cl.report.tables import Table
from irtscots_cl.report.types import CheckFacts
from irtscots_cl.system.atomic_files import replacing

LEFT = ("piston_tilt", "piston_tilt_power")


class UnknownFacts(TypedDict):
    """A fitted unknown. value: change from the scene's; prior: standard deviation before, None without one.

    known_by: "data", "data and prior" or "prior". pull: by how many standard deviations value and prior differ.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    prior: float
    prior_source: str
    known_by: str
    pull: float


class MeasurementFacts(TypedDict):
    """pixels: with a place on the screen; rejected: those too far from the model."""

    name: str
    pixels: int
    rejected: int


class HeightTerms(TypedDict):
    """Of a height map, rms in nm."""

    piston_tilt: float
    piston_tilt_power: float


class CalibrationHeights(TypedDict):
    """Heights of the first measurement, told from the scene's design: by the scene's geometry and by the fitted one.

    standard_deviation: of `after`, from noise and the calibration's covariance; noise: from noise alone.
    """

    before: HeightTerms
    after: HeightTerms
    change: HeightTerms
    standard_deviation: HeightTerms
    noise: HeightTerms


class CalibratedTerm(TypedDict):
    """A Zernike term of the height. error_per_um: rms of the height's error [nm] that a micrometre of the term on the
    mirror makes, where it is fitted beyond its prior, else as it is; taken: the part of the term that is lost in it."""

    noll: int
    before_um: float
    after_um: float
    standard_error_um: float
    error_per_um: float
    taken: float


class DistanceFacts(TypedDict):
    name: str
    known_mm: float
    sigma_mm: float
    fitted_mm: float
    source: str


class CalibrationFacts(TypedDict):
    """What `irtscots calibrate` tells.

    noise: factor on the stated errors. from_data: number of unknowns that the images determine. better_with: by how
    much chi-square falls with a further unknown. covariance: of the unknowns in their order and units.
    """

    scene: str
    verdict: str
    measurements: list[MeasurementFacts]
    unknowns: list[UnknownFacts]
    distances: list[DistanceFacts]
    chi_square: float
    degrees_of_freedom: float
    noise: float
    from_data: float
    rounds: int
    converged: bool
    mirror_order: int
    height_nm_rms: CalibrationHeights
    zernike: list[CalibratedTerm]
    better_with: dict[str, float]
    covariance: list[list[float]]
    checks: list[CheckFacts]


def calibration_facts(found: Calibrated, checks: list[Check]) -> CalibrationFacts:
    """checks: of the images; those of the fit follow."""
    fit = found.fit
    first = fit.problem.moved_first(fit.values)
    counts = zip(fit.problem.measurements, fit.used, strict=True)
    return {
        "scene": found.scene.name,
        "verdict": found.verdict,
        "measurements": [
            {"name": m.name, "pixels": len(m.pixels), "rejected": int(np.sum(~used))} for m, used in counts
        ],
        "unknowns": _unknowns(found),
        "distances": [
            {"name": d.name, "known_mm": d.mm, "sigma_mm": d.sigma, "fitted_mm": d.of(first), "source": d.source}
            for d in fit.problem.distances
        ],
        "chi_square": fit.chi_square,
        "degrees_of_freedom": fit.degrees,
        "noise": fit.noise,
        "from_data": fit.from_data,
        "rounds": fit.rounds,
        "converged": fit.converged,
        "mirror_order": found.order,
        "height_nm_rms": _heights(found),
        "zernike": _terms(found),
        "better_with": dict(sorted(found.wide.gains().items(), key=lambda item: -item[1])[:5]),
        "covariance": fit.covariance.tolist(),
        "checks": check_facts([*checks, *found.checks]),
    }


def _unknowns(found: Calibrated) -> list[UnknownFacts]:
    fit, scene = found.fit, found.fit.problem.measurements[0].scene
    rows = zip(fit.names, fit.values.tolist(), fit.errors.tolist(), prior_pulls(fit).tolist(), strict=True)
    facts: list[UnknownFacts] = []
    for name, value, error, pull in rows:
        prior = found.priors[base_name(name)]
        facts.append(
            {
                "name": name,
                "unit": parameter(base_name(name), scene).unit,
                "value": value,
                "standard_error": error,
                "prior": prior.sigma,
                "prior_source": prior.source,
                "known_by": known_by(error, prior.sigma),
                "pull": pull,
            }
        )
    return facts


def known_by(error: float, prior: float) -> str:
    """What determines an unknown with this standard error and that of its prior (NaN: none)."""
    if not error > FROM_DATA * prior:
        return "data"
    return "data and prior" if error <= FROM_PRIOR * prior else "prior"


def _heights(found: Calibrated) -> CalibrationHeights:
    effects = found.effects
    maps = {"before": effects.before, "after": effects.after, "change": effects.change}
    maps |= {"standard_deviation": effects.draws, "noise": effects.noise_draws}
    return {key: {t: _rms_nm(found, value, t) for t in LEFT} for key, value in maps.items()}  # type: ignore[return-value]


def _rms_nm(found: Calibrated, heights: np.ndarray, terms: str) -> float:
    """Rms in nm over the pixels, and over maps if there are several."""
    grid = found.effects.grid
    left = grid.without(heights, terms)
    return rms(left, grid.mask) * 1e6 if left.ndim == 2 else float(np.sqrt(np.mean(left[:, grid.mask] ** 2))) * 1e6


def _terms(found: Calibrated) -> list[CalibratedTerm]:
    effects = found.effects
    of = effects.grid.coefficients
    errors = of(effects.draws).std(0) * 1e3
    before, after = of(effects.before) * 1e3, of(effects.after) * 1e3
    return [
        {
            "noll": noll,
            "before_um": float(before[k]),
            "after_um": float(after[k]),
            "standard_error_um": float(errors[k]),
            "error_per_um": effects.taken[noll][0] * 1e6,
            "taken": effects.taken[noll][1],
        }
        for k, noll in enumerate(TERMS)
    ]


def calibration_tables(facts: CalibrationFacts) -> list[Table]:
    """The verdict, the unknowns, the heights and the checks that did not pass."""
    chi_square, degrees = facts["chi_square"], facts["degrees_of_freedom"]
    pixels = ", ".join(f"{m['name']}: {m['pixels']:,}" for m in facts["measurements"])
    rejected = sum(m["rejected"] for m in facts["measurements"])
    rows = [
        ("verdict", facts["verdict"]),
        ("pixels", f"{pixels}; {rejected:,} rejected"),
        ("chi-square / degrees of freedom", f"{chi_square:.6g} / {degrees:.6g} = {chi_square / degrees:.4g}"),
        ("unknowns that the images determine", f"{facts['from_data']:.1f} of {len(facts['unknowns'])}"),
        ("mirror terms", f"to radial order {facts['mirror_order']}" if facts["mirror_order"] else "none fitted"),
    ]
    tables = [Table("Calibration", ("", ""), rows), _unknown_table(facts), _height_table(facts), _term_table(facts)]
    if facts["distances"]:
        distances = [
            (d["name"], f"{d['known_mm']:.4f} +- {d['sigma_mm']:.2g}", f"{d['fitted_mm']:.4f}", d["source"])
            for d in facts["distances"]
        ]
        tables.append(Table("Known distances", ("", "known [mm]", "fitted [mm]", "source"), distances))
    failed = [(c["name"], c["level"], c["text"]) for c in facts["checks"] if c["level"] != OK]
    if failed:
        passed = len(facts["checks"]) - len(failed)
        tables.append(Table(f"Checks: {passed} passed, these did not", ("check", "level", ""), failed))
    return tables


def _unknown_table(facts: CalibrationFacts) -> Table:
    rows = [
        (u["name"], u["unit"], f"{u['value']:+.4g}", f"{u['standard_error']:.2g}",
         "-" if u["prior"] != u["prior"] else f"{u['prior']:.2g}", u["known_by"], u["prior_source"])
        for u in facts["unknowns"] if zernike_noll(base_name(u["name"])) is None
    ]  # fmt: skip
    head = ("changed in the scene", "unit", "by", "+-", "prior +-", "known by", "prior from")
    return Table("Geometry", head, rows)


def _height_table(facts: CalibrationFacts) -> Table:
    names = {
        "before": "by the scene's geometry",
        "after": "by the fitted geometry",
        "change": "changed by the calibration",
        "standard_deviation": "standard deviation, calibration and noise",
        "noise": "standard deviation, noise alone",
    }
    heights = facts["height_nm_rms"]
    rows = [(text, *(f"{heights[key][t]:.4g}" for t in LEFT)) for key, text in names.items()]  # type: ignore[literal-required]
    head = ("height above the design, rms [nm]", *(f"without {t.replace('_', ', ')}" for t in LEFT))
    return Table("Heights", head, rows)


def _term_table(facts: CalibrationFacts) -> Table:
    rows = [
        (str(t["noll"]), f"{t['before_um'] * 1e3:+.4g}", f"{t['after_um'] * 1e3:+.4g}",
         f"{t['standard_error_um'] * 1e3:.2g}", f"{t['taken']:.1%}")
        for t in facts["zernike"]
    ]  # fmt: skip
    head = ("Zernike term (Noll)", "before [nm]", "after [nm]", "+- [nm]", "of it taken for geometry")
    return Table("Low terms of the height", head, rows)


def write_calibration(path: Path, found: Calibrated, attributes: dict[str, str]) -> None:
    """Write calibration.h5: values and covariance of the unknowns, residual maps of each measurement, height maps."""
    fit, effects = found.fit, found.effects
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        for key, value in attributes.items():
            file.attrs[key] = value
        scene = fit.problem.measurements[0].scene
        file["unknowns/name"] = np.array(fit.names, h5py.string_dtype())
        units = [parameter(base_name(name), scene).unit for name in fit.names]
        file["unknowns/unit"] = np.array(units, h5py.string_dtype())
        file["unknowns/value"], file["unknowns/covariance"] = fit.values, fit.covariance
        file["unknowns/prior"] = fit.problem.sigmas
        for k, m in enumerate(fit.problem.measurements):
            _write_residuals(file, f"measurement/{k + 1}", fit, k)
            file[f"measurement/{k + 1}"].attrs["name"] = m.name
        grid = effects.grid
        spread = np.sqrt(np.mean(grid.without(effects.draws, "piston_tilt") ** 2, axis=0))
        for name, values, unit in (
            ("x_mm", grid.mirror_mm[0], "mm"),
            ("y_mm", grid.mirror_mm[1], "mm"),
            ("before_nm", effects.before * 1e6, "nm"),
            ("after_nm", effects.after * 1e6, "nm"),
            ("change_nm", effects.change * 1e6, "nm"),
            ("standard_deviation_nm", spread * 1e6, "nm"),
        ):
            write_dataset(file, f"height/{name}", values, unit)
        file["height"].attrs["every pixel, in rows and columns"] = grid.step


def _write_residuals(file: h5py.File, group: str, fit: Adjustment, k: int) -> None:
    m = fit.problem.measurements[k]
    left = m.on_grid(fit.left[k] * m.errors_mm)
    for name, values in (("x_mm", left[0]), ("y_mm", left[1])):
        write_dataset(file, f"{group}/residual/{name}", values, "mm")
    errors = m.on_grid(m.errors_mm)
    for name, values in (("x_standard_error_mm", errors[0]), ("y_standard_error_mm", errors[1])):
        write_dataset(file, f"{group}/residual/{name}", values, "mm")
    write_dataset(file, f"{group}/used", m.on_grid(fit.used[k].astype(float)) == 1.0, "1")
