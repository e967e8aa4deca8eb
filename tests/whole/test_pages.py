"""tools/docs builds every document, the reference and the scripts as pages, without a warning."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

import irtscots_cl as irt

ROOT = Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "docs"


def build(folder: Path) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, str(TOOL), str(folder)], capture_output=True, text=True, timeout=600, check=False
    )


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> Path:
    for package in ("sphinx", "myst_parser", "latex2mathml"):
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"{package} is not installed: pip install 'irtscots-cl[docs]'")
    folder = tmp_path_factory.mktemp("pages") / "html"
    result = build(folder)
    assert (result.returncode, result.stderr) == (0, "")  # a warning is an error
    return folder


@pytest.mark.slow
def test_every_document_is_a_page_that_the_index_leads_to(pages):
    index = (pages / "index.html").read_text(encoding="utf-8")
    for name in (*(path.stem for path in (ROOT / "docs").glob("*.md")), "readme", "contributing", "changelog"):
        assert (pages / f"{name}.html").exists(), name
        assert f'href="{name}.html"' in index, name


@pytest.mark.slow
def test_links_between_documents_are_links_between_pages(pages):
    for page in pages.glob("*.html"):
        for target in re.findall(r'href="([^"#:]+\.(?:md|html))[#"]', page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"
            assert not target.endswith(".md"), f"{page.name}: {target}"


@pytest.mark.slow
def test_the_reference_has_every_public_name_with_its_docstring(pages):
    text = (pages / "reference.html").read_text(encoding="utf-8")
    for name in set(irt.__all__) - {"__version__"} - set(irt._ALIASES):
        assert re.search(rf'id="irtscots_cl\.(?:\w+\.)*{name}"', text), name
    assert "Place screen and camera for a mirror." in text


@pytest.mark.slow
def test_the_gallery_has_every_script(pages):
    text = (pages / "examples.html").read_text(encoding="utf-8")
    for script in (ROOT / "examples").glob("*.py"):
        assert script.stem.replace("_", " ").capitalize() in text
    assert text.count("--quick") > 10


@pytest.mark.parametrize("folder", ["docs/pages", "examples"])
def test_it_writes_into_no_folder_with_anything_else(folder):
    result = build(ROOT / folder)
    assert result.returncode == 2
    assert "must be new or empty, and outside of docs/" in result.stderr
