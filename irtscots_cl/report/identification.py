"""What the images of a design cannot know: as data for programs, as tables, and as figures of the weak directions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.calibration.height_response import by_terms
from irtscots_cl.calibration.identification import Identification
from irtscots_cl.calibration.measures import ABERRATIONS, Measure
from irtscots_cl.calibration.observability import Direction
from irtscots_cl.calibration.parameters import parameter
from irtscots_cl.maths.zernike.indices import noll_to_nm
from irtscots_cl.report.fiducial import MapFrame, mark_x
from irtscots_cl.report.table import Table
from irtscots_cl.system.atomic_files import replacing

STEPS = {"mm": (0.1, "0.1 mm"), "rad": (1e-3, "1 mrad"), "px": (0.1, "0.1 pixel"), "relative": (1e-3, "0.1 %"),
         "um": (0.1, "0.1 um")}  # fmt: skip
HEAD = ("piston, tilt", "+ power", "+ astigmatism", "+ coma")
MOST_MEASURES, MOST_PAIRS = 14, 8  # in the tables; all are in the data
ZERNIKES_SHOWN = 12
SMALLEST_NM = 0.01  # rms of a source at its step, to be in the table


def identification_facts(found: Identification) -> dict[str, Any]:
    """All of it as plain data."""
    observation, scene = found.observation, found.observation.setup.scene
    priors, seen = observation.priors, observation.response.seen
    units = {name: parameter(name, scene).unit for name in found.sources}
    return {
        "scene": scene.name,
        "pixels": int(np.count_nonzero(seen.mask)),
        "every_pixel": seen.step,
        "centroid_standard_error_mm": observation.noise_mm,
        "sources": [
            {"name": name, "unit": units[name], "nm_per_unit": by_terms(nm)} for name, nm in found.sources.items()
        ],
        "unknowns": [
            {"name": name, "unit": units[name], "prior": priors.sigma[name], "after_images": found.posterior[name]}
            for name in priors.names
        ],
        "distances": [{"name": distance.name, "prior_mm": distance.sigma_mm} for distance in priors.distances],
        "height_nm_rms": by_terms(found.height_nm),
        "height_of_noise_nm_rms": by_terms(found.height_of_noise_nm),
        "directions": [
            {"change": d.change, "left_of_prior": d.left, "height_nm_rms": by_terms(d.rms_nm),
             "mainly": d.main_parts(priors)} for d in found.directions
        ],
        "alike": [
            {"first": pair.first, "second": pair.second, "differ": pair.differ, "ratio": pair.ratio,
             "apart_nm_per_unit": by_terms(pair.rms_nm)} for pair in found.alike
        ],
        "zernikes": [{"noll": z.noll, "noise_um": z.noise_um, "geometry_um": z.geometry_um, "total_um": z.total_um,
                      "uncalibrated_um": z.uncalibrated_um} for z in found.zernikes],
        "measures": [_measure_facts(measure) for measure in found.measures],
        "plan": [_measure_facts(measure) for measure in found.plan],
    }  # fmt: skip


def _measure_facts(measure: Measure) -> dict[str, Any]:
    return {
        "name": measure.name,
        "unit": measure.unit,
        "needed_sigma": measure.sigma,
        "buys_nm": by_terms(measure.buys_nm),
        "left_nm": by_terms(measure.after_nm),
        "mainly": measure.mainly,
        "not_possible": measure.why_not or None,
    }


def identification_tables(found: Identification) -> list[Table]:
    """The tables of the terminal."""
    pairs = sorted(found.alike, key=lambda pair: -pair.rms_nm[0] * found.observation.priors.sigma[pair.first])
    return [
        _source_table(found),
        _direction_table(found),
        *([_pair_table(found, pairs[:MOST_PAIRS])] if pairs else []),
        _zernike_table(found),
        *_measure_tables(found),
    ]


def _nm(values: Any) -> tuple[str, ...]:
    """Heights in nm, three digits, hundredths at most."""
    return tuple(f"{value:.0f}" if value >= 999.5 else f"{value:.3g}" if value >= 1 else f"{value:.2f}"
                 for value in values)  # fmt: skip


def _step(found: Identification, name: str) -> tuple[float, str]:
    known = parameter(name, found.observation.setup.scene)
    return STEPS.get(known.unit, (float(f"{known.scale:.1g}"), f"{known.scale:.1g}"))


def _source_table(found: Identification) -> Table:
    rows, small = [], 0
    for name, nm in found.sources.items():
        step, text = _step(found, name)
        if nm[0] * step < SMALLEST_NM:
            small += 1
            continue
        rows.append((name, text, *_nm(nm * step)))
    if small:
        rows.append((f"{small} more", "", *[f"below {SMALLEST_NM}"] * 4))
    name = found.observation.setup.scene.name
    title = f"{name}: rms height error [nm] if one thing is off and the design is taken for true, after removing"
    return Table(title, ("unknown", "off by", *HEAD), rows)


def _direction_table(found: Identification) -> Table:
    rows = [(", ".join(_parts(found, d)), f"{100 * d.left:.3g} %", *_nm(d.rms_nm)) for d in found.directions]
    title = "What the images leave open: combinations of unknowns at one standard deviation, and their height [nm rms]"
    return Table(title, ("together", "of the prior", *HEAD), rows)


def _parts(found: Identification, direction: Direction) -> list[str]:
    """The main parts with their changes, the first one positive."""
    names = direction.main_parts(found.observation.priors)
    sign = 1 if not names or direction.change[names[0]] > 0 else -1
    units = {name: parameter(name, found.observation.setup.scene).unit for name in names}
    return [f"{name.rpartition('_')[0] if units[name] else name} {shown(sign * direction.change[name], units[name])}"
            for name in names]  # fmt: skip


def shown(value: float, unit: str, sign: str = "+") -> str:
    """A number of an unknown with its unit, two digits: radians as mrad, shares as percent."""
    factor, text = {"rad": (1e3, " mrad"), "relative": (1e2, " %"), "px": (1, " px"), "": (1, "")}.get(
        unit, (1, f" {unit}")
    )
    return f"{value * factor:{sign}.2g}{text}"


def _pair_table(found: Identification, pairs: list[Any]) -> Table:
    rows = []
    for pair in pairs:
        step, text = _step(found, pair.first)
        rows.append((f"{pair.first}, {pair.second}", f"{100 * pair.differ:.2g} %", text, *_nm(pair.rms_nm * step)))
    title = "Look alike in the images: moved apart by so much, half each, they leave [nm rms]"
    return Table(title, ("unknowns", "differ by", "apart", *HEAD), rows)


def _zernike_table(found: Identification) -> Table:
    rows = []
    for z in found.zernikes[:ZERNIKES_SHOWN]:
        n, m = noll_to_nm(z.noll)
        values = (z.uncalibrated_um, z.geometry_um, z.noise_um, z.total_um)
        rows.append((str(z.noll), ABERRATIONS.get((n, abs(m)), ""), *_nm(value * 1e3 for value in values)))
    title = f"Zernike terms: standard deviation [nm], centroids to {found.observation.noise_mm * 1e3:.3g} um"
    head = ("Noll", "", "geometry of the priors", "geometry left by the images", "noise", "in all")
    return Table(title, head, rows)


def _measure_tables(found: Identification) -> list[Table]:
    def rows(measures: list[Measure]) -> list[tuple[str, ...]]:
        return [
            (m.name, "" if m.sigma is None else shown(m.sigma, m.unit, ""), m.why_not or m.mainly,
             *_nm(m.buys_nm), *_nm(m.after_nm[:2])) for m in measures
        ]  # fmt: skip

    possible = [m for m in found.measures if not m.why_not][:MOST_MEASURES]
    head = ("measure", "to", "mostly of", *HEAD, "left", "+ power")
    now = f"now {' / '.join(_nm(found.height_nm))} nm rms, of noise {' / '.join(_nm(found.height_of_noise_nm))}"
    tables = [
        Table(f"What to measure next, and what it alone would buy [nm rms]; {now}", head,
              rows(possible + [m for m in found.measures if m.why_not])),
    ]  # fmt: skip
    if found.plan:
        title = "One after the other, each the number that buys most of what is left without piston and tilt"
        tables.append(Table(title, head, rows(found.plan)))
    return tables


def write_direction_figure(found: Identification, folder: Path) -> str:
    """Maps of the weak directions as one PNG file in the folder; its name."""
    from matplotlib.figure import Figure

    name, seen = "weak_directions.png", found.observation.response.seen
    columns = min(3, len(found.directions))
    rows = -(-len(found.directions) // columns)
    figure = Figure(figsize=(4.8 * columns, 4.3 * rows), layout="tight")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    frame = MapFrame.of(seen.x_mm, seen.y_mm, seen.mask)
    for axes, direction in zip(grid, found.directions, strict=False):
        map_nm = direction.height_nm[frame.cut]
        largest = np.nanmax(np.abs(map_nm)) or 1.0
        picture = axes.imshow(map_nm, origin="lower", extent=frame.extent, cmap="RdBu_r",
                              vmin=-largest, vmax=largest)  # fmt: skip
        parts = _parts(found, direction)[:4]
        lines = [", ".join(parts[k : k + 2]) for k in range(0, len(parts), 2)]
        axes.set_title("\n".join([f"{direction.rms_nm[0]:.3g} nm rms", *lines]), fontsize=8)
        axes.set(xlabel=frame.x_label, ylabel=frame.y_label)
        mark_x(axes, frame.towards)
        figure.colorbar(picture, ax=axes, label="nm")
    for axes in grid[len(found.directions) :]:
        axes.set_axis_off()
    with replacing(folder / name) as temporary:
        figure.savefig(temporary, dpi=120)
    return name
