"""The command line: `irtscots COMMAND`.

Exit codes: 0 done, 1 a bug, 2 bad input, 3 no usable device, 4 stopped and can be resumed.

Each command has its own file here. It imports modules only when it runs, so that help and errors appear immediately.
"""

from __future__ import annotations

import argparse
import itertools
import os
import re
import shlex
import sys
import warnings
from typing import NoReturn

from irtscots_cl.cli import (
    bench,
    budget,
    calibrate,
    check,
    convert,
    design_patterns,
    devices,
    doctor,
    identify,
    init,
    kernel,
    paths,
    patterns,
    reconstruct,
    reproduce,
    run,
    scenes,
    stability,
    transfer,
    view,
    watch,
)
from irtscots_cl.cli import map as height_map
from irtscots_cl.cli.common import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    EXIT_NO_DEVICE,
    EXIT_STOPPED,
    StoppedError,
    fail,
    warn,
)
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.system import interruption

GROUPS = {
    "simulate": (run, watch, paths, scenes),
    "plan": (init, check, design_patterns, patterns, identify, budget, transfer),
    "measure": (reconstruct, calibrate, height_map, convert, view),
    "this machine": (doctor, devices, bench, stability, kernel),
    "the paper": (reproduce,),
}
COMMANDS = tuple(module for group in GROUPS.values() for module in group)


def main(arguments: list[str] | None = None) -> int:
    """Run one command and return the exit code. Every expected failure prints one line on stderr."""
    parser = _parser()
    if "_ARGCOMPLETE" in os.environ:  # a shell completes a line; else the extra costs nothing
        from irtscots_cl.cli.completion import answer

        answer(parser)
    given = sys.argv[1:] if arguments is None else arguments
    options = parser.parse_args(given)
    options.arguments = given  # for the command that goes on after an interruption
    with interruption.handled():
        return _run(options)


def _run(options: argparse.Namespace) -> int:
    try:
        interruption.check()
        with warnings.catch_warnings():
            # drivers print comments on kernels that they did build, which do not help a user
            warnings.showwarning = _show_warning
            warnings.filterwarnings("always", "precision fp32: ")
            warnings.filterwarnings("always", r"mirror\.map\[")
            warnings.filterwarnings("ignore", "Non-empty compiler output|.*non-empty logs")
            code = options.command(options)
            sys.stdout.flush()
            return code
    except BrokenPipeError:  # the reader, such as `head`, has closed the output
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (SceneError, ValueError) as error:
        return fail(error, EXIT_BAD_INPUT)
    except OSError as error:
        name = error.filename2 or error.filename  # the second is where a file was to be moved to
        return fail(f"{name}: {error.strerror}" if name and error.strerror else error, EXIT_BAD_INPUT)
    except MemoryError as error:  # of the host; Python's own message is empty
        return fail(f"too little memory on the host: {error}".removesuffix(": "), EXIT_NO_DEVICE)
    except StoppedError as stopped:
        again = options.arguments if options.resume else [*options.arguments, "--resume"]
        return fail(f"{stopped}: {shlex.join(['irtscots', *again])}", EXIT_STOPPED)
    except KeyboardInterrupt as interrupt:
        return fail(f"interrupted; {str(interrupt) or 'nothing was written'}", EXIT_INTERRUPTED)
    except RuntimeError as error:
        if type(error).__name__ != "DeviceError":  # compared by name: its class needs the slow import of pyopencl
            raise
        return fail(error, EXIT_NO_DEVICE)


def _show_warning(message, category, filename, lineno, file=None, line=None) -> None:
    """A warning of the package on one line, as the commands' own; those of other packages as Python shows them."""
    if category.__name__ in ("RoundingWarning", "MapWarning"):  # compared by name: its class needs slow imports
        warn(message)
    else:
        print(warnings.formatwarning(message, category, filename, lineno, line), end="", file=file or sys.stderr)


def _plain(message: str) -> str:
    """argparse's message with the nearest command, and with numbers as a user knows them."""
    wrong = re.fullmatch(r"argument (.+): invalid (int|float) value: '(.*)'", message, re.DOTALL)
    if wrong:
        kind = "a whole number" if wrong[2] == "int" else "a number"
        return f"argument {wrong[1]} = {wrong[3]!r}: must be {kind}, without commas or units"
    wrong = re.match(r"argument COMMAND: invalid choice: '(.*?)'", message)
    if not wrong:
        return message
    import difflib  # here alone: start-up time

    names = [module.__name__.rpartition(".")[2].replace("_", "-") for module in COMMANDS]
    close = difflib.get_close_matches(wrong[1], names, 1)
    return f"{message}; did you mean {close[0]}?" if close else message


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Print one line, like every other error, without the usage text."""
        message = _plain(message)
        self.exit(EXIT_BAD_INPUT, f"irtscots: {message}; see {self.prog} --help\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="irtscots",
        usage="irtscots [-h] [--version] COMMAND ...",
        description="Simulate a SCOTS deflectometry test of a mirror; measure mirrors from simulated or real images.",
        epilog="First steps: irtscots run sphere-deviated; irtscots init; irtscots check FILE. All have --help.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(
        title="commands", prog="irtscots", required=True, metavar="COMMAND", help=argparse.SUPPRESS
    )
    for module in COMMANDS:
        module.add(commands)
    parser.description += "\n\n" + _grouped(commands)
    return parser


def _grouped(commands) -> str:
    """The commands under the headings of GROUPS, a line each."""
    texts = {action.dest: action.help for action in commands._choices_actions}
    names = iter(texts)
    width = max(len(name) for name in texts)  # `map` is a command here
    lines = []
    for group, modules in GROUPS.items():
        lines.append(f"{group}:")
        lines += [f"  {name:{width}}  {texts[name]}" for name in itertools.islice(names, len(modules))]
    return "\n".join(lines)


class _Version(argparse.Action):
    """Print the version; reading it takes too long to do for every command."""

    def __call__(self, parser, *_) -> NoReturn:
        from irtscots_cl.system.versions import package_version

        print(f"irtscots-cl {package_version()}")
        parser.exit(0)
