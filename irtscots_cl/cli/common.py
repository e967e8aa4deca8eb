"""Shared by the commands: common arguments of their parsers, and printing."""

from __future__ import annotations

import argparse
import json
import logging
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from irtscots_cl.scene.presets import load_scene

if TYPE_CHECKING:
    from irtscots_cl.optics.setup import Setup

DEVICE_HELP = (
    "part of a device's name, its index such as 0:0, cpu or gpu; "
    "default: environment variable IRTSCOTS_DEVICE, or the best found"
)
DEVICES_HELP = f"all (all devices of this machine at once), several with commas between, or one: {DEVICE_HELP}"
DASK_HELP = (
    "address of a Dask scheduler, such as tcp://host:8786, whose workers trace instead, each on the device that its "
    "IRTSCOTS_DEVICE names (needs irtscots-cl[dask])"
)
EXIT_BAD_INPUT = 2
EXIT_NO_DEVICE = 3
EXIT_STOPPED = 4  # and can be resumed
EXIT_INTERRUPTED = 130  # as a shell reports Ctrl-C


class StoppedError(Exception):
    """A command ended early and can be continued by --resume; the message is one line."""


def fail(message: object, code: int) -> int:
    print(f"irtscots: {message}", file=sys.stderr)
    return code


def command(commands, name: str, function: Callable, text: str, more: str = "") -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}. {more}")
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    parser.set_defaults(command=function)
    return parser


def add_scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="preset name (see `irtscots scenes`) or path of a TOML file")


def visible_setup(name_or_path: str) -> Setup:
    """The scene of a name or path, checked to be traceable. Raises SceneError; its message uses the given name."""
    scene = load_scene(name_or_path)
    from irtscots_cl.optics.chief_rays import check_visible
    from irtscots_cl.optics.setup import Setup

    setup = Setup(scene)
    check_visible(setup.chief_rays, name_or_path)
    return setup


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
    parser.add_argument(
        "--precision", metavar="P", help="fp32 or fp64 arithmetic on the device; default fp32"
    )
    parser.add_argument(
        "--smoothing",
        action="store_true",
        default=None,
        help="adjoint: a ray brings the light of its whole chord through the aperture, for less noise",
    )
    parser.add_argument("--device", metavar="D", help=device_help)


@contextmanager
def site_arguments(options: argparse.Namespace) -> Iterator[dict[str, object]]:
    """The argument device= or client= of `trace`, from --device and --dask."""
    from irtscots_cl.execution.dask.cluster import DaskExecutor, connect
    from irtscots_cl.opencl.device import select_devices

    if options.dask is None:
        yield {"device": select_devices(options.device)}
        return
    if options.device is not None:
        raise ValueError("--device: must be left out with --dask: IRTSCOTS_DEVICE of each worker names its device")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # this program prints what the user needs, in one line
    with connect(options.dask) as client:
        yield {"client": DaskExecutor(client)}


def add_measure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--measure",
        metavar="M",
        help="how images become heights: paper (plain centroids, trapezoids), fine (light-curve model, cubics, no "
        "averaging over pixels) or refined (fine, then refined by a model of the test); default paper",
    )


def warn(message: object) -> None:
    """One line on stderr about something that does not stop the command."""
    print(f"irtscots: warning: {message}", file=sys.stderr)


def print_tables(tables) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    # Without a terminal, do not wrap to a default of 80 columns. No markup: it would read [nm] as a style.
    class Terminal(Console):
        def on_broken_pipe(self) -> None:  # the reader has closed the output: main ends the command without an error
            raise BrokenPipeError

    console = Terminal(width=None if sys.stdout.isatty() else 160, markup=False, emoji=False, highlight=False)
    for table in tables:
        shown = Table(title=table.title, title_justify="left", box=box.SIMPLE_HEAD, show_header=any(table.head))
        for k, head in enumerate(table.head):
            shown.add_column(head, justify="left" if k == 0 or len(table.head) == 2 else "right")
        for row in table.rows:
            shown.add_row(*row)
        console.print(shown)


def print_json(data: object) -> None:
    print(json.dumps(data, indent=2))


PATH_CHOICES = ("bounce_limit", "least_chance", "branches", "aimed_scatter")


def add_path_choices(parser: argparse.ArgumentParser) -> None:
    """Options of the non-sequential estimator; those that were not given are None."""
    parser.add_argument(
        "--bounce-limit", type=int, metavar="B", help="nonsequential: events after which a ray is given up; default 10"
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
