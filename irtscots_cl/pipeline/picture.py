"""What one picture of the mirror tells beside its fringes: outline, fiducials, and the pixels that may be used."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import binary_dilation, binary_erosion, binary_fill_holes

from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.mark_files import Marks, read_marks
from irtscots_cl.imaging.mask_files import AUTO, DESIGN, check_mask_lies, mask_file, read_mask
from irtscots_cl.imaging.orientation import stored
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.mirror_mask import largest_region, mirror_mask
from irtscots_cl.measurement.mirror_outline import NoOutlineError
from irtscots_cl.measurement.outline_checks import MirrorOutline, find_outline, outline_checks
from irtscots_cl.measurement.quality import ERROR, OK, WARNING, Check
from irtscots_cl.measurement.rim_curve import RimCurve
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.report.picture import fiducial_facts, outline_facts
from irtscots_cl.report.types import MeasuredFacts
from irtscots_cl.scene.model import Scene

if TYPE_CHECKING:
    from irtscots_cl.measurement.fiducial_checks import SceneChange
    from irtscots_cl.measurement.fiducial_mapping import FiducialMap

SURE = 0.4  # share on the mirror by the picture, below which a pixel is left out: half, less what the edge is unsure by
HALF = 0.5  # share of a pixel on the design's mirror
BESIDE = 4  # pixels beside a mask in which the mirror's edge is looked for
SEEN = 0.7  # of the rim: with less, the picture's edge leaves out no pixel


@dataclass(frozen=True)
class MaskChoice:
    """Which pixels may be used. how: AUTO, DESIGN, or "file". use: [rows, columns] upright, of a file; None without
    one. path: of the file. marks: on the mirror."""

    how: str = AUTO
    use: BoolArray | None = field(default=None, repr=False)
    path: Path | None = None
    marks: Marks | None = None

    @classmethod
    def of(
        cls, mask: Path | None, fiducials: Path | None, scene: Scene, orientation: str, radius_mm: float | None = None
    ) -> MaskChoice:
        """mask: a file, or Path(AUTO) or Path(DESIGN); None: AUTO. fiducials: table of marks. orientation: of the
        images' files. radius_mm: of the mirror, for marks; None: the scene's. Raises ValueError."""
        columns, rows = scene.camera.detector.pixels
        radius = scene.mirror.diameter_mm / 2 if radius_mm is None else radius_mm
        marks = None if fiducials is None else read_marks(fiducials, radius)
        path = mask_file(mask)
        if path is not None:
            return cls("file", read_mask(path, (rows, columns), orientation), path, marks)
        return cls(AUTO if mask is None else str(mask), None, None, marks)


@dataclass(frozen=True)
class MirrorPicture:
    """All maps are [rows, columns] upright. off_edge: pixels that are less than half on the mirror by its outline in
    the picture. on_mark: those that see a fiducial. counts: of pixels, by what tells that they see the mirror."""

    choice: MaskChoice
    outline: MirrorOutline | None
    fiducials: FiducialMap | None
    change: SceneChange | None
    checks: list[Check]
    off_edge: BoolArray = field(repr=False)
    on_mark: BoolArray = field(repr=False)
    counts: dict[str, int]

    def masks(self, lit: BoolArray, design: BoolArray, orientation: str) -> dict[str, Any]:
        """The arguments lit, use, edge and marks of fringe_quality.exclusions, as the images are stored.

        lit: pixels with light. design: those at least half on the design's mirror; both upright.
        """
        base = design if self.choice.how == DESIGN else lit
        maps = {"lit": base, "use": self.choice.use, "edge": self.off_edge, "marks": self.on_mark}
        return {name: None if values is None else stored(values, orientation) for name, values in maps.items()}


def look_at_mirror(
    signal: FloatArray,
    lit: BoolArray,
    chief: ChiefRays,
    design: BoolArray,
    choice: MaskChoice,
    rim: RimCurve | None = None,
) -> MirrorPicture:
    """Outline and fiducials in a picture, against the design.

    signal: [rows, columns] upright, bright on the mirror. lit: pixels with light. design: those at least half on the
    design's mirror. rim: the outline of a mirror that is no round disk. Raises ValueError for a mask that lies
    otherwise, or marks that the camera cannot see.
    """
    if choice.use is not None and choice.path is not None:
        check_mask_lies(choice.path, choice.use, design | lit)
    outline, checks = None, []
    if choice.use is not None:  # what lies beside the mask does not matter, but for the mirror's edge along it
        inside = binary_erosion(design, iterations=2)
        asked = choice.use | (binary_dilation(choice.use, iterations=BESIDE) & ~inside)
        signal, lit = np.where(asked, signal, np.nan), lit & asked
    try:
        outline = find_outline(signal, lit, chief, rim)
    except NoOutlineError as error:
        level = WARNING if choice.use is None else OK
        checks = [Check("outline shift", level, 0.0, 0.0, 0.0, f"the mirror's outline is not measured: {error}")]
    found, change, marked = None, None, np.zeros(lit.shape, bool)
    on_marks: list[Check] = []
    if choice.marks is not None:
        from irtscots_cl.measurement.fiducial_checks import fiducial_checks, suggested_change  # few mirrors have marks
        from irtscots_cl.measurement.fiducial_mapping import MirroredMarksError, map_fiducials

        mirror = _region(lit) if outline is None else outline.coverage > 0
        try:
            found = map_fiducials(signal, mirror, chief, choice.marks)
            change = suggested_change(found, chief)
            marked = found.covered(lit.shape)
            if outline is not None:  # again, without the marks beside the rim
                outline = find_outline(np.where(marked, np.nan, signal), lit, chief, rim, outline)
            on_marks = fiducial_checks(found, change)
        except MirroredMarksError as error:
            on_marks = [Check("fiducial orientation", ERROR, 1.0, 0.0, 1e-6, str(error))]
    if outline is not None:
        checks = outline_checks(outline, signal, lit, marked | ~np.isfinite(signal))
    use_edge = outline is not None and choice.how != DESIGN and outline.rim.seen >= SEEN
    off = np.asarray(outline.coverage < SURE) if use_edge and outline is not None else np.zeros(lit.shape, bool)
    counts = _counts(lit, design, outline, choice, marked)
    return MirrorPicture(
        choice, outline, found, change, [_mask_check(counts, choice), *checks, *on_marks], off, marked, counts
    )


def picture_of_scans(stack: ImageStack, chief: ChiefRays, choice: MaskChoice) -> MirrorPicture | None:
    """As look_at_mirror, of the light of all lines together; None where no pixel is brighter than others."""
    signal = np.zeros(stack.x.shape)
    for scan in (stack.x, stack.y):
        curves = scan.mean_w() if len(scan.weights) > 1 else scan.flux_w[0]
        with np.errstate(invalid="ignore"):
            signal.ravel()[scan.pixels] += np.sum(curves - np.median(curves, axis=1, keepdims=True), axis=1)
    try:
        lit = mirror_mask(signal, largest=False)
    except ValueError:  # the checks of the images say so
        return None
    return look_at_mirror(signal, lit, chief, chief.footprint.coverage >= HALF, choice)


def _region(lit: BoolArray) -> BoolArray:
    region: BoolArray = binary_fill_holes(largest_region(lit))
    return region


def _counts(
    lit: BoolArray, design: BoolArray, outline: MirrorOutline | None, choice: MaskChoice, marked: BoolArray
) -> dict[str, int]:
    """Pixels each way."""
    counts = {"light": int(lit.sum()), "design": int(design.sum()), "light_and_design": int((lit & design).sum())}
    if outline is not None:
        counts |= {"whole": int(outline.whole.sum()), "cut_by_the_edge": int(outline.cut.sum())}
    if choice.use is not None:
        counts |= {"file": int(choice.use.sum()), "file_and_design": int((choice.use & design).sum())}
    if choice.marks is not None:
        counts["on_fiducials"] = int((marked & design).sum())
    return counts


def _mask_check(counts: dict[str, int], choice: MaskChoice) -> Check:
    both, design = counts["light_and_design"], counts["design"]
    text = (
        f"{counts['light']} pixels have light, {design} are at least half on the design's mirror, {both} both"
        + (f"; the mask has {counts['file']}, {counts['file_and_design']} on the mirror" if "file" in counts else "")
        + (
            f"; by the picture's outline {counts['whole']} lie wholly on the mirror, its edge cuts "
            f"{counts['cut_by_the_edge']}"
            if "whole" in counts
            else ""
        )
        + (f"; {counts['on_fiducials']} see fiducials" if "on_fiducials" in counts else "")
        + f"; chosen by {'the mask' if choice.how == 'file' else {AUTO: 'light', DESIGN: 'the design'}[choice.how]}"
    )
    return Check("mask", OK, both / max(design, 1), 0.0, 0.0, text)


def add_facts(facts: MeasuredFacts, picture: MirrorPicture) -> None:
    """Add mask, outline and fiducials to the facts of a measurement."""
    facts["mask"] = {"chosen_by": picture.choice.how, "pixels": picture.counts}
    if picture.outline is not None:
        facts["outline"] = outline_facts(picture.outline)
    if picture.fiducials is not None:
        facts["fiducials"] = fiducial_facts(picture.fiducials, picture.change)
