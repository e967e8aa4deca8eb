"""Shared by the commands: common arguments of their parsers, and printing."""

from __future__ import annotations

import argparse
import json
import logging
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from irtscots_cl.cli.terminal import LEVELS, coloured
from irtscots_cl.scene.presets import load_scene, with_noise_file
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.system.option_error import on_command_line

if TYPE_CHECKING:
    from irtscots_cl.optics.setup import Setup
    from irtscots_cl.report.types import CheckFacts
    from irtscots_cl.scene.model import Scene

DEVICE_HELP = (
    "part of a device's name, its index such as 0:0, cpu or gpu; "
    "default: environment variable IRTSCOTS_DEVICE, or the best found"
)
DEVICES_HELP = f"all (all devices of this machine at once), several with commas between, or one: {DEVICE_HELP}"
DASK_HELP = (
    "address of a Dask scheduler, such as tcp://host:8786, whose workers trace instead, each on the device that its "
    "IRTSCOTS_DEVICE names (needs irtscots-cl[dask])"
)
UNFOLDED = 10_000  # columns, more than any table has
EXAMPLE = "example: "
EXIT_BAD_INPUT = 2
EXIT_NO_DEVICE = 3
EXIT_STOPPED = 4  # and can be resumed
EXIT_INTERRUPTED = 130  # as a shell reports Ctrl-C


class StoppedError(Exception):
    """A command ended early and can be continued by --resume; the message is one line."""


def fail(message: object, code: int) -> int:
    print(f"{coloured('irtscots:', 'red', sys.stderr)} {on_command_line(message)}", file=sys.stderr)
    return code


class _Help(argparse.HelpFormatter):
    """Help whose last line, the example, stays one line that can be copied."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if text.startswith(EXAMPLE) else super()._fill_text(text, width, indent)


def command(
    commands, name: str, function: Callable, text: str, more: str = "", example: str = ""
) -> argparse.ArgumentParser:
    """The parser of a command. text: for the list of commands; more: for its own help, which ends with the example
    (arguments that work)."""
    parser = commands.add_parser(
        name,
        help=text,
        description=f"{text[0].upper()}{text[1:]}. {more}",
        epilog=f"{EXAMPLE}irtscots {name} {example}".rstrip(),
        formatter_class=_Help,
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    parser.set_defaults(command=function)
    return parser


def add_scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="preset name (see `irtscots scenes`) or path of a TOML file")


def add_no_figures(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--no-figures",
        dest="figures",
        action="store_false",
        help="write no pictures; those of an earlier run in the folder are deleted",
    )


def figures(options: argparse.Namespace, folder: Path, names: Iterable[str], draw: Callable[[Path], object]) -> None:
    """Draw into the folder, which is made; with --no-figures delete an earlier command's figures of these names."""
    from irtscots_cl.system.atomic_files import draw_or_delete

    draw_or_delete(folder, names, options.figures, draw)


def add_usable_samples(parser: argparse.ArgumentParser, choices: bool = False) -> None:
    """Which samples of a laboratory's images may be used. choices: whether --mask takes "auto" and "design", too."""
    parser.add_argument(
        "--saturation",
        type=float,
        default=math.inf,
        metavar="V",
        help="value from which on a sample of the images is saturated and not used; default: the images' own ceiling, "
        "where they show one",
    )
    parser.add_argument(
        "--mask",
        type=Path,
        metavar="auto|design|FILE" if choices else "FILE",
        help=(
            "auto: pixels with light, by the histogram's valley (default); design: those in the design's rim; FILE: "
            if choices
            else ""
        )
        + "picture (PNG, TIFF), NPY array or HDF5 file with a dataset `mask`, of the images' size and lying as they "
        "do: pixels where it is 0 are not used",
    )


