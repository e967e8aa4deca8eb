"""The command `irtscots map`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from irtscots_cl.cli.common import command, print_json, print_tables
from irtscots_cl.cli.map_options import FORMATS_READ, add_map_options, described, disk_of, map_facts, read_map

if TYPE_CHECKING:
    from irtscots_cl.formats.height_map import HeightMap
    from irtscots_cl.maths.map_figures import MapFigures, ZernikeFigures

DEFAULT_REMOVED = "piston_tilt"
SHOWN_TERMS = 15  # of the Zernike table
SHOWN_OF_SPECTRA = 20  # rows at least, of longer tables
# What --spectrum adds: key, title, and names and units of its two columns.
SPECTRA = (
    ("psd", "Power spectral density", "frequency_per_mm", "1/mm", "psd_nm2_mm2", "nm^2 mm^2"),
    ("structure_function", "Structure function", "distance_mm", "distance [mm]", "mean_square_nm2", "nm^2"),
)


def add(commands) -> None:
    parser = command(
        commands,
        "map",
        _execute,
        "the figures of a height map: rms, PV, PVr, slopes, Zernike terms",
        "Piston, tilt, power and astigmatism are removed in turn. Slopes are differences of neighbouring pixels. PVr "
        "is the PV of the fit of 36 fringe Zernike terms plus three times the rms that it leaves.",
        example="out/result.h5 --remove piston_tilt_power",
    )
    parser.add_argument("file", metavar="FILE", type=Path, help=f"a map: {FORMATS_READ}")
    parser.add_argument(
        "--remove",
        metavar="TERMS",
        default=DEFAULT_REMOVED,
        help="what is removed for PVr, spectrum and the figures at the top of the JSON: none, piston, piston_tilt, "
        f"piston_tilt_power or piston_tilt_power_astigmatism; default {DEFAULT_REMOVED}",
    )
    parser.add_argument(
        "--spectrum",
        action="store_true",
        help="also the power spectral density and the structure function, over all directions",
    )
    add_map_options(parser)


def _execute(options: argparse.Namespace) -> int:
    height_map = read_map(options.file, options)
    from irtscots_cl.maths.low_order import TERMS
    from irtscots_cl.maths.map_figures import all_figures, figures, zernike_figures

    if options.remove not in TERMS:
        raise ValueError(f"--remove = {options.remove}: must be one of {', '.join(TERMS)}")
    x, y = _positions(height_map)
    try:
        turns = all_figures(height_map.heights_mm, x, y)
        chosen = figures(height_map.heights_mm, x, y, options.remove)
        zernike = zernike_figures(height_map.heights_mm, x, y, options.remove, disk_of(options, height_map))
        spectrum = _spectrum(height_map, _left(height_map, x, y, options.remove)) if options.spectrum else {}
    except ValueError as error:
        raise ValueError(f"{options.file}: {error}") from None
    known = height_map.pitch_mm is not None
    facts = _facts(height_map, turns, chosen, zernike, known) | spectrum
    if options.json:
        from irtscots_cl.system.atomic_files import plain

        print_json(plain(facts))
        return 0
    print(f"{options.file}: {described(height_map)}, from {height_map.origin}")
    for line in height_map.comment:
        print(f"  {line}")
    _print(facts)
    return 0


def _positions(height_map: HeightMap):
    """Places of the pixels; in pixels where the lateral scale is unknown, which changes no figure but slopes."""
    from dataclasses import replace

    return (height_map if height_map.pitch_mm else replace(height_map, pitch_mm=(1.0, 1.0))).positions_mm()


def _left(height_map: HeightMap, x, y, removed: str):
    from irtscots_cl.maths.low_order import remove_terms

    return remove_terms(x, y, height_map.heights_mm, height_map.valid, removed)


def _spectrum(height_map: HeightMap, left) -> dict[str, Any]:
    from irtscots_cl.maths.map_spectrum import radial_psd, structure_function

    if height_map.pitch_mm is None:
        raise ValueError("a spectrum needs the lateral scale, which the file does not tell: give --pitch-mm")
    psd = radial_psd(left, height_map.pitch_mm)
    pairs = structure_function(left, height_map.pitch_mm)
    return {
        "psd": {
            "frequency_per_mm": psd.frequency_per_mm.tolist(),
            "psd_nm2_mm2": (psd.psd_mm4 * 1e12).tolist(),
            "window": "hann",
            "window_share": psd.window_share,
        },
        "structure_function": {
            "distance_mm": pairs.distance_mm.tolist(),
            "mean_square_nm2": (pairs.mean_square_mm2 * 1e12).tolist(),
        },
    }


def _figure_facts(one: MapFigures, known: bool) -> dict[str, Any]:
    x, y = (slope * 1e6 if known else math.nan for slope in one.slope_rms_rad)
    return {
        "removed": one.removed,
        "pixels": one.pixels,
        "rms_nm": one.rms_mm * 1e6,
        "pv_nm": one.pv_mm * 1e6,
        "slope_rms_urad": {"x": x, "y": y},
    }


def _facts(
    height_map: HeightMap,
    turns: tuple[MapFigures, ...],
    chosen: MapFigures,
    zernike: ZernikeFigures,
    known: bool,
) -> dict[str, Any]:
    terms = f"PV of {len(zernike.nolls)} fringe Zernike terms plus 3 times the rms they leave"
    if zernike.dropped:
        terms += f"; Noll {', '.join(map(str, zernike.dropped))} left out: the pixels cannot tell them apart"
    disk = zernike.disk
    return {
        **map_facts(height_map),
        **_figure_facts(chosen, known),
        "pvr_nm": {"value": zernike.pvr_mm * 1e6, "terms": terms},
        "in_turn": [_figure_facts(one, known) for one in turns],
        "zernike": [
            {"noll": noll, "output_nm": float(value) * 1e6}
            for noll, value in zip(zernike.nolls, zernike.coefficients_mm, strict=True)
        ],
        "zernike_disk": {
            "unit": "mm" if known else "pixel",
            "radius": disk.radius_mm,
            "centre": [disk.x_mm, disk.y_mm],
            "rest_rms_nm": zernike.rest_rms_mm * 1e6,
        },
    }


def _print(facts: dict[str, Any]) -> None:
    from irtscots_cl.report.table import Table

    def shown(value: float) -> str:
        return "-" if math.isnan(value) else f"{value:.5g}"

    rows = []
    for one in facts["in_turn"]:
        slopes = one["slope_rms_urad"]
        rows.append(
            (
                one["removed"].replace("_", ", "), shown(one["rms_nm"]), shown(one["pv_nm"]), shown(slopes["x"]),
                shown(slopes["y"]),
            )
        )  # fmt: skip
    head = ("removed", "rms [nm]", "PV [nm]", "slope x rms [urad]", "slope y rms [urad]")
    disk, pvr = facts["zernike_disk"], facts["pvr_nm"]
    terms = [(str(z["noll"]), f"{z['output_nm']:.4f}") for z in facts["zernike"][:SHOWN_TERMS]]
    tables = [Table("Figures", head, rows)]
    tables.append(Table("Zernike terms", ("Noll", "nm"), terms))
    for key, title, x_name, x_unit, y_name, y_unit in SPECTRA:
        if key in facts:
            pairs = list(zip(facts[key][x_name], facts[key][y_name], strict=True))
            some = [(f"{x:.5g}", f"{y:.5g}") for x, y in pairs[:: max(1, len(pairs) // SHOWN_OF_SPECTRA)]]
            tables.append(Table(title, (x_unit, y_unit), some))
    print_tables(tables)
    print(
        f"Zernike terms of the map as it is, on the disk of radius {disk['radius']:.6g} {disk['unit']} about "
        f"{disk['centre'][0]:.6g}, {disk['centre'][1]:.6g}; they leave {disk['rest_rms_nm']:.4g} nm rms"
    )
    print(f"PVr {pvr['value']:.5g} nm ({facts['removed'].replace('_', ', ')} removed): {pvr['terms']}")
