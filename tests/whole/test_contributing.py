"""The worked examples of CONTRIBUTING.md work, and CITATION.cff says what the package does."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

import irtscots_cl as irt
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.sensitivity import sensitivities
from irtscots_cl.budget.sources import _FIXED, source_of
from irtscots_cl.formats.height_map import MapOptions
from irtscots_cl.formats.maps import ENDINGS, FORMATS
from irtscots_cl.optics.setup import Setup

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
SOURCE, FORMAT = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def defined(code: str) -> dict:
    names = {"__name__": "contributed"}
    exec(compile(code, "CONTRIBUTING.md", "exec"), names)
    return names


def test_the_error_source_is_the_one_that_it_says():
    scene = irt.load_scene("sphere")
    design = MeasuredDesign.of(Setup(scene))
    warm, pitch = sensitivities(design, [defined(SOURCE)["WarmScreen"](), source_of("screen.pitch_relative", scene)])
    scale = np.abs(pitch.height_mm).max() * 8e-6
    assert np.allclose(warm.height_mm, 8e-6 * pitch.height_mm, atol=1e-3 * scale)  # the pitch's is exact, not linear
    assert "screen.warmth_k" not in _FIXED  # the page's own


def test_the_format_reads_what_it_says(tmp_path):
    path = tmp_path / "part.txt"
    path.write_text("PLAIN GRID 2 3 0.5\n1 2 x\n4 5 6\n", encoding="ascii")
    read = defined(FORMAT)["read_plain_grid"]
    found = read(path, MapOptions())
    assert np.allclose(found.heights_mm * 1e6, [[4, 5, 6], [1, 2, np.nan]], equal_nan=True)
    assert found.pitch_mm == (0.5, 0.5)
    path.write_text("PLAIN GRID 2 3 0.5\n1 2 3\n", encoding="ascii")
    with pytest.raises(ValueError, match=r"part.txt: must have rows x columns"):
        read(path, MapOptions())


@pytest.mark.parametrize("name", sorted({*re.findall(r"`((?:irtscots_cl|kernels|tests|examples)/[\w./]+)`", PAGE)}))
def test_its_paths_exist(name):
    assert (ROOT / name).exists()


def test_the_lists_that_it_names_are_there():
    from irtscots_cl.studies.suite import STUDIES

    assert STUDIES and FORMATS and ENDINGS
    assert "`_FIXED`" in PAGE and "`STUDIES`" in PAGE and "`ENDINGS`" in PAGE and "`FORMATS`" in PAGE
    assert max(map(len, (line for line in PAGE.splitlines() if not line.startswith("|")))) <= 120


def test_the_citation_is_of_this_version_and_of_the_paper():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == irt.__version__
    assert cited["license"] == "MIT"
    (paper,) = cited["references"]
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert paper["title"] in readme and f"{paper['start']}-{paper['end']} ({paper['year']})" in readme
    assert paper["authors"][0]["family-names"] == "Choi" and len(paper["authors"]) == 8
