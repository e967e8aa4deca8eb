"""The manifest of a fringe measurement: what is written is read back, and what is wrong in it is named."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import irtscots_cl as irt
from irtscots_cl.imaging.dots import DotGrid
from irtscots_cl.imaging.fringe_manifest import (
    FringeManifest,
    ShownFrame,
    frames_of,
    image_paths,
    manifest_text,
    read_manifest,
)
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.gray_code import GraySet
from irtscots_cl.imaging.line_pictures import LineSet
from irtscots_cl.imaging.sequences import TimeOrder, fringe_series, in_order

SETS = (FringeSet.equal("x", (0.9, 3.0), 4), FringeSet.equal("y", (0.9, 2.5), 7))


def written(path: Path, **changes) -> Path:
    """A manifest's file with some of its values changed."""
    manifest = replace(FringeManifest("sphere", (21, 21), frames_of(SETS), ("camera",), 8, path=path), **changes)
    path.write_text(manifest_text(manifest, "1"), encoding="utf-8")
    return path


def changed(path: Path, old: str, new: str) -> Path:
    text = written(path).read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


@pytest.fixture
def path(tmp_path):
    return tmp_path / "manifest.toml"


def test_what_is_written_is_read_back(path):
    scene = irt.load_scene("sphere")
    found = read_manifest(written(path), scene)
    assert found.frames == frames_of(SETS) and found.images == ("camera",) and found.scene == "sphere"
    assert found.numbers("dark") == (0,) and found.numbers("white") == (1,)
    for ours, given in zip(found.sets, SETS, strict=True):
        assert (ours.axis, ours.periods, ours.reverse, ours.ends) == (given.axis, given.periods, False, "edges")
        for steps, wanted in zip(ours.steps_rad, given.steps_rad, strict=True):
            np.testing.assert_allclose(steps, wanted, atol=1e-12)
    assert found.order == tuple(range(2, 2 + 8 + 14))
    assert tomllib.loads(path.read_text(encoding="utf-8"))["frames"][3]["step_deg"] == 90.0


def test_names_of_scenes_and_files_need_no_care(path):
    name = 'a "b" \\ \t é \x7f ☃'
    frames = tuple(replace(frame, image=f"{k} {name}") for k, frame in enumerate(frames_of(SETS)))
    found = read_manifest(written(path, scene=name, frames=frames))
    assert found.scene == name and found.frames == frames


