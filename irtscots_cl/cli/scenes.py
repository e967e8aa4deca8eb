"""The command `irtscots scenes`."""

from __future__ import annotations

import argparse

from irtscots_cl.cli.common import command, print_json
from irtscots_cl.scene.presets import preset_names, preset_text


def add(commands) -> None:
    parser = command(commands, "scenes", _execute, "list the preset scenes, or print one as TOML")
    parser.add_argument("name", nargs="?", metavar="NAME", help="preset to print")


def _execute(options: argparse.Namespace) -> int:
    if options.name is not None:
        text = preset_text(options.name)
        print_json({"name": options.name, "toml": text}) if options.json else print(text, end="")
        return 0
    texts = {name: preset_text(name) for name in preset_names()}
    if options.json:
        print_json([{"name": name, "toml": text} for name, text in texts.items()])
    for name, text in () if options.json else texts.items():
        print(f"{name:16} {text.splitlines()[0].removeprefix('# ')}")
    return 0
