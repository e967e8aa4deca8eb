"""Results as tables, for the terminal and the HTML page."""

from __future__ import annotations

import math
from typing import Literal, cast

from irtscots_cl.analysis.error_terms import ErrorTerm
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.report.along_axes import AlongAxes
from irtscots_cl.report.table import Table as Table
from irtscots_cl.report.types import (
    ErrorPart,
    IslandReport,
    MeasuredFacts,
    MisfitFacts,
    NoiseFacts,
    PathReport,
    Refused,
    Report,
    Target,
    ZernikeFacts,
    ZernikeFitFacts,
)
from irtscots_cl.tracing.options import ANALYTIC

CLEAR = 3.0  # standard errors: smaller coefficients are counted, not listed

ROUNDING_SHARE = 0.5  # of all other errors: more rounding than that is said


def path_tables(facts: PathReport) -> list[Table]:
    """The paths by flux, the numbers of rays by how they ended, and the places where light was absorbed."""
    shown = [path for path in facts["paths"] if path["rays"]]
    stray = [(s["kind"], f"{s['of_direct']:.3g}",
              str(Estimate(s["height_nm_rms"], s["height_nm_rms_standard_error"])), str(s["lost_pixels"]))
             for s in facts["stray_light"]]  # fmt: skip
    flux = {s["end"]: str(Estimate(s["flux_w"], s["flux_standard_error_w"])) for s in facts["staying"] if s["flux_w"]}
    flux |= {"launched": f"{facts['launched_w']:.5g}", "detected": f"{sum(p['flux_w'] for p in facts['paths']):.5g}"}
    shown_end = {"bounce limit": f"given up after {facts['bounce_limit']} events (--bounce-limit)"}
    ends = [(shown_end.get(end, end), f"{count:,}", flux.get(end, ""))
            for end, count in facts["ends"].items() if count or end in flux]  # fmt: skip
    ends += [(end, "", watts) for end, watts in flux.items() if end not in facts["ends"]]
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
    """A length rounded to a micrometre, or an empty string if it is not finite."""
    return f"{round(length_mm, 3) + 0.0:.3f}" if math.isfinite(length_mm) else ""  # + 0.0 avoids -0


def error_term_facts(part: ErrorTerm) -> ErrorPart:
    x, y = part.slope_urad
    return {"part": part.name, "slope_urad_rms": {"x": x, "y": y}, "height_nm_rms": part.height_nm}


def as_xy(values: tuple[float, float]) -> AlongAxes:
    return {"x": values[0] * 1e6, "y": values[1] * 1e6}


def summary_tables(report: Report) -> list[Table]:
    """The short tables of a run: speed, errors and their predictions, islands, Zernike coefficients of the scene."""
    tables = [_run_table(report), _error_table(report)]
    if "noise" in report:
        tables.insert(1, _noise_table(report["noise"]))
    if report["error_parts"]:
        tables.append(_parts_table(report))
    if "target" in report:
        tables.insert(0, _target_table(report["target"]))
    tables += island_tables(report["islands"])
    rows = [row for row in report["zernike"] if row["input_um"] != 0]
    if rows:
        tables.append(_zernike_table(rows, report["zernike_fit"]))
    return tables


def _zernike_table(rows: list[ZernikeFacts], fit: ZernikeFitFacts) -> Table:
    """in: of the scene; of it: what the fit over the pixels gives for the true mirror, where that differs."""
    if fit["kind"] == "annular":
        rows = [row for row in rows if abs(row["input_um"]) >= 1e-4 or row["noll"] <= 4]
    differs = any(abs(row["expected_um"] - row["input_um"]) >= 1e-4 for row in rows if row["noll"] > 1)
    head = ("term", "in [um]", *(["of it over the pixels [um]"] if differs else []), "out [um]", "difference [nm]")
    shown = []
    for row in rows:
        known = math.isfinite(row["output_um"])
        over = [f"{row['expected_um']:.4f}" if known else "-"] if differs else []
        out = str(Estimate(row["output_um"], row["standard_error_um"])) if known else "not separable"
        difference = f"{(row['output_um'] - row['expected_um']) * 1e3:+.2f}" if known else "-"
        shown.append((str(row["noll"]), f"{row['input_um']:.4f}", *over, out, difference))
    return Table(f"Zernike coefficients ({_zernike_kind(fit)}), condition {fit['condition']:.3g}", head, shown)


def _zernike_kind(fit: ZernikeFitFacts) -> str:
    return f"annular, hole {fit['obscuration_ratio']:.3g}" if fit["kind"] == "annular" else "Noll"


