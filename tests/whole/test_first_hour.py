"""docs/first-hour.md does what it says: every command, script and table of it, in its order, in an empty folder."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "first-hour.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
SET_UP, OWN = BLOCKS[0], BLOCKS[1:]
NUMBER = re.compile(r"[-+]?\d[\d,.]*(?:e[-+]?\d+)?")
VALUE = 0.1  # of a number's size, that another device's rays or another library's rounding may change


def words(text: str) -> str:
    """The text without its numbers, and with single spaces."""
    return " ".join(NUMBER.sub("#", text).split())


def numbers(text: str) -> list[float]:
    return [float(one.replace(",", "").rstrip(".")) for one in NUMBER.findall(text)]


def assert_said(line: str, printed: str) -> None:
    """Some line that was printed has these words, and nearly these numbers."""
    found = [one for one in printed.splitlines() if words(line) in words(one)]
    wanted = numbers(line)
    near = [one for one in found if numbers(one)[: len(wanted)] == pytest.approx(wanted, rel=VALUE)]
    assert near, f"{line!r} is not in {found or printed}"


def test_the_page_has_blocks_of_known_kinds():
    assert {kind for kind, _ in BLOCKS} == {"sh", "text", "python", "toml"}
    assert SET_UP[0] == "sh" and len(OWN) > 10


@pytest.mark.slow
@pytest.mark.needs_device
def test_every_command_and_script_does_what_the_page_says(irtscots, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    printed = ""
    for kind, text in OWN:
        if kind == "sh":
            printed = ""
            for line in text.replace("\\\n", " ").splitlines():
                command, *arguments = shlex.split(line)
                assert command == "irtscots"
                code, out, err = irtscots(*arguments)
                assert code == 0, err
                printed += out
        elif kind == "python":
            exec(compile(text, "rehearse.py", "exec"), {})
            printed = capsys.readouterr().out
        elif kind == "toml":
            with open("mine.toml", "a", encoding="utf-8") as scene:
                scene.write("\n" + text)
        else:
            for line in text.splitlines():
                assert_said(line, printed)
    for name in ("first/report.html", "measured/report.html", "measured.dat"):
        assert (tmp_path / name).stat().st_size > 0


@pytest.mark.slow
@pytest.mark.needs_device
def test_the_set_up_works_where_there_is_an_environment():
    """Its making, by the network, is not repeated."""
    if not (ROOT / ".venv" / "bin" / "python").exists():
        pytest.skip("no .venv in this folder: tools/run makes it")
    script = "set -e\n" + SET_UP[1].replace("tools/run\n", "tools/run --rays-per-pixel 64 --out $OUT\n")
    done = subprocess.run(
        ["bash", "-c", f"OUT=$(mktemp -d)/out\n{script}"],
        cwd=ROOT, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "results in" in done.stdout and "self-test" in done.stdout
