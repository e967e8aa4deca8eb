"""The report of a run: report.json's contents, and the same as tables for terminal and HTML page."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path

from irtscots_cl.comparison import Comparison, Estimate
from irtscots_cl.errorparts import ErrorPart
from irtscots_cl.files import write_text
from irtscots_cl.paths import PathLight
from irtscots_cl.prediction import PredictedError
from irtscots_cl.reconstruction import Reconstruction
from irtscots_cl.straylight import StrayLight
from irtscots_cl.transport import LineLight, Transport


@dataclass(frozen=True)
class Table:
    """A titled table of strings."""

    title: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


def versions() -> dict[str, str]:
    """Versions of the package and of what its numbers depend on."""
    found = {}
    for name in ("irtscots-cl", "pyopencl", "numpy", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # a source tree that was never installed
            found[name] = "unknown"
    return found


def build_report(
    transport: Transport | LineLight,
    measure: str,
    result: Reconstruction,
    comparison: Comparison,
    predicted: PredictedError,
    parts: tuple[ErrorPart, ...],
    seconds: dict[str, float],
) -> dict:
    """The contents of report.json. measure: name of how it was measured. parts: of the height error,
    or none. seconds: build, trace, reconstruct, total."""
    height = {key: estimate.value for key, estimate in comparison.height_error_nm.items()}
    return {
        "scene": transport.scene.name,
        "device": transport.device,
        "estimator": transport.options.estimator,
        "sampler": transport.options.sampler,
        "precision": transport.options.precision,
        "seed": transport.options.seed,
        "aim": transport.options.aim,
        "overfill": transport.options.overfill,
        "smoothing": transport.options.smoothing,
        "measure": measure,
        "refinement_updates_nm": list(result.updates_nm),
        "replicates": transport.replicates,
        "versions": versions(),
        "rays_total": transport.rays_total,
        "rays_per_pixel": int(transport.rays.sum()),
        "rays_per_second": transport.rays_total / seconds["trace"],
        "seconds": seconds,
        "ledger": transport.ledger,
        "pixels_used": comparison.pixels_used,
        "light_curves_refused": result.refused(),
        "slope_error_urad_rms": {axis: e.value for axis, e in comparison.slope_error_urad.items()},
        "slope_error_urad_rms_standard_error": {a: e.standard_error for a, e in comparison.slope_error_urad.items()},
        "height_error_nm_rms": height,
        "height_error_nm_rms_standard_error": {t: e.standard_error for t, e in comparison.height_error_nm.items()},
        "height_standard_error_nm": comparison.height_standard_error_nm,
        "predicted": {
            "slope_error_urad_rms": _xy(predicted.slope),
            "slope_ray_noise_urad_rms": _xy(predicted.ray_noise_slope),
            "slope_line_sampling_urad_rms": _xy(predicted.line_sampling_slope),
            "height_error_nm_rms_piston_tilt": predicted.height_mm * 1e6,
            "height_ray_noise_nm_rms": predicted.ray_noise_height_mm * 1e6,
            "height_line_sampling_nm_rms": predicted.line_sampling_height_mm * 1e6,
        },
        "error_parts": [_part(part) for part in parts],
        "zernike": [
            {
                "noll": row.noll,
                "input_um": row.input_um,
                "output_um": row.output_um,
                "standard_error_um": row.standard_error_um,
            }
            for row in comparison.zernike
        ],
    }


def path_facts(light: PathLight, stray: tuple[StrayLight, ...]) -> dict:
    """What `irtscots paths` tells of a non-sequential trace."""
    direct = sum(path.flux_w for path in light.paths if path.kind == "direct")
    return {
        "scene": light.scene.name,
        "device": light.device,
        "sampler": light.options.sampler,
        "precision": light.options.precision,
        "seed": light.options.seed,
        "replicates": light.replicates,
        "rays_total": light.rays_total,
        "seconds": light.seconds,
        "rays_per_second": light.rays_total / light.seconds["trace"],
        "ends": light.ends,
        "launched_w": light.launched_w,
        "direct_w": direct,
        "staying": [
            {"end": stays.name, "flux_w": stays.flux_w, "flux_standard_error_w": stays.standard_error_w}
            for stays in light.staying
        ],
        "stray_light": [
            {"kind": s.kind, "of_direct": s.of_direct, "height_nm_rms": s.height_nm.value,
             "height_nm_rms_standard_error": s.height_nm.standard_error, "lost_pixels": s.lost_pixels}
            for s in stray
        ],
        "paths": [
            {
                "path": path.name,
                "kind": path.kind,
                "flux_w": path.flux_w,
                "flux_standard_error_w": path.standard_error_w,
                "of_direct": path.flux_w / direct if direct else math.nan,
                "rays": path.rays,
                "focus_mm": path.focus_mm,
                "blur_mm": path.blur_mm,
            }
            for path in light.paths
        ],
    }


def path_tables(facts: dict) -> list[Table]:
    """The paths by flux, and where all rays ended and all light stayed."""
    shown = [path for path in facts["paths"] if path["rays"]]
    stray = [(s["kind"], f"{s['of_direct']:.3g}",
              str(Estimate(s["height_nm_rms"], s["height_nm_rms_standard_error"])), str(s["lost_pixels"]))
             for s in facts["stray_light"]]  # fmt: skip
    flux = {s["end"]: str(Estimate(s["flux_w"], s["flux_standard_error_w"])) for s in facts["staying"] if s["flux_w"]}
    flux |= {"launched": f"{facts['launched_w']:.5g}", "detected": f"{sum(p['flux_w'] for p in facts['paths']):.5g}"}
    ends = [(end, f"{count:,}", flux.get(end, "")) for end, count in facts["ends"].items() if count or end in flux]
    return [
        Table(
            f"{facts['scene']}: paths from the screen to the detector",
            ("path", "kind", "flux [W]", "of direct", "rays", "focus [mm]", "blur [mm]"),
            [(p["path"], p["kind"], str(Estimate(p["flux_w"], p["flux_standard_error_w"])), f"{p['of_direct']:.3g}",
              f"{p['rays']:,}", _short_mm(p["focus_mm"]), _short_mm(p["blur_mm"])) for p in shown],
        ),
        *([Table("What it adds to the height, piston and tilt removed",
                 ("light", "of direct", "height [nm rms]", "pixels lost"), stray)] if stray else []),
        Table("Rays by where they ended, and the light that stayed there", ("", "rays", "flux [W]"), ends),
    ]  # fmt: skip


def _short_mm(length_mm: float) -> str:
    """A length to a micrometre, nothing where there is none."""
    return f"{round(length_mm, 3) + 0.0:.3f}" if math.isfinite(length_mm) else ""  # + 0.0: no minus before a zero


def _part(part: ErrorPart) -> dict:
    slopes = dict(zip("xy", part.slope_urad, strict=True))
    return {"part": part.name, "slope_urad_rms": slopes, "height_nm_rms": part.height_nm}


def _xy(values: tuple[float, float]) -> dict[str, float]:
    return {"x": values[0] * 1e6, "y": values[1] * 1e6}


def summary_tables(report: dict) -> list[Table]:
    """The short tables of a run: speed, errors beside their predictions, Zernike coefficients of the scene."""
    tables = [_run_table(report), _error_table(report)]
    if report["error_parts"]:
        tables.append(_parts_table(report))
    if "target" in report:
        tables.insert(0, _target_table(report["target"]))
    rows = [row for row in report["zernike"] if row["input_um"] != 0]
    if rows:
        tables.append(
            Table(
                "Zernike coefficients (Noll)",
                ("term", "in [um]", "out [um]", "difference [nm]"),
                [
                    (
                        str(row["noll"]),
                        f"{row['input_um']:.4f}",
                        str(Estimate(row["output_um"], row["standard_error_um"])),
                        f"{(row['output_um'] - row['input_um']) * 1e3:+.2f}",
                    )
                    for row in rows
                ],
            )
        )
    return tables


def _run_table(report: dict) -> Table:
    seconds, ledger, refused = report["seconds"], report["ledger"], report["light_curves_refused"]
    fates = ", ".join(
        f"{name.replace('_', ' ')} {count:,}" for name, count in ledger.items() if count and name != "launched"
    )
    return Table(
        f"{report['scene']}, {report['estimator']} estimator on {report['device']['name']}",
        ("", ""),
        [
            ("rays", f"{report['rays_total']:,}"),
            ("rays/s", f"{report['rays_per_second'] / 1e6:.1f} M"),
            ("seconds", ", ".join(f"{name} {value:.2f}" for name, value in seconds.items())),
            ("ledger", fates),
            ("pixels used", pixels_text(report["pixels_used"], refused)),
        ],
    )


def measured_table(facts: dict) -> Table:
    """What pipeline.measure found in a lab's images."""
    rows = [("pixels used", pixels_text(facts["pixels_used"], facts["light_curves_refused"]))]
    rows += [(f"without {terms.replace('_', ', ')} [nm]", f"{v:.4g}") for terms, v in facts["deviation_nm_rms"].items()]
    return Table("Deviation from the design, rms", ("", ""), rows)