def island_tables(islands: IslandReport) -> list[Table]:
    """A table of the islands, none where the mask is one."""
    if islands["count"] == 1:
        return []
    rows = [
        (str(k), f"{i['pixels']:,}", str(i["group"]),
         f"{i['piston_standard_error_nm']:.2g}" if i["piston_known"] else "unknown", f"{i['nm_rms']:.4g}")
        for k, i in enumerate(islands["largest"], 1)
    ]  # fmt: skip
    groups = f"{islands['groups']} joined group{'s' * (islands['groups'] > 1)}"
    title = (
        f"{islands['count']} islands in {groups}, the largest of "
        f"{islands['pixels_in_heights']:,} pixels; {islands['own_pistons_nm_rms']:.4g} nm rms with own pistons"
    )
    head = ("island", "pixels", "group", "piston, standard error [nm]", "own rms [nm]")
    return [Table(title, head, rows)]


def misfit_text(misfit: MisfitFacts) -> str:
    """The misfit of integration beside noise and limit."""
    noise = misfit["noise_urad_rms"]
    of_noise = f"noise {noise:.3g}, " if math.isfinite(noise) else ""
    return f"{_shown(misfit['urad_rms'])} urad ({of_noise}limit {_shown(misfit['limit_urad_rms'])})"


def _run_table(report: Report) -> Table:
    seconds, ledger, refused = report["seconds"], report["ledger"], report["light_curves_refused"]
    fates = ", ".join(
        f"{name.replace('_', ' ')} {count:,}" for name, count in ledger.items() if count and name != "launched"
    )
    rays = [
        ("rays", f"{report['rays_total']:,}"),
        ("rays/s", f"{report['rays_per_second'] / 1e6:.1f} M"),
        ("ledger", fates),
    ]
    return Table(
        f"{report['scene']}, {report['estimator']} estimator on {report['device']['name']}",
        ("", ""),
        [
            *([] if report["estimator"] == ANALYTIC else rays),
            ("seconds", ", ".join(f"{name} {value:.2f}" for name, value in seconds.items())),
            ("pixels used", pixels_text(report["pixels_used"], refused)),
            ("slopes of no surface", misfit_text(report["integration_misfit"])),
            *_model_rows(report),
        ],
    )


def _model_rows(facts: Report | MeasuredFacts) -> list[tuple[str, str]]:
    """Pixels whose light has no closed form, where there are any."""
    counts = {"traced light": facts["pixels_with_traced_light"], "no model": facts["pixels_without_model"]}
    words = ", ".join(f"{count:,} {name}" for name, count in counts.items() if count)
    return [("without a closed form", words)] if words else []


def measured_tables(facts: MeasuredFacts) -> list[Table]:
    """The results of pipeline.measure for a lab's images: the deviation, the islands, the Zernike coefficients, and the
    checks that did not pass."""
    rows = [("pixels used", pixels_text(facts["pixels_used"], facts["light_curves_refused"]))]
    rows += _model_rows(facts)
    rows += [(f"without {terms.replace('_', ', ')} [nm]", f"{v:.4g}") for terms, v in facts["deviation_nm_rms"].items()]
    rows += [("peak to valley, without piston, tilt [nm]", f"{facts['deviation_nm_pv']:.4g}")]
    if math.isfinite(facts["height_standard_error_nm"]):
        slopes, bound = facts["slope_standard_error_urad"], facts["of_bound"]
        rows += [
            ("standard error of the height [nm]", f"{facts['height_standard_error_nm']:.3g}"),
            ("standard error of the slopes [urad]", f"{slopes['x']:.3g}, {slopes['y']:.3g}"),
        ]
        if math.isfinite(bound["x"]):
            rows += [("centroids' error / Cramer-Rao bound", f"{bound['x']:.3g}, {bound['y']:.3g}")]
    rows += [("slopes of no surface", misfit_text(facts["integration_misfit"]))]
    tables = [Table("Deviation from the design, rms", ("", ""), rows), *island_tables(facts["islands"])]
    tables.append(_coefficient_table(facts))
    failed = [(c["name"], c["level"], c["text"]) for c in facts["checks"] if c["level"] != "ok"]
    passed = len(facts["checks"]) - len(failed)
    if failed:
        tables.append(Table(f"Checks of the images: {passed} passed, these did not", ("check", "level", ""), failed))
    return tables


def _coefficient_table(facts: MeasuredFacts) -> Table:
    fit = facts["zernike_fit"]
    terms = facts["zernike"]
    # without errors all are shown; NaN is no small number
    clear = [t for t in terms if not abs(t["output_um"]) < CLEAR * t["standard_error_um"]]
    rows = [(str(t["noll"]), str(Estimate(t["output_um"], t["standard_error_um"]))) for t in clear]
    if len(clear) < len(terms):
        rows.append((f"{len(terms) - len(clear)} others", f"below {CLEAR:g} standard errors; all with --json"))
    rows += [("errors from", fit["standard_errors_from"]), ("condition", f"{fit['condition']:.3g}")]
    rows += [("left by the fit", f"{fit['residual_nm_rms']:.3g} nm rms")]
    return Table(f"Zernike coefficients ({_zernike_kind(fit)})", ("term", "[um]"), rows)


def pixels_text(used: int, refused: Refused) -> str:
    """Number of pixels used and, if any, of pixels on the mirror with unusable light curves."""
    return ", ".join([f"{used:,}", *(f"not used: {count:,} {name}" for name, count in refused.items() if count)])


