"""Completion in the shell, as a shell asks for it: environment variables in, words out."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from irtscots_cl.cli import completion

pytest.importorskip("argcomplete")


def completed(line: str, folder) -> list[str]:
    """What can stand at the end of a line."""
    out = folder / "words"
    protocol = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "COMP_TYPE": "9",
                "_ARGCOMPLETE_IFS": "\n", "_ARGCOMPLETE_STDOUT_FILENAME": str(out)}  # fmt: skip
    subprocess.run(
        [sys.executable, "-m", "irtscots_cl"], cwd=folder, env=os.environ | protocol, capture_output=True, check=True
    )
    return [word.strip() for word in out.read_text().split("\n") if word.strip()]


def test_commands_options_presets_and_folders_are_completed(tmp_path):
    (tmp_path / "mine.toml").touch()
    (tmp_path / "done").mkdir()
    (tmp_path / "done" / "report.json").touch()
    (tmp_path / "other").mkdir()
    assert set(completed("irtscots re", tmp_path)) == {"reconstruct", "reproduce"}
    assert "--rays-per-pixel" in completed("irtscots run sphere --rays", tmp_path)
    assert set(completed("irtscots run sphere-d", tmp_path)) == {"sphere-deviated", "sphere-doublet"}
    assert "mine.toml" in completed("irtscots check mi", tmp_path)
    assert completed("irtscots view ", tmp_path) == ["done/"]
    (tmp_path / "other" / "progress.json").touch()
    assert completed("irtscots watch ", tmp_path) == ["done/", "other/"]


@pytest.mark.parametrize(
    "text, action, words",
    [
        ("so", "sampler", ["sobol"]),
        ("f", "estimator", ["forward"]),
        ("", "precision", ["fp32", "fp64"]),
        ("g", "device", ["gpu"]),
        ("table", "what", ["table4", "table5"]),
    ],
)
def test_words_of_options(text, action, words):
    import argparse

    argument = argparse.ArgumentParser().add_argument(f"--{action}")
    assert completion._completer(argument)(text) == words


def test_every_word_is_accepted():
    """The lists are kept here by hand, so that completion needs no slow import; they are those of the program."""
    from irtscots_cl.maths.low_order import TERMS
    from irtscots_cl.measurement.coefficients import KINDS
    from irtscots_cl.measurement.methods import MEASURES
    from irtscots_cl.studies.suite import STUDIES
    from irtscots_cl.tracing.options import ANALYTIC, ESTIMATORS, NONSEQUENTIAL
    from irtscots_cl.tracing.samplers import SAMPLERS

    assert set(completion.WORDS["measure"]) == set(MEASURES)
    assert set(completion.WORDS["sampler"]) == set(SAMPLERS)
    assert set(completion.WORDS["estimator"]) == {*ESTIMATORS, ANALYTIC, NONSEQUENTIAL}
    assert set(completion.WORDS["remove"]) <= set(TERMS)
    assert set(completion.WORDS["zernike"]) == set(KINDS)
    assert set(completion.WORDS["what"]) == {*STUDIES, "all"}


def test_doctor_says_how_to_set_it_up(irtscots, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("SHELL", "/usr/bin/zsh")
    monkeypatch.setattr("irtscots_cl.cli.doctor._devices", tuple)
    if not completion.is_set_up(tmp_path):
        out = irtscots("doctor")[1]
        assert "register-python-argcomplete irtscots" in out and ">> ~/.zshrc" in out
    (tmp_path / ".bashrc").write_text('eval "$(/x/register-python-argcomplete irtscots)"\n')
    assert "set up in the shell\n" in irtscots("doctor")[1]


def test_without_a_shell_that_completes_nothing_is_imported():
    code = "import sys; from irtscots_cl.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass\n"
    code += "assert not {'argcomplete', 'irtscots_cl.cli.completion'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
