"""The benchmark's results as tables."""

from __future__ import annotations

import math

from irtscots_cl.bench.accuracy import seconds_of
from irtscots_cl.bench.wall import TIMES
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.report.tables import Table


def bench_tables(results: dict) -> list[Table]:
    """All of run_bench's results: rates, one table per group, then one per sweep, then speed against error."""
    tables = _rate_tables(results["cases"]) + [_sweep_table(s) for s in results.get("scaling", {}).get("sweeps", [])]
    return tables + (_accuracy_tables(results["accuracy"]) if "accuracy" in results else [])


def _rate_tables(cases: list[dict]) -> list[Table]:
    head = ("", "M rays/s", "lowest", "highest", "of plain sphere", "of no accumulation", "multiply-adds per ray")
    return [
        Table(group, head, [
            (row["name"], *(f"{row[key] / 1e6:.1f}" for key in ("rays_per_second", "lowest", "highest")),
             f"{row['of_plain_sphere']:.2f}", f"{row['of_no_accumulation']:.2f}",
             f"{row['multiply_adds_in_a_rays_time']:.0f}")
            for row in cases if row["group"] == group])
        for group in dict.fromkeys(row["group"] for row in cases)
    ]  # fmt: skip


def _sweep_table(sweep: dict) -> Table:
    """Seconds by size, median and the rounds' extremes; the exponents below."""
    head = (sweep["unit"], "kernels [s]", "tracing [s]", "whole call [s]", "M rays/s, tracing", "")
    rows = [_point_row(point) for point in sweep["points"]]
    if sweep["exponents"]:
        rows.append(("exponent", *(_exponent_text(sweep["exponents"][name]) for name in TIMES), "", ""))
    how = f"; {sweep['how']}" if sweep["how"] else ""
    return Table(f"scaling with {sweep['name']}: {sweep['fixed']}{how}", head, rows)


def _point_row(point: dict) -> tuple[str, ...]:
    size = f"{point['size']:,}"
    if "skipped" in point:
        return size, "-", "-", "-", "-", point["skipped"]
    return (
        size,
        *(_time_text(point[name]) for name in TIMES),
        f"{point['rays'] / point['trace_seconds']['median'] / 1e6:.1f}",
        "",
    )


def _time_text(seconds: dict[str, float]) -> str:
    extremes = (
        f" ({seconds['lowest']:.3g} to {seconds['highest']:.3g})" if seconds["lowest"] < seconds["highest"] else ""
    )
    return f"{seconds['median']:.3g}{extremes}"


def _accuracy_tables(accuracy: dict) -> list[Table]:
    """All points, the points on the front, the noise exponents, the floors, and the paper's runs."""
    front = sorted((p for p in accuracy["points"] if p["on_front"]), key=seconds_of)
    head = ("kind", "sampler", "precision", "measure", "rays per pixel", "tracing [s]", "measuring [s]",
            "slope error [urad]", "height error [nm]", "on the front")  # fmt: skip
    noise = [
        (e["kind"], e["sampler"], e["precision"], e["measure"], _exponent_text(e["slope"]), _exponent_text(e["height"]))
        for e in accuracy["exponents"]
    ]
    floors = [(f["measure"], f"{f['slope_error_urad']['value']:.3g}", f"{f['height_error_nm']['value']:.3g}")
              for f in accuracy["floors"]]  # fmt: skip
    floors.append(("any, in single precision", "", f"{accuracy['rounding_height_nm']:.3g}"))
    paper = [(f"{run['rays_per_pixel']:,}", f"{run['seconds']:,.0f}", f"{run['slope_error_urad']:.3g}",
              f"{run['height_error_nm']:.3g}") for run in accuracy["paper"]]  # fmt: skip
    title = f"speed against error, {accuracy['scene']}, {accuracy['seeds']} seeds"
    of_paper = ("rays per screen pixel", "seconds", "slope error [urad]", "height error [nm]")
    return [
        Table(title, head, [_accuracy_row(p) for p in accuracy["points"]]),
        Table("the cheapest for its error, tracing and measuring", head, [_accuracy_row(p) for p in front]),
        Table("ray noise ~ rays^exponent", ("kind", "sampler", "precision", "measure", "slope", "height"), noise),
        Table("floors, without ray noise", ("measure", "slope error [urad]", "height error [nm]"), floors),
        Table("the paper's runs", of_paper, paper),
    ]


def _accuracy_row(point: dict) -> tuple[str, ...]:
    errors = (point["slope_error_urad"], point["height_error_nm"])
    return (
        point["kind"], "-" if not point["rays"] else point["sampler"], point["precision"], point["measure"],
        f"{point['rays_per_pixel']:,}",
        *(f"{point[key]['median']:.3g}" for key in ("trace_seconds", "measure_seconds")),
        *(str(Estimate(e["value"], e["standard_error"])) for e in errors), "yes" if point["on_front"] else "",
    )  # fmt: skip


def _exponent_text(fit: dict[str, float]) -> str:
    error = f" +- {fit['standard_error']:.1g}" if math.isfinite(fit["standard_error"]) else ""
    return f"{fit['exponent']:z.2f}{error}"
