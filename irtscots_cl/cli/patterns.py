"""The command `irtscots patterns`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from irtscots_cl.cli.common import add_scene, command, print_json
from irtscots_cl.scene.presets import load_scene

if TYPE_CHECKING:
    from irtscots_cl.imaging.sequences import TimeOrder
    from irtscots_cl.pipeline.pattern_kinds import SeriesByAxis
    from irtscots_cl.scene.model import Scene

KINDS = ("sinusoid", "lines", "gray", "gray-phase", "dots", "pictures")
PLACES = ("start", "between", "end")
# Options that belong to some kinds only, with these kinds.
_OF_KINDS = {
    "steps": ("sinusoid", "gray-phase"),
    "periods": ("sinusoid", "gray-phase"),
    "line_width": ("lines",),
    "line_step": ("lines",),
    "line_first": ("lines",),
    "gray_cell": ("gray",),
    "single_planes": ("gray", "gray-phase"),
    "dot_pitch": ("dots",),
    "dot_diameter": ("dots",),
    "dot_shifts": ("dots",),
    "pictures": ("pictures",),
}


def add(commands) -> None:
    parser = command(
        commands,
        "patterns",
        _execute,
        "write the pictures of patterns to show on the screen, with a manifest",
        "PNG files of the screen's pixels: dark, white, then the patterns along x and y, and manifest.toml, which "
        "`irtscots reconstruct` reads back. First row: the screen's +y edge, its top; first column: the +x edge, on "
        "the left for who looks at the screen from the mirror. Show them one pixel to one pixel, without any "
        "correction of colours.",
        example="sphere-deviated --out shown",
    )
    add_scene(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder; default irtscots-out/NAME-patterns")
    parser.add_argument(
        "--kind",
        choices=KINDS,
        default="sinusoid",
        help="sinusoid: N-step fringes. lines: a line scan. gray: a Gray code. gray-phase: one number of fringes, "
        "whose order a Gray code tells. dots: a grid of dots. pictures: those given. Default sinusoid",
    )
    parser.add_argument(
        "--levels", type=int, default=8, metavar="BITS", help="bits of a pixel's value, 8 or 16; default 8"
    )
    _add_order(parser)
    _add_of_kinds(parser)


def _add_order(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("order of the frames")
    group.add_argument(
        "--order",
        choices=("x-then-y", "y-then-x", "interleaved"),
        default="x-then-y",
        help="interleaved: frames along x and along y take turns; default x-then-y",
    )
    for name in ("dark", "white"):
        group.add_argument(
            f"--{name}-at",
            nargs="*",
            choices=PLACES,
            default=["start"],
            help=f"where {name} frames are shown: at the start, between the series (in the middle of a single one), at "
            "the end; none without a word; default start",
        )
        group.add_argument(
            f"--{name}-frames", type=int, default=1, metavar="N", help="how many of them at each place; default 1"
        )


def _add_of_kinds(parser: argparse.ArgumentParser) -> None:
    fringes = parser.add_argument_group("sinusoid, gray-phase")
    fringes.add_argument("--steps", type=int, metavar="N", help="phase steps of 360/N degrees, 3 to 64; default 4")
    fringes.add_argument(
        "--periods",
        type=float,
        nargs="+",
        metavar="P",
        help="numbers of periods over the screen, of a series each; default: 0.9, which tells the place, up to the "
        "most precise one for the camera's aperture, by factors of at most 6; gray-phase: that one alone",
    )
    lines = parser.add_argument_group("lines, in pixels of the screen; parts of a pixel are shown grey")
    lines.add_argument("--line-width", type=float, metavar="W", help="default: that of [screen.lines], else 1")
    lines.add_argument("--line-step", type=float, metavar="S", help="from line to line; default as for the width")
    lines.add_argument("--line-first", type=float, metavar="F", help="where the first line begins; default 0")
    gray = parser.add_argument_group("gray, gray-phase")
    gray.add_argument(
        "--gray-cell",
        type=float,
        metavar="W",
        help="width of a cell in pixels; default: half the width of a camera pixel's light",
    )
    gray.add_argument(
        "--single-planes",
        action="store_true",
        default=None,
        help="show no inverted planes: half the frames; dark and white frames tell black from white",
    )
    dots = parser.add_argument_group("dots, in pixels of the screen")
    dots.add_argument("--dot-pitch", type=float, metavar="P", help="default: as far apart as keeps them apart")
    dots.add_argument("--dot-diameter", type=float, metavar="D", help="default: 0.4 of the width of a pixel's light")
    dots.add_argument("--dot-shifts", type=int, metavar="N", help="N x N frames, shifted by pitch/N; default 3")
    pictures = parser.add_argument_group("pictures")
    pictures.add_argument(
        "--pictures", nargs="+", metavar="FILE", help="of the screen's size: PNG, TIFF, NPY; whole numbers, or 0 to 1"
    )


def _execute(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene)
    from irtscots_cl.imaging.fringe_manifest import NAME
    from irtscots_cl.imaging.screen_pictures import BITS
    from irtscots_cl.imaging.sequences import in_order
    from irtscots_cl.pipeline.show import show_frames
    from irtscots_cl.system.atomic_files import check_output_folder

    if options.levels not in BITS:
        raise ValueError(f"--levels = {options.levels}: must be {' or '.join(map(str, BITS))} (bits)")
    _check_options(options, scene)
    order = _order(options)
    folder = options.out if options.out is not None else Path("irtscots-out") / f"{scene.name}-patterns"
    check_output_folder(folder, (NAME,))
    series, facts, said, pictures = _series(options, scene)
    manifest = show_frames(scene, folder, in_order(series, order), options.levels, pictures)
    columns, rows = scene.screen.pixels
    if options.json:
        print_json(
            {
                "folder": str(folder),
                "manifest": str(folder / NAME),
                "kind": options.kind,
                "order": options.order,
                "screen_pixels": [columns, rows],
                **facts,
                "pictures": [frame.picture for frame in manifest.frames],
            }
        )
        return 0
    for line in said:
        print(line)
    print(f"{len(manifest.frames)} pictures of {columns} x {rows} pixels in {folder}")
    then = "" if options.kind == "pictures" else f", then: irtscots reconstruct {folder} --scene {options.scene}"
    print(f"put the camera's images into {folder / 'camera'}{then}")
    return 0


def _check_options(options: argparse.Namespace, scene: Scene) -> None:
    for name, kinds in _OF_KINDS.items():
        if getattr(options, name) is not None and options.kind not in kinds:
            option = "--" + name.replace("_", "-")
            raise ValueError(f"{option}: goes with --kind {' or '.join(kinds)}, not with --kind {options.kind}")
    if options.steps is not None and not 3 <= options.steps <= 64:
        raise ValueError(f"--steps = {options.steps}: must be at least 3 and at most 64")
    for periods in options.periods or ():
        if not 0 < periods <= min(scene.screen.pixels) / 2:
            raise ValueError(
                f"--periods = {periods:g}: must be above 0 and at most {min(scene.screen.pixels) / 2:g}: "
                "a period needs two pixels of the screen"
            )
    if options.periods and len(set(options.periods)) < len(options.periods):
        raise ValueError(f"--periods = {' '.join(f'{p:g}' for p in options.periods)}: must differ")
    if options.kind == "gray-phase" and options.periods and len(options.periods) > 1:
        shown = " ".join(f"{p:g}" for p in options.periods)
        raise ValueError(f"--periods = {shown}: must be one for --kind gray-phase")
    if options.kind == "pictures" and not options.pictures:
        raise ValueError("--pictures: must name the files for --kind pictures")
    if options.single_planes and not (options.dark_at and options.white_at):
        raise ValueError("--single-planes: needs dark and white frames; give --dark-at and --white-at places")


def _order(options: argparse.Namespace) -> TimeOrder:
    from irtscots_cl.imaging.sequences import MAX_REFERENCES, TimeOrder

    for name in ("dark_frames", "white_frames"):
        if not 1 <= getattr(options, name) <= MAX_REFERENCES:
            option = "--" + name.replace("_", "-")
            raise ValueError(f"{option} = {getattr(options, name)}: must be from 1 to {MAX_REFERENCES}")
    return TimeOrder(
        options.order, tuple(options.dark_at), tuple(options.white_at), options.dark_frames, options.white_frames
    )


def _series(options: argparse.Namespace, scene: Scene) -> tuple[SeriesByAxis, dict[str, Any], list[str], Any]:
    """The series of the kind, its facts for programs and lines for people, and the user's pictures."""
    from irtscots_cl.pipeline import pattern_kinds as kinds

    steps = 4 if options.steps is None else options.steps
    if options.kind == "sinusoid":
        series, sets = kinds.sinusoids(scene, options.periods, steps)
        return series, *_told_fringes(sets, steps), ()
    if options.kind == "lines":
        lines = kinds.line_set(scene, options.line_width, options.line_step, options.line_first)
        series = kinds.line_series(scene, lines)
        counts = {axis: len(found[0]) for axis, found in series.items()}
        facts = {"lines": counts, "width_px": lines.width_px, "step_px": lines.step_px, "first_px": lines.first_px}
        told = f"{lines.width_px:g} pixels wide, every {lines.step_px:g} pixels from {lines.first_px:g} on"
        return series, facts, [f"lines along x, y: {counts['x']}, {counts['y']}, {told}"], ()
    if options.kind == "gray":
        codes = kinds.gray_codes(scene, options.gray_cell, not options.single_planes)
        return kinds.gray_series(codes), *_told_codes(codes), ()
    if options.kind == "gray-phase":
        periods = options.periods[0] if options.periods else None
        codes, sets = kinds.gray_and_fringes(scene, periods, steps, not options.single_planes)
        (facts, said), (more, also) = _told_fringes(sets, steps), _told_codes(codes)
        return kinds.gray_series(codes, sets), facts | more, said + also, ()
    if options.kind == "dots":
        grid = kinds.dot_grid(scene, options.dot_pitch, options.dot_diameter, options.dot_shifts)
        facts = {"pitch_px": grid.pitch_px, "diameter_px": grid.diameter_px, "shifts": grid.shifts}
        told = f"dots of {grid.diameter_px:g} pixels, {grid.pitch_px:g} pixels apart, {grid.shifts**2} frames"
        return {"": [grid.series(scene.screen.pixels)]}, facts, [told], ()
    from irtscots_cl.imaging.pictures import read_pictures

    pictures = read_pictures(options.pictures, scene)
    return kinds.picture_series(len(pictures)), {}, [f"{len(pictures)} pictures of yours"], pictures


def _told_fringes(sets: Any, steps: int) -> tuple[dict[str, Any], list[str]]:
    periods = {one.axis: list(one.periods) for one in sets}
    said = [
        f"{axis} fringes: {', '.join(f'{p:g}' for p in values)} periods over the screen, {steps} steps each"
        for axis, values in periods.items()
    ]
    return {"steps": steps, "periods": periods}, said


def _told_codes(codes: Any) -> tuple[dict[str, Any], list[str]]:
    said = [
        f"{code.axis} Gray code: {code.cells:g} cells in {code.planes} planes{', each inverted too' * code.inverted}"
        for code in codes
    ]
    return {"gray_cells": {code.axis: code.cells for code in codes}}, said
