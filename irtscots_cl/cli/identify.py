"""The command `irtscots identify`."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from irtscots_cl.cli.common import add_no_figures, add_scene, command, figures, print_json, print_tables
from irtscots_cl.scene.presets import load_scene


def add(commands) -> None:
    parser = command(
        commands,
        "identify",
        _execute,
        "say what the images of a test will not tell, in nanometres, before there are any",
        "Prints the height error that each unknown of the geometry makes, the combinations of unknowns that images "
        "leave open, what that does to the mirror's Zernike terms, and what is best measured next. What is known "
        "beforehand comes from the scene's table [calibration.known]; where it says nothing, from usual tolerances. "
        "Only the scene's design is used, and no device.",
        example="sphere-deviated --out identified",
    )
    add_scene(parser)
    parser.add_argument(
        "--noise-um",
        type=float,
        metavar="S",
        help="standard error of each centroid on the screen, in um; default: a hundredth of the screen's pitch",
    )
    parser.add_argument(
        "--orders",
        type=int,
        default=7,
        metavar="N",
        help="highest radial order of the mirror's Zernike terms, 4 to 20; default 7",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="write identify.json and figures there")
    add_no_figures(parser)


def _execute(options: argparse.Namespace) -> int:
    if not 4 <= options.orders <= 20:
        raise ValueError(f"--orders = {options.orders}: must be from 4 to 20")
    if options.noise_um is not None and not 0 < options.noise_um < 1e9:
        raise ValueError(f"--noise-um = {options.noise_um}: must be a number above 0 and below 1e9")
    scene = load_scene(options.scene)
    from irtscots_cl.calibration.identification import identify
    from irtscots_cl.report.identification import identification_facts, identification_tables, write_direction_figure
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder, plain, write_json

    if options.out is not None:
        check_output_folder(options.out, ("identify.json",), ("figures",))
    last = (options.orders + 1) * (options.orders + 2) // 2
    noise_mm = None if options.noise_um is None else options.noise_um * 1e-3
    found = identify(scene, noise_mm=noise_mm, nolls=range(4, last + 1))
    facts = identification_facts(found)
    if options.out is not None:
        with made_folder(options.out):
            figures(options, options.out / "figures", ("weak_directions.png",), partial(write_direction_figure, found))
            write_json(options.out / "identify.json", facts)
    if options.json:
        print_json(plain(facts))
        return 0
    print_tables(identification_tables(found))
    if options.out is not None:
        print(f"results in {options.out}")
    return 0
