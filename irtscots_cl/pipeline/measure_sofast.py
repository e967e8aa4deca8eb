"""A SOFAST fringe measurement, with a scene or with a folder of the laboratory's calibration files, to the mirror."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from skimage.draw import polygon2mask

from irtscots_cl.calibration.lab_scene import ORIENTATION, LabScene, lab_scene, mirror_start, places_of_fractions
from irtscots_cl.formats.sofast import SofastMeasurement, read_sofast_measurement, read_sofast_response
from irtscots_cl.formats.sofast_setup import SofastFolder, read_sofast_folder
from irtscots_cl.imaging.mask_files import DESIGN, mask_file, read_mask
from irtscots_cl.imaging.orientation import upright
from irtscots_cl.imaging.sofast_fringes import sofast_fringes
from irtscots_cl.measurement.coefficients import check_kind
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.measurement.harmonics import ResponseTable
from irtscots_cl.measurement.quality import OK, WARNING, Check
from irtscots_cl.measurement.rim_curve import RimCurve
from irtscots_cl.measurement.screen_coordinates import find_mask, screen_coordinates
from irtscots_cl.measurement.screen_places import ScreenPlaces, check_pixels, surface_from_places
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.fringes import FRINGES, FringeResult, add_picture_facts, fringe_facts, write_fringes
from irtscots_cl.pipeline.measure import measured_facts, named, refuse_bad
from irtscots_cl.pipeline.picture import HALF, MaskChoice, look_at_mirror
from irtscots_cl.report.quality import check_facts
from irtscots_cl.report.types import GeometryFacts, MeasuredFacts
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption

CORNER_PX = 1.0  # misfit of the facet's corners from which on it is named
DISTANCE_SHARE = 0.01  # difference of the distance by the outline from the measured one, from which on it is named


@dataclass(frozen=True)
class SofastSetup:
    """A scene, or the files that make one. response: the table of screen and camera, if the laboratory has one."""

    scene: Scene | None = None
    folder: SofastFolder | None = None
    response: ResponseTable | None = None

    @classmethod
    def of_folder(cls, path: Path, display: Path | None = None) -> SofastSetup:
        """The set-up of a folder of calibration files. Raises ValueError."""
        folder = read_sofast_folder(path, display)
        if folder.response is None:
            return cls(folder=folder)
        table = read_sofast_response(folder.response)
        try:
            return cls(folder=folder, response=ResponseTable(table.shown, table.camera))
        except ValueError as error:
            raise ValueError(f"{folder.response}: {error}") from None


@dataclass(frozen=True)
class SofastResult(FringeResult):
    """A mirror measured by SOFAST. lab: what was found of the set-up, None where a scene was given."""

    lab: LabScene | None


def sofast_surface(
    measurement: SofastMeasurement,
    setup: SofastSetup,
    saturation: float | None = None,
    mask: Path | None = None,
    fiducials: Path | None = None,
) -> SofastResult:
    """The surface of a SOFAST measurement. mask, fiducials: as of measure_sofast.

    Raises ValueError where images, files and scene do not fit.
    """
    stack = sofast_fringes(measurement, saturation)
    path = mask_file(mask)
    use = None if path is None else read_mask(path, measurement.white.shape)
    mirror = np.ones(stack.shape, bool) if mask is not None and str(mask) == DESIGN else find_mask(stack)
    coordinates = screen_coordinates(stack, mask=mirror if use is None else mirror & use, response=setup.response)
    interruption.check()
    orientation = ORIENTATION if setup.scene is None else setup.scene.camera.detector.orientation
    axes = (coordinates.x, coordinates.y)
    size = _size(setup)
    u_mm, v_mm = places_of_fractions(size, *(upright(one.fraction, orientation) for one in axes))
    errors = [upright(one.standard_error, orientation) * width for one, width in zip(axes, size, strict=True)]
    places = ScreenPlaces(u_mm, v_mm, *errors)
    signal = upright(measurement.white.astype(float) - measurement.dark, orientation)
    if setup.scene is not None:
        nominal = Setup(setup.scene.nominal())
        check_pixels(places, nominal)
        choice = MaskChoice.of(mask, fiducials, setup.scene, orientation)
        picture = look_at_mirror(
            signal, upright(find_mask(stack, largest=False), orientation), nominal.chief_rays,
            nominal.chief_rays.footprint.coverage >= HALF, choice,
        )  # fmt: skip
        result = surface_from_places(places.without(picture.off_edge | picture.on_mark), nominal)
        return SofastResult(result, coordinates, None, picture=picture)
    assert setup.folder is not None
    given = measurement.screen_distance_mm, measurement.point_mm
    start = mirror_start(setup.folder, *given, signal, upright(find_mask(stack), orientation))
    lab = lab_scene(setup.folder, start, *given, places.known, u_mm, v_mm, measurement.name)
    interruption.check()
    facet = polygon2mask(u_mm.shape, start.corners_px)
    scene = Setup(lab.scene)
    lit = upright(find_mask(stack, largest=False), orientation)
    corners = setup.folder.facet.corners_mm
    radius = float(np.hypot(*(corners - setup.folder.facet.centre_mm)[:, :2].T).max())
    choice = MaskChoice.of(mask, fiducials, lab.scene, orientation, radius)
    rim = RimCurve.of_polygon(start.corners_px)
    picture = look_at_mirror(signal, lit, scene.chief_rays, facet, choice, rim)
    places = places.without(picture.off_edge | picture.on_mark)
    result = surface_from_places(places, scene, aperture=False, mirror=facet)
    return SofastResult(result, coordinates, lab, picture=picture)


def measure_sofast(
    path: Path,
    setup: SofastSetup,
    folder: Path,
    *,
    strict: bool = False,
    zernike: str = "circular",
    saturation: float | None = None,
    mask: Path | None = None,
    fiducials: Path | None = None,
    draw: bool = True,
) -> MeasuredFacts:
    """Measure a mirror from a SOFAST measurement's file. Writes result.h5, report.json, scene.toml and figures into the
    folder and returns the main facts, named as in report.json.

    strict: refuse doubtful images, too. zernike: kind of the terms that are fitted. saturation: of the camera's pixels.
    mask: "auto" (None), "design", or the file of the pixels that may be used, lying as the images do. fiducials: table
    of marks on the mirror. draw: false for no figures; an earlier measurement's are deleted.
    Raises RefusedImagesError if a check says that the images are wrong, ValueError if they do not fit the set-up.
    """
    check_kind(zernike)
    measurement = read_sofast_measurement(path)
    with named(path):
        found = sofast_surface(measurement, setup, saturation, mask, fiducials)
        bars = error_bars(found.result)
        assert bars is not None
        checks = _checks(found, measurement)
        facts = measured_facts(found.result, FRINGES, bars, checks, zernike)
        if found.lab is not None:  # a facet is no disk: that terms of a disk cannot be told apart on it is no doubt
            checks = [replace(check, level=OK) if check.name == "zernike terms" else check for check in checks]
            facts["checks"] = check_facts(checks)
        refuse_bad(checks, strict)
    facts["fringes"] = fringe_facts(found)
    add_picture_facts(facts, found)
    if found.lab is not None and setup.folder is not None:
        facts["geometry"] = _geometry_facts(found.lab, setup.folder, measurement)
    write_fringes(folder, found, facts, bars, {"screen fractions": "as SOFAST's display files have them"}, draw)
    return facts


def _size(setup: SofastSetup) -> tuple[float, float]:
    """Width and height in mm of the screen's fractions from 0 to 1, between the centres of its outer pixels."""
    if setup.folder is not None:
        return setup.folder.display.size_mm
    assert setup.scene is not None
    screen = setup.scene.screen
    width, height = ((n - 1) * p for n, p in zip(screen.pixels, screen.pitch_xy_mm, strict=True))
    return width, height


