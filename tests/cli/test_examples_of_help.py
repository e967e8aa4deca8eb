"""The example that ends the help of every command."""

from __future__ import annotations

import argparse
import shlex

import pytest
from stored_runs import store_run
from synthetic import small_scene

from irtscots_cl import cli
from irtscots_cl.cli.common import EXAMPLE

# Those that trace, or measure, for longer than a test should; on coarse detectors, with few rays.
SLOW = ("run", "reconstruct", "calibrate", "paths", "check", "design-patterns", "budget", "identify", "bench",
        "stability", "reproduce", "patterns", "view")  # fmt: skip


def parsers() -> dict[str, argparse.ArgumentParser]:
    (action,) = (one for one in cli._parser()._actions if isinstance(one, argparse._SubParsersAction))
    return dict(action.choices)


def example(name: str) -> list[str]:
    """The words of a command's example."""
    line = parsers()[name].epilog
    assert line.startswith(f"{EXAMPLE}irtscots {name}")
    return shlex.split(line.removeprefix(EXAMPLE))[1:]


@pytest.mark.parametrize("name", parsers())
def test_the_help_ends_with_an_example_that_the_parser_takes(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "50")
    with pytest.raises(SystemExit):
        cli.main([name, "--help"])
    assert capsys.readouterr().out.splitlines()[-1] == parsers()[name].epilog  # in one piece, to be copied
    options = cli._parser().parse_args(example(name))
    assert callable(options.command)


@pytest.fixture
def there(tmp_path, monkeypatch):
    """An empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", [name for name in parsers() if name not in SLOW])
def test_quick_examples_run(name, irtscots, there):
    if {"out/result.h5", "out"} & set(example(name)):
        store_run(there / "out")
    code, out, err = irtscots(*example(name))
    assert code == 0 and out, err


CHEAPER = {
    "run": ("--no-figures",),
    "paths": ("--rays-per-pixel", "1024"),
    "view": ("--out", "page.html"),
    "check": ("--quick", "--no-figures"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SLOW if name not in ("bench", "stability", "reproduce")])
def test_slow_examples_run(name, irtscots, there, device):
    """The same words, with coarse detectors in place of the presets."""
    (there / "coarse.toml").write_text(small_scene("sphere-deviated", 25).to_toml())
    words = ["coarse.toml" if word == "sphere-deviated" else word for word in example(name)]
    for folder in {word.split("/")[0] for word in words} & {"out", "measured"} if name != "run" else ():
        if name == "view" or folder == "out":
            store_run(there / folder)
    code, out, err = irtscots(*words, *CHEAPER.get(name, ()))
    assert code == 0 and out, err