def _shown(value: float) -> str:
    """Three digits, or a dash for NaN."""
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _error_table(report: Report) -> Table:
    predicted = report["predicted"]
    rows: list[tuple[str, ...]] = []
    for axis in ("x", "y"):
        estimate = Estimate(report["slope_error_urad_rms"][axis], report["slope_error_urad_rms_standard_error"][axis])
        rows.append(
            (
                f"slope {axis} [urad]",
                str(estimate),
                _shown(predicted["slope_error_urad_rms"][axis]),
                _shown(predicted["slope_ray_noise_urad_rms"][axis]),
                _shown(predicted["slope_line_sampling_urad_rms"][axis]),
                "",
                "",
            )
        )
    errors = cast("dict[str, float]", report["height_error_nm_rms_standard_error"])
    for terms, value in cast("dict[str, float]", report["height_error_nm_rms"]).items():
        estimate = Estimate(value, errors[terms])
        parts = (
            [
                _shown(predicted[key])
                for key in (
                    "height_error_nm_rms_piston_tilt",
                    "height_ray_noise_nm_rms",
                    "height_line_sampling_nm_rms",
                    "height_systematic_nm_rms",
                    "height_rounding_nm_rms",
                )
            ]
            if terms == "piston_tilt"
            else [""] * 5
        )
        rows.append((f"height without {terms.replace('_', ', ')} [nm]", str(estimate), *parts))
    said = f"predicted is a bound: {predicted['bound']}" if predicted["bound"] else ""
    head = ("", "actual", "predicted", "ray noise (of the simulation)", "line sampling", "all systematic", "rounding")
    return Table("Error, rms over the pixels used" + (f"; {said}" if said else ""), head, rows)


def cautions(facts: Report | MeasuredFacts) -> list[str]:
    """What should be known of a measurement before it is believed, one line each."""
    said, used = [], facts["pixels_used"]
    if facts["pixels_without_model"]:
        said.append(
            f"{facts['pixels_without_model']} of {used} pixels have no model of their light: they keep plain centroids"
        )
    if facts["refinement_converged"] is False:
        updates = ", ".join(f"{update:.2g}" for update in facts["refinement_updates_nm"])
        said.append(f"the refinement has not converged: its rounds changed {updates} nm rms")
    if "predicted" in facts:
        report = cast("Report", facts)
        predicted = report["predicted"]
        rounding = predicted["height_rounding_nm_rms"]
        others = math.hypot(predicted["height_ray_noise_nm_rms"], predicted["height_systematic_nm_rms"])
        if rounding > ROUNDING_SHARE * others and report["precision"] == "fp32":
            said.append(
                f"single precision adds {rounding:.2g} nm rms to the height, all other errors {others:.2g} nm; "
                "--precision fp64 does not"
            )
        if predicted["bound"]:
            said.append(f"the predicted height error is a bound, no estimate: {predicted['bound']}")
    return said


def _target_table(target: Target) -> Table:
    chosen = target["predicted"]
    rows = [
        ("reached", f"{target['reached_nm']:.3g} nm" + ("" if target["met"] else ": MISSED")),
        (
            "predicted",
            f"{chosen['height_nm']:.3g} nm, of which {chosen['floor_nm']:.3g} nm without ray noise (of the simulation)",
        ),
        (
            "setting",
            f"--estimator {chosen['estimator']} --sampler {chosen['sampler']} --precision {chosen['precision']} "
            f"{'--smoothing ' * chosen['smoothing']}--measure {chosen['measure']} "
            f"--rays-per-pixel {chosen['rays_per_pixel']}",
        ),
        ("runs", str(target["attempts"])),
    ]
    return Table(f"Target: height error {target['target_nm']:g} nm, piston and tilt removed", ("", ""), rows)


def _noise_table(noise: NoiseFacts) -> Table:
    """What the camera and the screen did to the images."""
    rows = [("images in", noise["unit"])]
    if math.isfinite(noise["electrons_at_peak"]):
        rows.append(("electrons at peak", f"{noise['electrons_at_peak']:.4g}"))
    if math.isfinite(noise["saturation"]):
        rows.append((f"saturated at [{noise['unit']}]", f"{noise['saturation']:g}"))
    parts: tuple[Literal["detector", "screen"], ...] = ("detector", "screen")
    for part in parts:
        if values := noise[part]:
            rows.append((part, ", ".join(f"{key} {value}" for key, value in values.items())))
    return Table("Noise", ("", ""), rows)


def _parts_table(report: Report) -> Table:
    rows = [
        (part["part"], *(_shown(part["slope_urad_rms"][axis]) for axis in ("x", "y")), _shown(part["height_nm_rms"]))
        for part in report["error_parts"]
    ]
    head = ("", "slope x [urad]", "slope y [urad]", "height [nm]")
    return Table("Parts of the height error, rms, piston and tilt removed", head, rows)