def _checks(found: SofastResult, measurement: SofastMeasurement) -> list[Check]:
    notes = found.coordinates.notes
    checks = [Check("fringes", WARNING, float(len(notes)), 0.0, 0.0, note) for note in notes]
    if not notes:
        checks.append(Check("fringes", OK, 0.0, 0.0, 0.0, "the images are the fringes that the file tells of"))
    if found.lab is not None:
        start, measured = found.lab.start, measurement.screen_distance_mm
        text = f"the facet's corners lie {start.misfit_px:.2g} pixels rms from those of the outline in the picture"
        bad = start.misfit_px > CORNER_PX
        text += "; the facet's file, the camera's file or the mask is wrong" if bad else ""
        checks.append(Check("corners", WARNING if bad else OK, start.misfit_px, CORNER_PX, 1e-3, text))
        share = abs(start.distance_mm / measured - 1)
        text = f"mirror and screen are {start.distance_mm:.6g} mm apart by the outline, {measured:.6g} mm as measured"
        bad = share > DISTANCE_SHARE
        text += "; the measured distance, the facet's size or the focal length is wrong" if bad else ""
        checks.append(Check("distance", WARNING if bad else OK, share, DISTANCE_SHARE, 1e-3, text))
    return checks + ([] if found.picture is None else found.picture.checks)


def _geometry_facts(lab: LabScene, folder: SofastFolder, measurement: SofastMeasurement) -> GeometryFacts:
    rows = lab.scene.camera.detector.pixels[1]
    with np.errstate(divide="ignore"):
        focal = [float(1 / (2e3 * np.float64(c))) for c in (lab.curvature_xx, lab.curvature_yy)]
    return {
        "display": folder.display_file.name,
        "corners_px": [[float(column), float(rows - 1 - row)] for row, column in lab.start.corners_px],
        "corner_misfit_px": lab.start.misfit_px,
        "distance_mm": measurement.screen_distance_mm,
        "distance_by_corners_mm": lab.start.distance_mm,
        "turn_mrad": lab.turn_rad * 1e3,
        "focal_lengths_m": {"x": focal[0], "y": focal[1]},
    }
