"""Options on a laboratory's camera: what they become, and how wrong ones are named."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import pytest

from irtscots_cl import cli
from irtscots_cl.cli.camera_options import add_camera_files, camera_of, given_options
from irtscots_cl.formats.frames import ReadOptions
from irtscots_cl.imaging.camera_files import CameraFiles


def parsed(*arguments):
    parser = argparse.ArgumentParser()
    parser.add_argument("--saturation", type=float, default=math.inf)
    add_camera_files(parser)
    return parser.parse_args(arguments)


def test_options_are_what_a_manifest_s_table_may_say():
    assert camera_of(parsed()) == CameraFiles() and given_options(parsed()) == []
    options = parsed(
        "--dark", "d1.tif", "d2.tif", "--flat", "f", "--bias", "b", "--flat-dark", "fd", "--bad-pixels", "bad.png",
        "--exposures-s", "0.5", "2", "--repeat-order", "in turn", "--dark-exposure-s", "2", "--flat-exposure-s", "3",
        "--fits-rows", "top-down", "--ser-byte-order", "big", "--array", "a", "--saturation", "4095",
    )  # fmt: skip
    assert camera_of(options) == CameraFiles(
        dark=(Path("d1.tif"), Path("d2.tif")), flat=(Path("f"),), bias=(Path("b"),), flat_dark=(Path("fd"),),
        bad_pixels=Path("bad.png"), saturation=4095.0, exposures_s=(0.5, 2.0), repeat_order="in turn",
        dark_exposure_s=2.0, flat_exposure_s=3.0, read=ReadOptions("big", "top-down", "a"),
    )  # fmt: skip
    assert len(given_options(options)) == 12 and "--bad-pixels" in given_options(options)


@pytest.mark.parametrize("arguments, said", [
    (("--repeats", "0"), "--repeats = 0: must be 1 to"),
    (("--exposures-s", "1", "-2"), "--exposures-s = [1.0, -2.0]: must be numbers above 0"),
    (("--repeat-order", "x"), "--repeat-order = 'x': must be one of 'together', 'in turn'"),
    (("--fits-rows", "up"), "--fits-rows = 'up': must be one of"),
    (("--ser-byte-order", "middle"), "--ser-byte-order = 'middle': must be one of"),
    (("--flat-dark", "d"), "--flat-dark: must be left out where there are no flat frames"),
    (("--saturation", "-3"), "--saturation = -3: must be a number above 0"),
])  # fmt: skip
def test_wrong_values_are_named_by_the_option(arguments, said):
    with pytest.raises(ValueError, match=".") as caught:
        camera_of(parsed(*arguments))
    assert str(caught.value).startswith(said)


def test_a_sofast_measurement_takes_no_calibration_frames(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("irtscots_cl.formats.sofast.is_sofast_measurement", lambda path: True)
    assert cli.main(["reconstruct", str(tmp_path / "m.h5"), "--scene", "sphere", "--repeats", "2"]) == 2
    assert "--repeats: must be left out of a SOFAST measurement" in capsys.readouterr().err
