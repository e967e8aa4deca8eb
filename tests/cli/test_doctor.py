"""`irtscots doctor`, `--version`, and the grouped help."""

from __future__ import annotations

import json

import pytest

import irtscots_cl as irt
from irtscots_cl import cli


def test_doctor_finds_a_working_machine(irtscots, device):
    code, out, err = irtscots("doctor", "--json")
    assert (code, err) == (0, "")
    lines = json.loads(out)
    assert {"ok"} <= {line["level"] for line in lines} <= {"ok", "note"}
    assert any(line["what"] == "device" and device.name in line["text"] for line in lines)
    assert f"irtscots-cl {irt.__version__}" in next(line["text"] for line in lines if line["what"] == "versions")


def test_doctor_names_a_folder_that_cannot_be_used(irtscots, tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_text("")
    monkeypatch.setenv("POCL_CACHE_DIR", str(file))
    code, out, _ = irtscots("doctor")
    assert code == 3 and "problem  PoCL's cache" in out and "POCL_CACHE_DIR" in out


def test_doctor_tells_of_a_choice_that_fits_no_device(irtscots, monkeypatch):
    monkeypatch.setenv("IRTSCOTS_DEVICE", "nonsense")
    code, out, _ = irtscots("doctor")
    assert code == 3 and "problem  IRTSCOTS_DEVICE" in out and "nonsense" in out


def test_version(capsys):
    with pytest.raises(SystemExit) as left:
        cli.main(["--version"])
    assert left.value.code == 0 and capsys.readouterr().out == f"irtscots-cl {irt.__version__}\n"


def test_every_command_is_in_its_group(capsys):
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    said = capsys.readouterr().out
    assert [line[:-1] for line in said.splitlines() if line[:-1] in cli.GROUPS] == list(cli.GROUPS)
    for group in cli.GROUPS.values():
        for module in group:
            name = {"map": "map"}.get(module.__name__.rsplit(".", 1)[-1], module.__name__.rsplit(".", 1)[-1])
            assert f"\n  {name.replace('_', '-')} " in said


def test_scenes_are_told_in_whole_sentences(irtscots):
    code, out, _ = irtscots("scenes")
    assert code == 0 and all(line.endswith((".", ")")) for line in out.splitlines())


def test_tables_obey_columns(irtscots, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    code, out, _ = irtscots("transfer", "sphere")
    assert code == 0 and max(map(len, out.splitlines())) <= 120
