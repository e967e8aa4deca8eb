"""The command `irtscots design-patterns`."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from irtscots_cl.cli.common import add_no_figures, add_scene, choices, command, figures, print_json, print_tables
from irtscots_cl.cli.terminal import next_step
from irtscots_cl.scene.presets import load_scene, with_noise_file

FILE = "design-patterns.json"
CAMERA = ("electrons", "full_well_e", "read_noise_e", "bits", "exposure_s", "frame_s")


def add(commands) -> None:
    parser = command(
        commands,
        "design-patterns",
        _execute,
        "say which patterns suit a test and its camera, in nanometres, before there are any images",
        "Prints the rms height error that the camera's noise makes with line scans and with fringes of several series, "
        "at equal frames, equal light and equal time, against the Cramer-Rao bound; how many periods the highest "
        "series may have; and the command that writes the best pictures. Only the scene's design is used, and no "
        "device.",
        example="sphere-deviated --electrons 9000 --frames 48",
    )
    add_scene(parser)
    parser.add_argument(
        "--camera-noise",
        metavar="FILE",
        help="TOML file with [camera.detector.noise] or [screen.response], in place of the scene's own tables",
    )
    numbers = (
        ("--electrons", "electrons", "E", "electrons in the brightest pixel under a white screen; default: of the "
         "scene's noise table, or 0.9 of the full well"),
        ("--full-well", "full_well_e", "E", "full well in electrons; default: of the table, or 10000"),
        ("--read-noise", "read_noise_e", "E", "rms read noise in electrons; default: of the table, or 2.5"),
        ("--exposure", "exposure_s", "S", "exposure in s that brings those electrons; default: of the table, or 0.05"),
        ("--frame-time", "frame_s", "S", "time of a frame in s besides its exposure: the screen settles, the camera is "
         "read; default 0.1"),
        ("--ambiguity", "ambiguity", "P", "probability of wrong fringe orders in a pixel that is safe; default 1e-6"),
    )  # fmt: skip
    for option, name, letter, text in numbers:
        parser.add_argument(option, dest=name, type=float, metavar=letter, help=text)
    parser.add_argument(
        "--bits", type=int, metavar="B", help="of a count, over the full well, 1 to 16; default: of the table, or 12"
    )
    parser.add_argument(
        "--frames", type=int, metavar="N", help="camera frames of the whole test, 6 at least; default 32"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help=f"write {FILE} and a figure there")
    add_no_figures(parser)


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.measurement.pattern_design.camera import check_camera

    given = choices(options, CAMERA)
    check_camera(**given)
    scene = load_scene(options.scene)
    if options.camera_noise is not None:
        scene = with_noise_file(scene, options.camera_noise)
    from irtscots_cl.measurement.pattern_design.choice import design_patterns
    from irtscots_cl.report.pattern_design import NAME, advice, design_facts, design_tables, write_design_figure
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder, plain, write_json

    if options.out is not None:
        check_output_folder(options.out, (FILE,), ("figures",))
    budget = {"limit" if k == "ambiguity" else k: v for k, v in choices(options, ("frames", "ambiguity")).items()}
    found = design_patterns(scene, **budget, **given)
    facts = plain(design_facts(found, options.scene))
    if options.out is not None:
        with made_folder(options.out):
            figures(options, options.out / "figures", (NAME,), partial(write_design_figure, found))
            write_json(options.out / FILE, facts)
    if options.json:
        print_json(facts)
        return 0
    print_tables(design_tables(found))
    print("\n".join(advice(found, options.scene)))
    if options.out is not None:
        print(f"results in {options.out}")
    if found.best is not None:
        next_step(options, "run the command above, which says how to photograph and measure")
    return 0
