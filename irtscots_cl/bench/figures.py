"""The benchmark's results as figures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from irtscots_cl.bench.wall import TIMES
from irtscots_cl.files import replacing


def write_figures(folder: Path, results: dict) -> None:
    """Write bench.png and, where sweeps were made, bench_scaling.png into the folder."""
    figures = {"bench.png": rate_figure(results)}
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
