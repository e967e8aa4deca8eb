"""The benchmark's results as tables."""

from __future__ import annotations

import math

from irtscots_cl.bench.wall import TIMES
from irtscots_cl.report import Table


def bench_tables(results: dict) -> list[Table]:
    """All of run_bench's results: rates, one table per group, then one per sweep."""
    return _rate_tables(results["cases"]) + [_sweep_table(s) for s in results.get("scaling", {}).get("sweeps", [])]


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


def _exponent_text(fit: dict[str, float]) -> str:
    error = f" +- {fit['standard_error']:.1g}" if math.isfinite(fit["standard_error"]) else ""
    return f"{fit['exponent']:z.2f}{error}"
