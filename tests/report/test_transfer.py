"""Tables, sentences, data and figure of a transfer function."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scenes import coarse

from irtscots_cl.measurement.transfer_function import TransferFunction
from irtscots_cl.measurement.transfer_summary import TransferSummary, summarise
from irtscots_cl.report.transfer import sentences, transfer_facts, transfer_tables, write_transfer_figure
from irtscots_cl.system.atomic_files import plain


@pytest.fixture(scope="module")
def found() -> TransferSummary:
    transfer = TransferFunction.of(coarse("sphere", 25).nominal(), "fine")
    pixel = transfer.geometry(transfer.nearest()).pixel[0, 0, 0]
    return summarise(transfer, np.array([300.0, 1.3 * pixel, pixel]), ripple_nm=3.0)


def test_only_factors_that_there_are_have_columns(found):
    head = transfer_tables(found)[0].head
    assert "sharpening" in head and "diffraction" not in head and "model" not in head
    assert transfer_tables(found)[1].rows[0][0] == "x" and len(transfer_tables(found)[1].rows) == 2


def test_sentences(found):
    told = sentences(found, True)
    assert told[0] == "a 300 mm ripple of 3 nm would be seen as 2.9 nm"
    assert "an alias" in told[1] and "seen as a tilt" in told[2]
    assert len(sentences(found, False)) == 1


def test_data_are_json(found):
    data = plain(transfer_facts(found))
    assert json.loads(json.dumps(data))["waves"][2]["height"] is None
    assert data["waves"][0]["seen_nm"] == pytest.approx(3 * data["waves"][0]["height"])


def test_figure(found, tmp_path):
    assert (tmp_path / write_transfer_figure(found, tmp_path)).read_bytes().startswith(b"\x89PNG")