def visible_setup(name_or_path: str, noise_path: str | None = None) -> Setup:
    """The scene of a name or path, checked to be traceable. Raises SceneError; its message uses the given name.

    noise_path: a TOML file whose tables replace the scene's own; see presets.with_noise_file.
    """
    scene = load_scene(name_or_path)
    if noise_path is not None:
        scene = with_noise_file(scene, noise_path)
    from irtscots_cl.optics.chief_rays import check_visible
    from irtscots_cl.optics.setup import Setup

    setup = Setup(scene)
    try:
        check_visible(setup.chief_rays, name_or_path)
    except SceneError as error:
        raise SceneError(f"{error}{_mistake_in(scene)}") from None
    return setup


def _mistake_in(scene: Scene) -> str:
    """The mistake that explains why nothing is seen, for the end of an error message; "" if none does."""
    from irtscots_cl.planning.mistakes import find_mistakes
    from irtscots_cl.planning.sight import Sight

    found = find_mistakes(Sight.of(scene))
    return f"; {found[0].text}" if found else ""


DEFAULTS = {"estimator": "adjoint", "sampler": "philox", "precision": "fp32", "smoothing": False, "measure": "paper"}


def choices(options: argparse.Namespace, names: Iterable[str]) -> dict[str, object]:
    """The options that the user set, by name; the parsers leave the others None."""
    given = {name: getattr(options, name, None) for name in names}
    return {name: value for name, value in given.items() if value is not None}


def add_trace_choices(parser: argparse.ArgumentParser, device_help: str = DEVICE_HELP) -> None:
    parser.add_argument(
        "--estimator",
        metavar="E",
        help="forward (rays leave the screen, as in the paper), adjoint (rays leave the detector: less noise), "
        "analytic (light curves in closed form: no rays, no noise) or nonsequential (all elements of the scene, in any "
        "order); default adjoint",
    )
    parser.add_argument(
        "--sampler",
        metavar="S",
        help="philox (independent random numbers; default), sobol (Owen-scrambled Sobol points) or lattice (rank-1 "
        "lattice, shifted at random)",
    )
    parser.add_argument("--precision", metavar="P", help="fp32 or fp64 arithmetic on the device; default fp32")
    parser.add_argument(
        "--smoothing",
        action=argparse.BooleanOptionalAction,
        help="adjoint: a ray brings the light of its whole chord through the aperture, for less noise; of `run` the "
        "default where the map of light transport would take more than 2 GiB",
    )
    parser.add_argument("--device", metavar="D", help=device_help)


@contextmanager
def site_arguments(options: argparse.Namespace) -> Iterator[dict[str, object]]:
    """The argument device= or client= of `trace`, from --device and --dask."""
    from irtscots_cl.execution.dask.cluster import DaskExecutor
    from irtscots_cl.execution.dask.workers import connect
    from irtscots_cl.opencl.device import select_devices

    if options.dask is None:
        yield {"device": select_devices(options.device)}
        return
    if options.device is not None:
        raise ValueError("--device: must be left out with --dask: IRTSCOTS_DEVICE of each worker names its device")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # this program prints what the user needs, in one line
    with connect(options.dask) as client:
        yield {"client": DaskExecutor(client)}


@contextmanager
def workers_argument(address: str | None) -> Iterator[dict[str, object]]:
    """The argument workers= of `assess_budget`, from --dask; without it none."""
    if address is None:
        yield {}
        return
    from irtscots_cl.execution.dask.workers import Workers, connect

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # as in site_arguments
    with connect(address) as client:
        yield {"workers": Workers(client)}


LAB_MEASURE = "likelihood"  # methods.BEST, without NumPy


def add_measure(parser: argparse.ArgumentParser, default: str = "paper") -> None:
    parser.add_argument(
        "--measure",
        metavar="M",
        help="how images become heights. Without noise and background: paper (plain centroids, trapezoids), fine "
        "(light-curve model, cubics, no averaging over pixels) or refined (fine, then refined by a model of the test). "
        "With both: likelihood (the modelled light curve moved to the samples by maximum likelihood, refined) or "
        f"windowed (signed centroids where the light can be, refined); default {default}",
    )
    parser.add_argument(
        "--zernike",
        metavar="Z",
        default="circular",
        help="Zernike terms of the table: circular (on the disk; default) or annular (on the ring around the mirror's "
        "central hole, where terms of the disk resemble each other)",
    )


