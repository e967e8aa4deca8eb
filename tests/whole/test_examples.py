"""The scripts of examples/: each runs with --quick, prints what its first line promises, and is short."""

import re
import runpy
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples"
SCRIPTS = sorted(FOLDER.glob("*.py"))
MAX_LINES = 50
NUMBER = r"([-+]?\d[\d.]*(?:e[-+]?\d+)?)"


def numbers(pattern: str, text: str) -> list[float]:
    """The numbers that stand where the pattern has #."""
    found = re.findall(re.escape(pattern).replace(r"\#", NUMBER), text)
    assert found, f"{pattern} is not in: {text}"
    return [float(one) for one in found]


def of_the_paper(said):
    assert numbers("pixels used               #", said) == [9796]
    assert numbers("   6       0.3266  #", said)[0] == pytest.approx(0.3266, abs=0.03)  # 5 standard errors


def of_the_paraboloid(said):
    assert numbers("#% of the mirror", said) == [100]
    assert numbers("   6       0.0200  #", said)[0] == pytest.approx(0.02, abs=2e-4)  # 6 standard errors


def of_the_map(said):
    assert numbers("deviation: # nm", said)[0] == pytest.approx(5 / 2**0.5, rel=0.05)  # the camera's pixels smooth it
    assert numbers("piston and tilt: #", said)[0] < 0.2


def of_fringes(said):
    assert numbers("# images", said) == [18]
    assert numbers("rms deviation #", said)[0] == pytest.approx(383, abs=20)  # of the scene's six terms
    assert numbers("standard error #", said)[0] < 40


def of_the_calibration(said):
    assert said.startswith("good:")
    assert numbers("camera.x_mm        #", said)[0] == pytest.approx(0.3, abs=0.015)  # 5 standard errors
    assert abs(numbers("camera.z_mm        #", said)[0]) < 0.05  # where the prior has it


def of_ghosts(said):
    uncoated, single, best = numbers("ghost: # of the direct light", said)
    assert single / uncoated == pytest.approx(0.25**2, rel=0.1)  # two reflections
    assert best / single == pytest.approx(0.25**2, rel=0.1)


def of_scatter(said):
    mirror, lens = (numbers(f"{part}: # of the direct light", said)[0] for part in ("mirror", "lens"))
    assert lens > 50 * mirror


def of_the_budget(said):
    left = numbers(" # nm left", re.sub(" +", " ", said))
    assert left == sorted(left, reverse=True) and left[-1] <= 20 < left[-2]
    words = re.sub(" +", " ", said)
    assert numbers("all, predicted #", words)[0] < numbers("trials below #", words)[0]


def of_devices(said):
    assert "same bits: True" in said


def of_the_study(said):
    errors = [float(line.split()[2]) for line in said.splitlines()[1:]]
    assert len(errors) == 6
    assert all(more < fewer for fewer, more in zip(errors[::2], errors[1::2], strict=True))


CHECKS = {
    "paper_in_20_lines": of_the_paper,
    "own_paraboloid": of_the_paraboloid,
    "off_axis_with_a_map": of_the_map,
    "fringes_from_files": of_fringes,
    "calibration_with_a_prior": of_the_calibration,
    "ghost_study": of_ghosts,
    "scatter_study": of_scatter,
    "budget_and_tolerances": of_the_budget,
    "gpu_or_cluster": of_devices,
    "own_study": of_the_study,
}


def test_every_script_has_its_check():
    assert {script.stem for script in SCRIPTS} == set(CHECKS)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_scripts_are_short(script):
    assert len(script.read_text(encoding="utf-8").splitlines()) <= MAX_LINES


@pytest.mark.slow
@pytest.mark.needs_device
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_scripts_do_what_they_promise(script, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(sys, "argv", [str(script), "--quick"])
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(script), run_name="__main__")
    CHECKS[script.stem](capsys.readouterr().out)
    assert not list(tmp_path.iterdir())  # nothing is left where it was started