def pixels_text(used: int, refused: dict[str, int]) -> str:
    """Pixels used and, where there are any, those on the mirror whose light curves were refused."""
    return ", ".join([f"{used:,}", *(f"not used: {count:,} {name}" for name, count in refused.items() if count)])


def _shown(value: float) -> str:
    """Three digits, or a dash for a number that does not exist."""
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _error_table(report: dict) -> Table:
    predicted, rows = report["predicted"], []
    for axis in ("x", "y"):
        estimate = Estimate(report["slope_error_urad_rms"][axis], report["slope_error_urad_rms_standard_error"][axis])
        rows.append(
            (
                f"slope {axis} [urad]",
                str(estimate),
                _shown(predicted["slope_error_urad_rms"][axis]),
                _shown(predicted["slope_ray_noise_urad_rms"][axis]),
                _shown(predicted["slope_line_sampling_urad_rms"][axis]),
            )
        )
    for terms, value in report["height_error_nm_rms"].items():
        estimate = Estimate(value, report["height_error_nm_rms_standard_error"][terms])
        parts = (
            [
                _shown(predicted[key])
                for key in ("height_error_nm_rms_piston_tilt", "height_ray_noise_nm_rms", "height_line_sampling_nm_rms")
            ]
            if terms == "piston_tilt"
            else [""] * 3
        )
        rows.append((f"height without {terms.replace('_', ', ')} [nm]", str(estimate), *parts))
    return Table("Error, rms over the pixels used", ("", "actual", "predicted", "ray noise", "line sampling"), rows)


