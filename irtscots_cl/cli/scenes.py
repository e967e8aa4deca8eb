"""The command `irtscots scenes`."""

from __future__ import annotations

import argparse
import itertools
import re

from irtscots_cl.cli.common import command, print_json
from irtscots_cl.scene.presets import preset_names, preset_text


def add(commands) -> None:
    parser = command(
        commands,
        "scenes",
        _execute,
        "list the preset scenes, or print one as TOML",
        example="sphere-deviated",
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="preset to print; with --opencv also a TOML file")
    parser.add_argument(
        "--opencv", action="store_true", help="print the scene's camera as a calibration file of OpenCV (YAML) instead"
    )


def _execute(options: argparse.Namespace) -> int:
    if options.opencv:
        return _camera_file(options)
    if options.name is not None:
        text = preset_text(options.name)
        print_json({"name": options.name, "toml": text}) if options.json else print(text, end="")
        return 0
    texts = {name: preset_text(name) for name in preset_names()}
    if options.json:
        print_json([{"name": name, "toml": text} for name, text in texts.items()])
    for name, text in () if options.json else texts.items():
        print(f"{name:16} {_first_sentence(text)}")
    return 0


def _first_sentence(toml: str) -> str:
    """The first sentence of the comment that a preset begins with."""
    comment = itertools.takewhile(lambda line: line.startswith("#"), toml.splitlines())
    words = " ".join(line.removeprefix("#").strip() for line in comment)
    return re.split(r"(?<=\.) (?=[A-Z])", words, maxsplit=1)[0]


def _camera_file(options: argparse.Namespace) -> int:
    """Print the camera of a scene as OpenCV's FileStorage has it."""
    if options.name is None:
        raise ValueError("--opencv: needs the NAME of a preset or the path of a TOML file")
    from irtscots_cl.formats.opencv_camera import opencv_yaml
    from irtscots_cl.scene.camera_file import opencv_camera
    from irtscots_cl.scene.presets import load_scene

    scene = load_scene(options.name)
    text = opencv_yaml(opencv_camera(scene.camera, scene.name))
    print_json({"name": scene.name, "opencv": text}) if options.json else print(text, end="")
    return 0
