"""The command `irtscots check`."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from irtscots_cl.cli.common import DEVICE_HELP, EXIT_BAD_INPUT, add_no_figures, add_scene, command, figures, print_json
from irtscots_cl.cli.terminal import next_step, quoted
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.validation import SceneError

if TYPE_CHECKING:
    from irtscots_cl.planning.check import SceneCheck


def add(commands) -> None:
    parser = command(
        commands,
        "check",
        _execute,
        "say what will go wrong with a scene, before a ray is traced",
        "Looks for mistakes in the scene's numbers, says what part of the mirror will be measured and what limits it, "
        "the height error to expect by its parts, and the time and memory of the run. Each finding has a code, which "
        "docs/checks.md explains. With --out also a drawing to scale.",
        example="sphere-deviated --out checked",
    )
    add_scene(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="write check.json and setup.png there")
    add_no_figures(parser)
    parser.add_argument(
        "--detail-mm", type=float, metavar="P", help="shortest period of ripples on the mirror that is to be measured"
    )
    parser.add_argument(
        "--periods",
        type=float,
        nargs="+",
        default=(),
        metavar="N",
        help="numbers of fringes over the screen to be shown",
    )
    parser.add_argument("--steps", type=int, default=4, metavar="N", help="phase steps of the fringes; default 4")
    parser.add_argument(
        "--quick", action="store_true", help="leave out the height errors and the cost, which take some seconds"
    )
    parser.add_argument("--strict", action="store_true", help="exit code 2 if anything but information is found")
    parser.add_argument("--device", metavar="D", help=DEVICE_HELP)


def _execute(options: argparse.Namespace) -> int:
    if options.detail_mm is not None and not 0 < options.detail_mm < 1e12:
        raise ValueError(f"--detail-mm = {options.detail_mm}: must be above 0")
    for periods in options.periods:
        if not 0 < periods < 1e6:
            raise ValueError(f"--periods = {periods}: must be above 0 and below 1e6")
    if not 3 <= options.steps <= 64:
        raise ValueError(f"--steps = {options.steps}: must be from 3 to 64")
    try:
        scene = load_scene(options.scene)
    except SceneError as error:
        return _refused(options, error)
    from irtscots_cl.planning.check import check_scene
    from irtscots_cl.report.scene_check import check_data, check_lines
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder, plain, write_json

    if options.out is not None:
        check_output_folder(options.out, ("check.json", "setup.png"))
    device = None
    if not options.quick:
        from irtscots_cl.opencl.device import select_device

        device = select_device(options.device)
    found = check_scene(scene, detail_mm=options.detail_mm, periods=options.periods, steps=options.steps,
                        heights=not options.quick, device=device)  # fmt: skip
    facts = plain(check_data(found))
    if options.out is not None:
        with made_folder(options.out):
            write_json(options.out / "check.json", facts)
            figures(options, options.out, ("setup.png",), partial(_draw, found))
    if options.json:
        print_json(facts)
    else:
        print("\n".join(check_lines(found)))
        if options.out is not None:
            print(f"results in {options.out}")
        if found.worst == "error":
            next_step(options, "mend what is marked error (docs/checks.md), then check again")
        else:
            next_step(options, f"irtscots run {quoted(options.scene)}")
    return EXIT_BAD_INPUT if options.strict and found.worst != "info" else 0


def _draw(found: SceneCheck, folder: Path) -> None:
    from irtscots_cl.report.setup_drawing import setup_figure
    from irtscots_cl.system.atomic_files import replacing

    with replacing(folder / "setup.png") as temporary:
        setup_figure(found.sight).savefig(temporary, dpi=120)


def _refused(options: argparse.Namespace, error: SceneError) -> int:
    """Say why a scene file is refused, if a number in the wrong unit explains it; else raise the error."""
    from irtscots_cl.planning.unreadable import explain
    from irtscots_cl.report.scene_check import finding_data, finding_lines

    found = explain(Path(options.scene), error)
    if options.json:
        print_json({"findings": finding_data(found)})
    else:
        print("\n".join(finding_lines(found)))
    return EXIT_BAD_INPUT
