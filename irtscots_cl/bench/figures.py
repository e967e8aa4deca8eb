"""The benchmark's results as figures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from irtscots_cl.bench.accuracy import seconds_of
from irtscots_cl.bench.wall import TIMES
from irtscots_cl.system.atomic_files import replacing


def write_figures(folder: Path, results: dict) -> None:
    """Write bench.png into the folder, and bench_scaling.png and bench_accuracy.png if there are results for them."""
    figures = {"bench.png": rate_figure(results)}
    if "accuracy" in results:
        figures["bench_accuracy.png"] = accuracy_figure(results)
    if "scaling" in results:
        figures["bench_scaling.png"] = scaling_figure(results)
    for name, figure in figures.items():
        with replacing(folder / name) as temporary:
            figure.savefig(temporary, dpi=120)


def _title(results: dict) -> str:
    return f"{results['device']['name']}, {results['device']['platform']}"


def rate_figure(results: dict) -> Figure:
    """Bars of all cases, with whiskers from the slowest to the fastest round."""
    rows = results["cases"][::-1]
    figure = Figure(figsize=(9, 0.28 * len(rows) + 1.2), layout="constrained")
    axes = figure.subplots()
    rates = np.array([[row[key] for row in rows] for key in ("lowest", "rays_per_second", "highest")]) / 1e6
    axes.barh(range(len(rows)), rates[1], xerr=np.abs(np.diff(rates, axis=0)), color="tab:blue", ecolor="0.3")
    axes.set_yticks(range(len(rows)), [f"{row['group'].split(',')[0]}: {row['name']}" for row in rows], fontsize=7)
    axes.set(xlabel="M rays/s", title=_title(results))
    return figure


def scaling_figure(results: dict) -> Figure:
    """Seconds against size, both logarithmic, one panel per sweep; the exponents are in the legends."""
    sweeps = results["scaling"]["sweeps"]
    figure = Figure(figsize=(10, 4 * ((len(sweeps) + 1) // 2)), layout="constrained")
    for axes, sweep in zip(figure.subplots(-(-len(sweeps) // 2), 2, squeeze=False).flat, sweeps, strict=False):
        timed = [point for point in sweep["points"] if "skipped" not in point]
        for name, marker in zip(TIMES, "os^", strict=True):
            times = np.array([[point[name][key] for key in ("lowest", "median", "highest")] for point in timed])
            label = name.removesuffix("_seconds")
            if sweep["exponents"]:
                label += f": exponent {sweep['exponents'][name]['exponent']:z.2f}"
            if timed:
                axes.errorbar([point["size"] for point in timed], times[:, 1], np.abs(np.diff(times, axis=1)).T,
                              marker=marker, capsize=3, label=label)  # fmt: skip
        if timed:
            axes.set(xscale="log", yscale="log")
            axes.legend(fontsize=8)
        axes.set(xlabel=sweep["unit"], ylabel="seconds")
        axes.set_title(f"{sweep['name']}: {sweep['fixed']}", fontsize=9)
    figure.suptitle(_title(results))
    return figure


KIND_COLOURS = {"forward": "tab:orange", "adjoint": "tab:blue", "smoothed": "tab:green", "analytic": "black"}
SAMPLER_MARKERS = {"philox": "o", "sobol": "s", "lattice": "^"}


def accuracy_figure(results: dict) -> Figure:
    """Slope and height error against seconds, both logarithmic; a row of panels for each method."""
    accuracy = results["accuracy"]
    measures = [floor["measure"] for floor in accuracy["floors"]]
    figure = Figure(figsize=(12, 4.6 * len(measures)), layout="constrained")
    grid = figure.subplots(len(measures), 2, squeeze=False, sharex=True, sharey="col")
    for row, measure in zip(grid, measures, strict=True):
        for axes, key, label in zip(
            row, ("slope_error_urad", "height_error_nm"), ("slope error [urad]", "height error [nm]"), strict=True
        ):
            _error_panel(axes, accuracy, measure, key)
            axes.set(xscale="log", yscale="log", ylabel=label, title=f"measure {measure}")
            axes.xaxis.set_tick_params(labelbottom=True)
        row[0].legend(fontsize=7)
    for axes in grid[-1]:
        axes.set_xlabel("seconds, tracing and measuring")
    figure.suptitle(f"{accuracy['scene']}: {_title(results)}")
    return figure


def _error_panel(axes, accuracy: dict, measure: str, key: str) -> None:
    """One method's series, its floor, the paper's runs, and rings around the points on the front."""
    points = [point for point in accuracy["points"] if point["measure"] == measure]
    for name in dict.fromkeys((p["kind"], p["sampler"], p["precision"]) for p in points):
        mine = [p for p in points if (p["kind"], p["sampler"], p["precision"]) == name]
        kind, sampler, precision = name
        axes.errorbar(
            [seconds_of(p) for p in mine], [p[key]["value"] for p in mine],
            np.nan_to_num([p[key]["standard_error"] for p in mine]), color=KIND_COLOURS[kind],
            marker=SAMPLER_MARKERS[sampler], ms=4, lw=1, ls="--" if precision == "fp64" else "-", capsize=2,
            label=kind if kind == "analytic" else f"{kind}, {sampler}, {precision}",
        )  # fmt: skip
    front = [p for p in points if p["on_front"]]
    axes.plot([seconds_of(p) for p in front], [p[key]["value"] for p in front], "o", ms=11, mfc="none", mec="tab:red",
              label="cheapest for its height error")  # fmt: skip
    floor = next(f for f in accuracy["floors"] if f["measure"] == measure)
    axes.axhline(floor[key]["value"], color="0.5", ls=":", label="floor without ray noise")
    axes.plot([run["seconds"] for run in accuracy["paper"]], [run[key] for run in accuracy["paper"]], "*", ms=11,
              color="tab:purple", label="the paper's runs")  # fmt: skip