def test_frames_may_come_in_any_order(path):
    """Interleaved axes: the order of the sets is found from what the frames show."""
    frames = frames_of(SETS)[2:]
    mixed = tuple(frames[k] for k in np.random.default_rng(1).permutation(len(frames)))
    found = read_manifest(written(path, frames=mixed))
    for one in found.sets:
        assert set(one.periods) in ({0.9, 3.0}, {0.9, 2.5})
    number = 0
    for one in found.sets:
        for periods, steps in zip(one.periods, one.steps_rad, strict=True):
            for step in steps:
                frame = found.frames[found.order[number]]
                assert (frame.axis, frame.periods) == (one.axis, periods)
                assert math.radians(frame.step_deg) == step
                number += 1
    assert number == len(mixed) and sorted(found.order) == list(range(number))


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ('kind = "fringes on a screen"', 'kind = "lines"', "kind = 'lines': must be \"fringes on a screen\""),
        ("screen_pixels = [21, 21]", "screen_pixels = [21, 22]", "[21, 22]: scene sphere has a screen of [21, 21]"),
        ("screen_pixels = [21, 21]", "screen_pixels = [21.0, 21]", "must be [columns, rows]"),
        ("bits = 8", "screen_pixel = 8", "screen_pixel: unknown key; did you mean"),
        ('shows = "white"', 'shows = "grey"', "frames[1].shows = 'grey': must be one of dark, white, fringes"),
        ('shows = "white"', 'shows = "white", axis = "x"', "frames[1].axis: must be left out of a frame that shows"),
        (
            'shows = "white"',
            'shows = "white", image = "a.tif"',
            "frames[0].image: missing (dark); must be given for all",
        ),
        ("step_deg = 180.0", 'step_deg = "180"', "frames[4].step_deg = '180': must be a number"),
        ("step_deg = 180.0", "step_deg = nan", "frames[4].step_deg = nan: must be a number"),
        ("periods = 0.9", "periods = -0.9", "x fringes: periods = [-0.9, 3.0]: must be numbers above 0"),
        ("periods = 0.9", f"periods = 1{'0' * 400}", "frames[2].periods = 1000"),
        ("periods = 0.9, step_deg = 0.0", "period = 0.9, step_deg = 0.0", "period: unknown key; did you mean periods"),
        ('axis = "y"', 'axis = "x"', "frames: fringes along x; must be along x and y"),
        ('axis = "y"', 'axis = ["y"]', "axis = ['y']: must be"),
        ('images = "camera"', "images = 3", "images = 3: must be a string or a list of strings"),
        ('images = "camera"', 'ends = "middle"', 'ends = \'middle\': must be "edges" or "centres"'),
        ('images = "camera"', 'reverse = ["z"]', "reverse = ['z']: must be a list of"),
        ("frames = [", "frames = [ 3,", "frames[0] = 3: must be a table"),
        ("frames = [", "frames = [[", "not a readable TOML file: "),
    ],
)
def test_what_is_wrong_is_named_on_one_line(path, old, new, parts):
    with pytest.raises(ValueError, match=r"manifest\.toml: ") as caught:
        read_manifest(changed(path, old, new), irt.load_scene("sphere"))
    text = str(caught.value)
    assert text.startswith(str(path)) and parts in text and "\n" not in text and len(text) < 400


def test_fewer_than_three_steps_are_refused(path):
    frames = tuple(frame for frame in frames_of(SETS) if not (frame.axis == "x" and frame.step_deg > 90))
    with pytest.raises(ValueError, match="x fringes: 2 steps; must be 3 to 64"):
        read_manifest(written(path, frames=frames))


def test_no_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"none\.toml: not a readable manifest: No such file"):
        read_manifest(tmp_path / "none.toml")


class TestImagePaths:
    def picture(self, path: Path) -> Path:
        path.parent.mkdir(exist_ok=True)
        Image.fromarray(np.zeros((2, 2), np.uint8)).save(path)
        return path

    def test_the_folder_beside_the_manifest(self, path):
        self.picture(path.parent / "camera" / "1.png")
        assert image_paths(read_manifest(written(path))) == [path.parent / "camera"]

    def test_images_beside_the_manifest_without_the_pictures_for_the_screen(self, path):
        found = read_manifest(written(path))
        for name in ("IMG_2.png", "IMG_10.png", found.frames[0].picture):
            self.picture(path.parent / name)
        assert [p.name for p in image_paths(found)] == ["IMG_2.png", "IMG_10.png"]

    def test_no_images_are_named(self, path):
        found = read_manifest(written(path))
        self.picture(path.parent / found.frames[0].picture)
        with pytest.raises(ValueError, match="no images of the camera in .*camera nor beside the manifest"):
            image_paths(found)

    def test_names_with_stars_in_natural_order(self, path):
        for name in ("b10.png", "b9.png", "a.png"):
            self.picture(path.parent / "rec" / name)
        found = read_manifest(written(path, images=("rec/a.png", "rec/b*.png")))
        assert [p.name for p in image_paths(found)] == ["a.png", "b9.png", "b10.png"]
        with pytest.raises(ValueError, match=r"images = 'rec/c\*': no file in .*rec has such a name"):
            image_paths(replace(found, images=("rec/c*",)))
        with pytest.raises(ValueError, match=r"images = 'other': there is no file or folder .*other"):
            image_paths(replace(found, images=("other",)))

    def test_every_frame_names_its_own(self, path):
        frames = tuple(replace(f, image=f"i{k}.tif") for k, f in enumerate(frames_of(SETS)))
        found = read_manifest(written(path, frames=frames))
        assert image_paths(found) == [path.parent / f"i{k}.tif" for k in range(len(frames))]


