"""Completion in the shell by argcomplete: what each argument can be. Imported only while a shell completes a line."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from irtscots_cl.cli.job_file import FILE
from irtscots_cl.cli.reproduce import NAMES
from irtscots_cl.scene.presets import preset_names

COMMAND = "irtscots"
_MEASURES = ("paper", "fine", "refined", "likelihood", "windowed")
_REMOVED = ("none", "piston", "piston_tilt", "piston_tilt_power", "piston_tilt_power_astigmatism")
# What an option can be, for those that are checked by the command, not by the parser.
WORDS = {
    "estimator": ("forward", "adjoint", "analytic", "nonsequential"),
    "sampler": ("philox", "sobol", "lattice"),
    "precision": ("fp32", "fp64"),
    "measure": _MEASURES,
    "zernike": ("circular", "annular"),
    "aim": ("mirror", "camera"),
    "branches": ("random", "split"),
    "polarisation": ("auto", "on", "off"),
    "remove": _REMOVED,
    "device": ("cpu", "gpu", "all"),  # names of devices would need the slow import of pyopencl
    "side": ("+x", "-x", "+y", "-y"),
    "what": (*NAMES.split(", "), "all"),
    "name": tuple(preset_names()),
}


def answer(parser: argparse.ArgumentParser) -> None:
    """Print what can follow on the shell's line, and end the process. Without argcomplete nothing can."""
    try:
        import argcomplete
    except ImportError:
        sys.exit(1)
    for action in _actions(parser):
        completer = _completer(action)
        if completer is not None:
            action.completer = completer  # type: ignore[attr-defined]
    argcomplete.autocomplete(parser, always_complete_options=False)


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """The arguments of a parser and of its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                yield from _actions(one)


def _completer(action: argparse.Action) -> Callable[..., Iterable[str]] | None:
    """What finds the words of an argument; None where files, argcomplete's own choice, or the parser's choices do."""
    if action.choices is not None:
        return None
    if action.dest == "scene":
        return _scenes
    if action.dest in ("folder", "folders"):
        return _run_folders
    if action.dest in WORDS:
        return lambda prefix, **_: [word for word in WORDS[action.dest] if word.startswith(prefix)]
    if action.metavar == "DIR":
        return lambda prefix, **_: _folders(prefix)
    return None


def _scenes(prefix: str, **_: object) -> list[str]:
    """Presets, and TOML files as the command line wants them."""
    files = [name for name in _entries(prefix) if name.endswith(".toml")]
    return [*(name for name in preset_names() if name.startswith(prefix)), *files, *_folders(prefix)]


def _run_folders(prefix: str, **_: object) -> list[str]:
    """Folders with a finished or a running run; else all, on the way to one."""
    folders = _folders(prefix)
    told = ("report.json", "checkpoint", FILE)
    runs = [name for name in folders if any((Path(name) / file).exists() for file in told)]
    return runs or folders


def _folders(prefix: str) -> list[str]:
    return [f"{name}/" for name in _entries(prefix) if Path(name).is_dir()]


def _entries(prefix: str) -> list[str]:
    """Files and folders that begin so, hidden ones apart."""
    head, slash, start = prefix.rpartition("/")
    folder = Path(head + slash) if slash else Path()
    try:
        names = sorted(path.name for path in folder.iterdir())
    except OSError:
        return []
    return [head + slash + name for name in names if name.startswith(start) and (start or not name.startswith("."))]


def set_up_line(shell: str) -> str:
    """The command that sets completion up in a shell, named by its path."""
    register = Path(sys.executable).parent / "register-python-argcomplete"
    name = Path(shell).name
    if name == "fish":
        return f"{register} --shell fish {COMMAND} > ~/.config/fish/completions/{COMMAND}.fish"
    return f"echo 'eval \"$({register} {COMMAND})\"' >> ~/.{'zshrc' if name == 'zsh' else 'bashrc'}"


def is_set_up(home: Path) -> bool:
    """Whether the start-up files of a shell, or argcomplete's completion of all programs, are there for the command."""
    for name in (".bashrc", ".bash_profile", ".profile", ".zshrc", ".zshenv"):
        path = home / name
        if path.is_file() and f"argcomplete {COMMAND}" in path.read_text(encoding="utf-8", errors="replace"):
            return True
    of_all = (".bash_completion.d/python-argcomplete", ".zsh/completion/_python-argcomplete",
              f".config/fish/completions/{COMMAND}.fish",
              f".local/share/bash-completion/completions/{COMMAND}")  # fmt: skip
    system = Path("/etc/bash_completion.d/python-argcomplete")
    return system.exists() or any((home / name).exists() for name in of_all)
