"""What only a terminal gets: colours, and the next step after a command."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path
from typing import TextIO

_CODES = {"red": 31, "green": 32, "yellow": 33}
LEVELS = {"ok": "green", "note": "yellow", "warning": "yellow", "problem": "red", "error": "red"}


def coloured(text: str, colour: str, stream: TextIO) -> str:
    """The text in a colour of _CODES where the stream is a terminal that shows colours and NO_COLOR is not set."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not stream.isatty()
    return text if plain else f"\033[{_CODES[colour]}m{text}\033[0m"


def next_step(options: argparse.Namespace, text: str) -> None:
    """One line about what to do after a command, for a person: on stderr, where that is a terminal.

    Nothing with --json or --quiet: stdout and the stderr of scripts stay what they are.
    """
    if sys.stderr.isatty() and not options.json and not getattr(options, "quiet", False):
        print(f"next: {text}", file=sys.stderr)


def quoted(text: object) -> str:
    """A path or name as the shell wants it."""
    return shlex.quote(str(text))


def path_of_scene(path: Path) -> str:
    """The path of a scene file as a command wants it: what has no / and no .toml is the name of a preset."""
    text = str(path)
    return quoted(text if "/" in text or text.endswith(".toml") else f"./{text}")


def results_page(folder: Path) -> str:
    """What to do with a folder of results."""
    return f"open {quoted(folder / 'report.html')} in a browser; irtscots view {quoted(folder)} OTHER compares runs"