def add_noise(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--noise",
        metavar="FILE",
        help="TOML file with the tables [camera.detector.noise] and [screen.response], or one of them, in place of the "
        "scene's own: what a real camera and screen do to the images; default: as the scene says, without such tables "
        "no noise",
    )


def warn_of(checks: Iterable[CheckFacts]) -> None:
    """Print the checks of images that were not passed, a line each, to stderr."""
    for check in checks:
        if check["level"] != "ok":
            level = coloured(check["level"], LEVELS[check["level"]], sys.stderr)
            print(f"irtscots: {level}: {check['name']}: {check['text']}", file=sys.stderr)


def warn_of_scene(scene: Scene) -> None:
    """Print why part of the mirror will not be measured, a line each, to stderr. Raises SceneError if nothing is and a
    mistake explains it."""
    from irtscots_cl.planning.check import look
    from irtscots_cl.planning.mistakes import find_mistakes
    from irtscots_cl.planning.sight import Sight

    sight = Sight.of(scene)
    if sight.landing == 0:
        for mistake in find_mistakes(sight):
            raise SceneError(f"{scene.name}: {mistake.text}")
    for finding in look(sight) if sight.measured < 1 else ():
        warn(f"{finding.code}: {finding.text}")


def warn(message: object) -> None:
    """One line on stderr about something that does not stop the command."""
    print(f"irtscots: {coloured('warning', LEVELS['warning'], sys.stderr)}: {message}", file=sys.stderr)


def print_tables(tables) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    # Without a terminal, fold to $COLUMNS or not at all, instead of to 80. No markup: it would read [nm] as a style.
    class Terminal(Console):
        def on_broken_pipe(self) -> None:  # the reader has closed the output: main ends the command without an error
            raise BrokenPipeError

    width = None if sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdecimal() else UNFOLDED
    console = Terminal(width=width, markup=False, emoji=False, highlight=False)
    for table in tables:
        shown = Table(title=table.title, title_justify="left", box=box.SIMPLE_HEAD, show_header=any(table.head))
        for k, head in enumerate(table.head):
            shown.add_column(head, justify="left" if k == 0 or len(table.head) == 2 else "right")
        for row in table.rows:
            shown.add_row(*row)
        console.print(shown)


def print_json(data: object) -> None:
    print(json.dumps(data, indent=2))


PATH_CHOICES = ("bounce_limit", "least_chance", "branches", "aimed_scatter", "polarisation")


def add_overfill(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--overfill",
        type=float,
        metavar="F",
        help="forward, nonsequential: solid angle of the cone that rays leave the screen in, over the least one that "
        "covers the mirror (or, with --aim camera, the part of it that lights the camera); default 1",
    )


def add_path_choices(parser: argparse.ArgumentParser) -> None:
    """Options of the non-sequential estimator; those that were not given are None."""
    parser.add_argument(
        "--bounce-limit",
        type=int,
        metavar="B",
        help="nonsequential: events after which a ray is given up, 1 to 42; default: what the scene's direct light "
        "needs and 4 more, at least 10",
    )
    parser.add_argument(
        "--least-chance",
        type=float,
        metavar="C",
        help="nonsequential: probability of a reflection at an interface, however small its share of the light: more "
        "of it, more rays on ghosts; default 0.1",
    )
    parser.add_argument(
        "--branches",
        metavar="B",
        help="nonsequential: at an interface random (a ray goes one way, chosen at random) or split (it goes both "
        "ways, as long as the weaker ray weighs a thousandth of a ray); default random",
    )
    parser.add_argument(
        "--no-aimed-scatter",
        dest="aimed_scatter",
        action="store_false",
        default=None,
        help="nonsequential: draw scattered rays from the lobe alone, none towards the camera",
    )
    parser.add_argument(
        "--polarisation",
        metavar="P",
        help="nonsequential: whether rays carry their polarisation from interface to interface, on, off or auto (where "
        "it changes the direct light by more than 1e-4); default auto",
    )