def test_a_frame_tells_what_it_shows():
    assert ShownFrame("white").text == "white"
    assert ShownFrame("fringes", "x", 0.9, 90.0).text == "x fringes of 0.9 periods at 90 degrees"


def series_of(kind):
    """Series by axis of each kind for a screen of 21 x 21 pixels."""
    if kind == "lines":
        return {axis: [LineSet(1.25, 0.75, 0.5).series(axis, 21)] for axis in "xy"}
    if kind == "dots":
        return {"": [DotGrid(7.5, 2.25, 3).series((21, 21))]}
    if kind == "pictures":
        return {"": [[ShownFrame("picture")] * 3]}
    codes = (GraySet("x", 12.25), GraySet("y", 7.0, inverted=False))
    fringes = [FringeSet.equal(code.axis, (code.cells,), 5) for code in codes] if kind == "gray-phase" else ()
    found = {code.axis: [code.series()] for code in codes}
    for one in fringes:
        found[one.axis] += fringe_series(one)
    return found


@pytest.mark.parametrize("kind", ["lines", "gray", "gray-phase", "dots", "pictures"])
@pytest.mark.parametrize("axes", ["x-then-y", "y-then-x", "interleaved"])
def test_all_kinds_and_orders_are_read_back(path, kind, axes):
    """Every value of every frame, dark and white frames at all places among them."""
    places = ("start", "between", "end")
    frames = in_order(series_of(kind), TimeOrder(axes, places, places, 2, 3))
    found = read_manifest(written(path, frames=frames), irt.load_scene("sphere"))
    assert found.frames == frames and 'kind = "patterns on a screen"' in path.read_text(encoding="utf-8")
    blocks = 4 if kind == "gray-phase" and axes != "interleaved" else 2
    assert len(found.numbers("dark")) == 2 * (blocks + 1) and len(found.numbers("white")) == 3 * (blocks + 1)
    assert len({frame.picture for frame in frames}) == len(frames)


@pytest.mark.parametrize(
    ("kind", "old", "new", "said"),
    [
        ("lines", "width_px = 1.25", "width_px = 0", r"frames\[2\].width_px = 0: must be above 0"),
        ("lines", 'axis = "y"', 'axis = "x"', "frames: line along x; must be along x and y"),
        ("gray", "bit = 1", "bit = 1.5", "bit = 1.5: must be a whole number from 0 to 31"),
        ("gray", "inverted = true", 'inverted = "yes"', "inverted = 'yes': must be true or false"),
        (
            "gray",
            "cells = 12.25, bit = 1",
            "cells = 12.5, bit = 1",
            "cells = 12.5: must be 12.25, as of the planes before",
        ),
        ("gray-phase", "periods = 12.25", "periods = 12.5", "must be one number of periods, equal to that of cells"),
        ("gray-phase", "bits = 8", 'bits = 8\nreverse = ["x"]', "must be left out with a Gray code"),
        ("dots", "pitch_px = 7.5", "pitch_px = -1", "pitch_px = -1: must be above 0"),
        ("dots", "first_px = [", "first_px = [3, ", r"must be \[x, y\]"),
        (
            "dots",
            'shows = "dots", pitch_px',
            'shows = "picture", pitch_px',
            "pitch_px: must be left out of a frame that",
        ),
        (
            "gray",
            'shows = "dark"',
            'shows = "picture"',
            "frames: show gray and picture: must be fringes, lines, a Gray",
        ),
    ],
)
def test_what_is_wrong_in_other_kinds_is_named(path, kind, old, new, said):
    text = written(path, frames=in_order(series_of(kind))).read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=said) as caught:
        read_manifest(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
