"""Exposure times by files and by what was told, and those that contradict each other."""

from __future__ import annotations

import numpy as np
import pytest
from picture_files import fits, ramp

from irtscots_cl.formats.images import open_frames
from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.exposures import check_equal, common_exposure, exposures_of

pytest.importorskip("astropy", reason="pip install irtscots-cl[fits]")


def series(folder, times):
    """FITS files with these exposure times, None for those without."""
    for k, (image, time) in enumerate(zip(ramp(len(times)), times, strict=True)):
        cards = [] if time is None else [f"EXPTIME = {time:20.6f}"]
        (folder / f"a{k}.fits").write_bytes(fits(image.astype(np.int64), 16, *cards))
    return open_frames(folder)


def test_exposures_are_those_of_the_files(tmp_path):
    frames = series(tmp_path, [0.5, 0.5, 0.5])
    assert exposures_of(frames, CameraFiles()) == (0.5,) and common_exposure(frames) == 0.5
    assert common_exposure(None) is None


@pytest.mark.parametrize("order, times", [("together", [1, 4, 1, 4, 1, 4]), ("in turn", [1, 1, 1, 4, 4, 4])])
def test_exposures_of_the_images_of_a_frame_are_found(tmp_path, order, times):
    frames = series(tmp_path, times)
    assert exposures_of(frames, CameraFiles(repeats=2, repeat_order=order)) == (1, 4)
    other = "in turn" if order == "together" else "together"
    with pytest.raises(ValueError, match=r"a\d.fits: \d s by the file; the first of its place has \d s: must be equal"):
        exposures_of(frames, CameraFiles(repeats=2, repeat_order=other))
    assert common_exposure(frames) is None


def test_files_that_contradict_the_table_are_named(tmp_path):
    frames = series(tmp_path, [1, 4, 1, 4])
    assert exposures_of(frames, CameraFiles(exposures_s=(1.0, 4.0005))) == (1.0, 4.0005)  # programs round
    with pytest.raises(ValueError, match=r"a0.fits: 1 s by the file; exposures_s says 4 s: must be equal"):
        exposures_of(frames, CameraFiles(exposures_s=(4.0, 1.0)))


def test_what_files_do_not_say_is_not_known(tmp_path):
    frames = series(tmp_path, [1, None, 1, None])
    assert exposures_of(frames, CameraFiles()) == (None,)
    assert exposures_of(frames, CameraFiles(repeats=2)) == (None, None)
    assert exposures_of(frames, CameraFiles(exposures_s=(1.0, 4.0))) == (1.0, 4.0)


def test_images_of_several_exposures_have_no_common_dark_frame(tmp_path):
    frames = series(tmp_path, [1, 1, 2, 2])
    assert exposures_of(frames, CameraFiles()) == (None,)
    with pytest.raises(ValueError, match=r"a2.fits: 2 s by the file, .*a0.fits 1 s: must be equal where dark frames"):
        exposures_of(frames, CameraFiles(dark=(tmp_path,)))


def test_a_series_must_have_one_exposure(tmp_path):
    frames = series(tmp_path, [1, 1, 2, 2])
    check_equal(frames, [(0, 1), (2, 3)], "a series")
    with pytest.raises(ValueError, match=r"a2.fits: 2.0 s exposure, .*a0.fits: 1.0 s, by the files: must be equal"):
        check_equal(frames, [(0, 1, 2)], "a series")
