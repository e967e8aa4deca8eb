"""The documents: links, paths, commands, generated parts, and what the README's example prints."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import irtscots_cl as irt
from irtscots_cl import cli
from irtscots_cl.cli import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
DOCUMENTS = [README, *sorted((ROOT / "docs").glob("*.md"))]
MAX_README_LINES, MAX_COLUMNS = 150, 120
TEXTS = {path: path.read_text(encoding="utf-8") for path in DOCUMENTS}
NAMES = {command.__name__.rsplit(".", 1)[-1].replace("_", "-") for command in COMMANDS}

LINK = re.compile(r"\]\(([^)\s]+)\)")
COMMAND = re.compile(r"\birtscots ([a-z][a-z-]*)")
PATH = re.compile(r"\b(?:irtscots_cl|kernels|tests|tools|examples|docs)/[\w./*-]*\w/?")
TEST = re.compile(r"`(test_\w+)`")
BLOCK = re.compile(r"^ *```(\w*)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`(irtscots [^`]+)`")
MENTION = re.compile(r"arguments are required|expected one argument|= '[A-Z]': must be a |choice: '(?:K|COMMAND)'")
PARSER = cli._parser()
GENERATED = re.compile(r"<!-- begin: made by (\S+) -->.*?<!-- end -->", re.DOTALL)

every_document = pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)


def written(path: Path) -> str:
    """A document without its generated part, whose words are those of the source."""
    return GENERATED.sub("", TEXTS[path])


def prose(text: str) -> list[str]:
    """The lines of a document that are no table's: a row of a table cannot be broken."""
    return [line for line in text.splitlines() if not line.startswith("|")]


@every_document
def test_links_lead_somewhere(path):
    for target in LINK.findall(TEXTS[path]):
        if not re.match(r"https?:|#", target):
            assert (path.parent / target.partition("#")[0]).exists(), target


@every_document
def test_paths_exist(path):
    for name in PATH.findall(written(path)):
        assert list(ROOT.glob(name)), name


@every_document
def test_commands_exist(path):
    for name in COMMAND.findall(TEXTS[path]):
        assert name in NAMES, f"irtscots {name}"


def command_lines(text: str) -> list[str]:
    """The commands in a document's blocks and sentences, without redirections and marks of what is optional."""
    blocks = [block for kind, block in BLOCK.findall(text) if kind in ("", "sh")]
    lines = [line.strip() for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    lines += [" ".join(line.split()) for line in INLINE.findall(BLOCK.sub("", text))]
    return [re.sub(r"[][]|> .*| \|.*", "", line) for line in lines if line.startswith("irtscots ")]


@every_document
def test_commands_have_options_that_there_are(path, capsys):
    """A mention without its arguments, or with a capital for a value, is no command to run."""
    for line in command_lines(TEXTS[path]):
        try:
            PARSER.parse_args(shlex.split(line, comments=True)[1:])
        except SystemExit as stop:
            said = capsys.readouterr().err
            assert stop.code == 0 or MENTION.search(said), f"{line}: {said}"


def test_every_command_is_documented():
    for path in (README, ROOT / "docs" / "commands.md"):
        assert set(COMMAND.findall(TEXTS[path])) == NAMES


@every_document
def test_named_tests_exist(path):
    tests = "\n".join(file.read_text(encoding="utf-8") for file in (ROOT / "tests").rglob("test_*.py"))
    for name in TEST.findall(written(path)):
        assert f"def {name}(" in tests, name


@every_document
def test_lines_are_short(path):
    assert [line for line in prose(TEXTS[path]) if len(line) > MAX_COLUMNS] == []


def test_readme_is_short():
    assert len(TEXTS[README].splitlines()) <= MAX_README_LINES


def test_every_document_is_linked_from_the_readme():
    linked = {(ROOT / target).resolve() for target in LINK.findall(TEXTS[README])}
    assert {path for path in DOCUMENTS if path != README} <= linked


@pytest.mark.parametrize("tool", ["tools/scene_reference.py", "tools/architecture.py"])
def test_generated_parts_are_up_to_date(tool):
    command = [sys.executable, str(ROOT / tool), "--check"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert result.returncode == 0, result.stderr


def test_every_generated_part_has_its_tool():
    tools = {tool for text in TEXTS.values() for tool in re.findall(r"<!-- begin: made by (\S+) -->", text)}
    assert tools == {"tools/scene_reference.py", "tools/architecture.py"}


def test_the_readmes_example_prints_what_it_says(device, capsys, tmp_path, monkeypatch):
    code, said = re.search(r"```python\n(.*?)```\n\nprints\n\n```\n(.*?)```", TEXTS[README], re.DOTALL).groups()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    exec(compile(code, "README.md", "exec"), {})
    assert {path.name for path in tmp_path.iterdir()} == {"first-look.png", "sphere.dat"}
    printed = capsys.readouterr().out
    number = re.compile(r"[-+]?\d[\d.e-]*")
    assert number.sub("#", printed) == number.sub("#", said)
    assert printed.splitlines()[0] == said.splitlines()[0]  # the pixels used do not depend on the device
    for ours, theirs in zip(printed.splitlines()[1:3], said.splitlines()[1:3], strict=True):
        # the noise of a slope's rms is 1 % here: another device or driver is within a few of these
        assert float(number.findall(ours)[0]) == pytest.approx(float(number.findall(theirs)[0]), rel=0.05)


@pytest.mark.slow
@pytest.mark.needs_device
@pytest.mark.parametrize("name", ["detector", "fringes", "measuring", "patterns", "height-maps"])
def test_scripts_of_the_documents_run(name, device, monkeypatch, tmp_path):
    """Those that begin with the package's import, with the files that they speak of."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    columns, rows = irt.load_scene("sphere").screen.pixels
    np.save("speckle.npy", np.random.default_rng(1).random((rows, columns)))
    scripts = [
        code.replace("z_mm = ...", "import numpy as np; z_mm = np.zeros((800, 800))")  # the reader's own map
        for kind, code in BLOCK.findall(TEXTS[ROOT / "docs" / f"{name}.md"])
        if kind == "python" and "import irtscots_cl as irt" in code
    ]
    assert scripts
    for code in scripts:
        exec(compile(code, f"{name}.md", "exec"), {})
