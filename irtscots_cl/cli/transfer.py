"""The command `irtscots transfer`."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from irtscots_cl.cli.common import add_no_figures, add_scene, command, figures, print_json, print_tables, warn
from irtscots_cl.cli.map_options import add_map_options, told_of_map
from irtscots_cl.scene.presets import load_scene

FILE = "transfer.json"


def add(commands) -> None:
    parser = command(
        commands,
        "transfer",
        _execute,
        "say how a test shows ripples of the mirror, by their period: the instrument transfer function",
        "Prints the response of the measured slopes and heights to a wave on the mirror, factor by factor, the periods "
        "of half response and of Nyquist, and, with --psd, the power spectral density of a measured map as that of the "
        "mirror. Only the scene's design is used, and no device.",
        example="sphere-deviated --periods 50,20,10",
    )
    add_scene(parser)
    parser.add_argument(
        "--measure",
        metavar="M",
        default="paper",
        help="paper (default), fine, refined, likelihood or windowed, as of `irtscots run` and `reconstruct`",
    )
    parser.add_argument(
        "--fringes", type=float, metavar="P", help="fringes, not lines: periods over the screen of the highest series"
    )
    waves = parser.add_mutually_exclusive_group()
    waves.add_argument(
        "--periods",
        metavar="MM,...",
        help="periods of the waves in mm, with commas between; default: 12 from a quarter of the mirror's diameter to "
        "the shortest that the pixels show",
    )
    waves.add_argument("--frequencies", metavar="F,...", help="frequencies in 1/mm instead")
    others = (
        ("--direction", "DEG", 0.0, "of the waves, from the mirror's +x towards +y; default 0"),
        ("--ripple", "NM", 1.0, "amplitude of the waves; default 1"),
        ("--floor", "R", 0.1, "least response with a corrected density; default 0.1"),
    )
    for option, letter, default, text in others:
        parser.add_argument(option, type=float, metavar=letter, default=default, help=text)
    parser.add_argument(
        "--at", type=float, nargs=2, metavar=("X", "Y"), help="place on the mirror in mm; default: its centre"
    )
    parser.add_argument(
        "--psd",
        type=Path,
        metavar="FILE",
        help="a measured height map, or the result.h5 of this program: its power spectral density, corrected",
    )
    parser.add_argument(
        "--remove",
        metavar="TERMS",
        default="piston_tilt",
        help="what is taken out of a --psd map first: none, piston, piston_tilt (default), piston_tilt_power or "
        "piston_tilt_power_astigmatism",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help=f"write {FILE} and a figure there")
    add_no_figures(parser)
    add_map_options(parser, "of the light, for diffraction at the camera's aperture; also of a --psd map in waves")


def _execute(options: argparse.Namespace) -> int:
    periods = _periods(options)
    scene = load_scene(options.scene)
    from irtscots_cl.measurement.transfer_function import TransferFunction
    from irtscots_cl.measurement.transfer_spectrum import mirror_psd
    from irtscots_cl.measurement.transfer_summary import summarise
    from irtscots_cl.pipeline.transfer import doubts_of_low_orders, read_measured_map
    from irtscots_cl.report.transfer import NAME, sentences, transfer_facts, transfer_tables, write_transfer_figure
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder, plain, write_json

    if options.out is not None:
        check_output_folder(options.out, (FILE,), ("figures",))
    transfer = TransferFunction.of(scene, options.measure, options.fringes, options.wavelength_nm)
    place = None if options.at is None else (options.at[0], options.at[1])
    found, psd = summarise(transfer, periods, options.direction, place, options.ripple), None
    if options.psd is not None:
        measured, doubts = read_measured_map(options.psd, told_of_map(options))
        for text in (*doubts, *doubts_of_low_orders(options.psd, measured, options.remove)):
            warn(text)
        psd = mirror_psd(transfer, measured, options.floor, options.remove)
    for text in found.warnings:
        warn(text)
    facts = plain(transfer_facts(found, psd, options.remove))
    if options.out is not None:
        with made_folder(options.out):
            figures(options, options.out / "figures", (NAME,), partial(write_transfer_figure, found, psd=psd))
            write_json(options.out / FILE, facts)
    if options.json:
        print_json(facts)
        return 0
    print_tables(transfer_tables(found, psd))
    print("\n".join(sentences(found, periods is not None)))
    if options.out is not None:
        print(f"results in {options.out}")
    return 0


def _periods(options: argparse.Namespace) -> list[float] | None:
    """The periods asked for in mm; None for the default ones. Raises ValueError for what is no list of numbers."""
    name, text = (
        ("--periods", options.periods) if options.periods is not None else ("--frequencies", options.frequencies)
    )
    if text is None:
        return None
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = [0.0]
    if not all(0 < value < float("inf") for value in values):
        raise ValueError(f"{name} = {text}: must be numbers above 0 with commas between")
    return values if name == "--periods" else [1 / value for value in values]
