"""The command `irtscots patterns`."""

from __future__ import annotations

import argparse
from pathlib import Path

from irtscots_cl.cli.common import add_scene, command, print_json
from irtscots_cl.scene.presets import load_scene


def add(commands) -> None:
    parser = command(
        commands,
        "patterns",
        _execute,
        "write the pictures of fringes to show on the screen, with a manifest",
        "PNG files of the screen's pixels: dark, white, x fringes, y fringes, and manifest.toml, which `irtscots "
        "reconstruct` reads back. First row: the screen's +y edge, its top; first column: the +x edge, on the left for "
        "who looks at the screen from the mirror. Show them one pixel to one pixel, without any correction of colours.",
    )
    add_scene(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder; default irtscots-out/NAME-patterns")
    parser.add_argument(
        "--steps", type=int, default=4, metavar="N", help="phase steps of 360/N degrees, 3 to 64; default 4"
    )
    parser.add_argument(
        "--periods",
        type=float,
        nargs="+",
        metavar="P",
        help="numbers of periods over the screen, of a series each; default: 0.9, which tells the place, up to the "
        "most precise one for the camera's aperture, by factors of at most 6",
    )
    parser.add_argument(
        "--levels", type=int, default=8, metavar="BITS", help="bits of a pixel's value, 8 or 16; default 8"
    )


def _execute(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene)
    from irtscots_cl.imaging.fringe_manifest import NAME
    from irtscots_cl.imaging.screen_pictures import BITS
    from irtscots_cl.pipeline.show import fringe_sets, show
    from irtscots_cl.system.atomic_files import check_output_folder

    if options.levels not in BITS:
        raise ValueError(f"--levels = {options.levels}: must be {' or '.join(map(str, BITS))} (bits)")
    if not 3 <= options.steps <= 64:
        raise ValueError(f"--steps = {options.steps}: must be at least 3 and at most 64")
    for periods in options.periods or ():
        if not 0 < periods <= min(scene.screen.pixels) / 2:
            raise ValueError(
                f"--periods = {periods:g}: must be above 0 and at most {min(scene.screen.pixels) / 2:g}: "
                "a period needs two pixels of the screen"
            )
    if options.periods and len(set(options.periods)) < len(options.periods):
        raise ValueError(f"--periods = {' '.join(f'{p:g}' for p in options.periods)}: must differ")
    folder = options.out if options.out is not None else Path("irtscots-out") / f"{scene.name}-patterns"
    check_output_folder(folder, (NAME,))
    sets = fringe_sets(scene, options.periods, options.steps)
    manifest = show(scene, folder, sets, options.levels)
    columns, rows = scene.screen.pixels
    periods = {one.axis: list(one.periods) for one in sets}
    if options.json:
        print_json(
            {
                "folder": str(folder),
                "manifest": str(folder / NAME),
                "screen_pixels": [columns, rows],
                "steps": options.steps,
                "periods": periods,
                "pictures": [frame.picture for frame in manifest.frames],
            }
        )
        return 0
    for axis, values in periods.items():
        print(
            f"{axis} fringes: {', '.join(f'{p:g}' for p in values)} periods over the screen, {options.steps} steps each"
        )
    print(f"{len(manifest.frames)} pictures of {columns} x {rows} pixels in {folder}")
    print(
        f"put the camera's images into {folder / 'camera'}, then: irtscots reconstruct {folder} --scene {options.scene}"
    )
    return 0
