"""Round trip: noisy images of a simulated test, in every kind of file and every orientation, to the height map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from fringe_folders import recorded, stored_as
from lab_files import write_frames
from scenes import coarse, scene_of, with_part

import irtscots_cl as irt
from irtscots_cl.imaging.fringe_images import open_fringe_images
from irtscots_cl.imaging.fringe_manifest import manifest_text
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.lab_camera import recorded_images
from irtscots_cl.pipeline.measure import RefusedImagesError
from irtscots_cl.pipeline.measure_fringes import fringe_surface
from irtscots_cl.scene.instrument import ORIENTATIONS

SETS = tuple(FringeSet.equal(axis, (0.9, 2.46), 4) for axis in "xy")
pytestmark = pytest.mark.needs_device


def without_symmetry():
    """The lop-sided scene with a screen that the whole mirror's light falls on."""
    return coarse(with_part(scene_of("lopsided"), "screen", pixels=(46, 51)), 30)


@pytest.fixture(scope="module")
def scene():
    return without_symmetry()


@pytest.fixture(scope="module")
def run(scene):
    return irt.trace(scene, estimator="analytic")


@pytest.fixture(scope="module")
def setups():
    """Set-ups by the orientation, made once."""
    made: dict[str, Setup] = {}

    def setup(scene, word):
        key = f"{scene.name} {word}"
        if key not in made:
            made[key] = Setup(stored_as(scene, word).nominal())
        return made[key]

    return setup


def folder_with(path: Path, lab, kind: str, **names) -> Path:
    written = write_frames(path / "camera", lab.frames, kind, **names)
    where = (f"camera/{written[0].name}",) if len(written) == 1 else ("camera",)
    text = manifest_text(replace(lab.manifest, images=where), "test")
    (path / "manifest.toml").write_text(text, encoding="utf-8")
    return path


def measured(folder: Path, setup: Setup):
    """What the folder's files alone give."""
    return fringe_surface(recorded_images(open_fringe_images([folder], setup.scene)), setup)


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(("kind", "word", "bits"), [
    ("tif12", "upright", 12), slow("tif16", "rows-reversed", 12), slow("png8", "columns-reversed", 8),
    slow("fits", "half-turn", 12), slow("ser-little", "transposed", 12), ("ser-big", "quarter-turn", 12),
    slow("fits-cube", "three-quarter-turn", 12), slow("tif-pages", "transposed-half-turn", 12),
    slow("npz", "quarter-turn", 12), slow("h5", "transposed", 12),
])  # fmt: skip
def test_the_height_comes_back_from_files_alone(run, scene, setups, tmp_path, kind, word, bits):
    """Within its stated error. A height's error is mostly its lowest terms: 9 numbers make 24 % of scatter."""
    setup = setups(scene, word)
    folder = folder_with(tmp_path, recorded(run, stored_as(scene, word), SETS, bits=bits, seed=11), kind)
    found, checks = measured(folder, setup)
    assert {check.level for check in checks} == {"ok"}
    result = found.result
    bars, mask = error_bars(result), result.height_mask
    true_mm = Setup(scene).chief_rays.surface.deviation_at(result.x_mm, result.y_mm)[0]
    left = remove_terms(result.x_mm, result.y_mm, result.deviation_mm - true_mm, mask, "piston_tilt")
    assert mask.sum() > 400
    assert 0.3 < rms(left, mask) / rms(bars.height_mm, mask) < 1.8  # 3 sigma of that scatter


def refusal(run, scene, setups, path, stored, told):
    """Why files that lie as `stored` says are refused by a scene that says `told`."""
    folder = folder_with(path, recorded(run, stored_as(scene, stored), SETS, seed=11), "tif16")
    with pytest.raises(RefusedImagesError, match="orientation") as caught:
        measured(folder, setups(scene, told))
    return str(caught.value)


@pytest.mark.parametrize("word", [ORIENTATIONS[4], *(slow(w) for w in ORIENTATIONS[1:4] + ORIENTATIONS[5:])])
def test_a_wrong_orientation_is_named_with_the_one_value_to_set(run, scene, setups, tmp_path, word):
    said = refusal(run, scene, setups, tmp_path, word, "upright")
    assert f'set camera.detector.orientation = "{word}" (now "upright")' in said
    assert said.count("set camera.detector.orientation") == 1 and "symmetric" not in said and "mend" not in said


def test_a_wrong_orientation_is_named_from_another_wrong_one(run, scene, setups, tmp_path):
    said = refusal(run, scene, setups, tmp_path, "rows-reversed", "quarter-turn")
    assert 'set camera.detector.orientation = "rows-reversed" (now "quarter-turn")' in said


@pytest.mark.slow
@pytest.mark.parametrize("word", ORIENTATIONS[1:])
def test_a_symmetric_set_up_names_the_value_and_that_it_cannot_tell(setups, tmp_path, word):
    """A sphere with camera and screen side by side: a mirrored image is as a mirrored picture on the screen."""
    scene = coarse("sphere-deviated", 25)
    said = refusal(irt.trace(scene, estimator="analytic"), scene, setups, tmp_path, word, "upright")
    assert f'camera.detector.orientation = "{word}" (now "upright")' in said
    assert "a symmetric set-up does not tell these apart" in said and "a fiducial would tell" in said


def test_exchanged_rows_and_columns_are_named_before_anything_is_measured(run, scene, tmp_path):
    """Pixels that are not as many along both sides."""
    lab = recorded(run, scene, SETS)
    folder = folder_with(tmp_path, replace(lab, frames=lab.frames[:, :28]), "tif16")
    detector = replace(scene.camera.detector, pixels=(28, 30))
    narrow = replace(scene, camera=replace(scene.camera, detector=detector))
    with pytest.raises(ValueError, match="images of 30 x 28 pixels.* are 28 x 30") as caught:
        open_fringe_images([folder], narrow)
    assert "rows and columns are exchanged, the orientation is one of transposed, quarter-turn" in str(caught.value)