def _target_table(target: dict) -> Table:
    chosen = target["predicted"]
    rows = [
        ("reached", f"{target['reached_nm']:.3g} nm" + ("" if target["met"] else ": MISSED")),
        ("predicted", f"{chosen['height_nm']:.3g} nm, of which {chosen['floor_nm']:.3g} nm without ray noise"),
        (
            "setting",
            f"--estimator {chosen['estimator']} --sampler {chosen['sampler']} --precision {chosen['precision']} "
            f"{'--smoothing ' * chosen['smoothing']}--measure {chosen['measure']} "
            f"--rays-per-pixel {chosen['rays_per_pixel']}",
        ),
        ("runs", str(target["attempts"])),
    ]
    return Table(f"Target: height error {target['target_nm']:g} nm, piston and tilt removed", ("", ""), rows)


def _parts_table(report: dict) -> Table:
    rows = [
        (part["part"], *(_shown(part["slope_urad_rms"][axis]) for axis in "xy"), _shown(part["height_nm_rms"]))
        for part in report["error_parts"]
    ]
    head = ("", "slope x [urad]", "slope y [urad]", "height [nm]")
    return Table("Parts of the height error, rms, piston and tilt removed", head, rows)


def write_html(path: Path, report: dict, figures: list[str], toml: str) -> None:
    """Write report.html beside its figures folder."""
    import jinja2

    template = (files("irtscots_cl") / "templates" / "report.html").read_text(encoding="utf-8")
    page = jinja2.Environment(autoescape=True).from_string(template)
    write_text(path, page.render(report=report, tables=summary_tables(report), figures=figures, toml=toml))
