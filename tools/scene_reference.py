"""Writes the key tables of docs/scene.md from the checked models in irtscots_cl/scene/.

Keys, ranges, defaults and the rules that join several keys are the models' own: the field descriptions and the texts of
their refusals. The meanings are in MEANINGS below; a key without a meaning, or a meaning without a key, is an error.
Usage: tools/scene_reference.py [--check]
"""

from __future__ import annotations

import ast
import importlib
import inspect
import itertools
import re
import sys
import textwrap

from _generated import main

from irtscots_cl.scene.asphere import Asphere
from irtscots_cl.scene.calibration_known import Calibration, Knowledge
from irtscots_cl.scene.camera_intrinsics import Intrinsics, check_intrinsics
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.element import ALLOWS, KINDS, NEEDS, Element
from irtscots_cl.scene.error_sources import Air, Budget, Distribution
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import ZERNIKE_KEYS, Scene
from irtscots_cl.scene.outline import Outline, OutlinePart, Spider, check_polygon, check_shape
from irtscots_cl.scene.polynomial import Polynomial, check_polynomials
from irtscots_cl.scene.presets import preset_names, preset_text
from irtscots_cl.scene.scatter.models import ABg, Harvey, Lambertian
from irtscots_cl.scene.screen_response import ScreenResponse
from irtscots_cl.scene.screen_shape import CoverGlass, ScanLines, ScreenShape, check_lines

# Each table of a scene file: its heading, its model, one sentence, and the meaning of each key.
MEANINGS = (
    ("Top level", Scene, "", {
        "name": "names the output folder",
        "mirror": "the mirror under test",
        "screen": "the light source",
        "camera": "aperture, lens and detector",
        "element": "surfaces that only `--estimator nonsequential` and `irtscots paths` use",
        "calibration": "what is known of the geometry beforehand, for `irtscots calibrate` and `irtscots identify`",
        "budget": "the errors that the test is expected to have, for `irtscots budget`",
    }),
    ("[mirror]", Mirror, "A conic of revolution, or an off-axis segment of one, or a plane, with a round rim.", {
        "radius_mm": "radius of curvature at the vertex (of the parent); above 0: concave, below 0: convex, inf: flat",
        "diameter_mm": "of the rim, about the origin",
        "conic": "conic constant: 0 sphere, -1 paraboloid",
        "off_axis_mm": "from the parent's axis to the segment's centre",
        "obscuration_mm": "diameter of a central hole",
        "reflectance": "reflected part of the light",
        "zernike": "deviation along z; several tables add up",
        "map": "measured maps of the deviation along z; several tables add up: [height-maps.md](height-maps.md)",
        "scatter": "light that the mirror scatters, for the non-sequential estimator",
        "polynomial": "polynomials in x and y that are added to the conic along z",
        "asphere": "aspheric terms of the design, above the conic",
        "outline": "the part of the disk that is the mirror, where that is not all of it: [outlines.md](outlines.md)",
    }),
    ("[mirror.outline]", Outline, "One shape, or several parts; spiders are taken away. What sticks out of the disk is "
     "cut by it. [outlines.md](outlines.md) has the shapes.", {
        "shape": "of a mirror in one piece; angles are told from +x towards +y",
        "diameter_mm": "of a circle",
        "obscuration_mm": "diameter of a hole in a circle, which makes it a ring",
        "size_mm": "of a rectangle, along x and y before it is turned",
        "across_flats_mm": "of a hexagon, between opposite sides",
        "across_corners_mm": "of a hexagon, between opposite corners",
        "points_mm": "corners of a polygon in order, told from `centre_mm`; the last side leads back to the first",
        "centre_mm": "of the shape, in the mirror's x and y",
        "rotation_deg": "turn of the shape about its centre; a hexagon at 0 has a corner towards +x",
        "file": "of a mask: not 0 where the mirror is; row and column grow with y and x; a path relative to this file",
        "pitch_mm": "of a mask's pixels",
        "part": "several shapes, whose union is the mirror",
        "spider": "strips that send no light",
    }),
    ("[[mirror.outline.part]]", OutlinePart, "One of several shapes; its keys are those of [mirror.outline].", {
        "shape": "of this part",
        "diameter_mm": "of a circle",
        "obscuration_mm": "diameter of a hole in a circle",
        "size_mm": "of a rectangle",
        "across_flats_mm": "of a hexagon, between opposite sides",
        "across_corners_mm": "of a hexagon, between opposite corners",
        "points_mm": "corners of a polygon",
        "centre_mm": "of the shape",
        "rotation_deg": "turn of the shape about its centre",
    }),
    ("[[mirror.outline.spider]]", Spider, "Straight strips, from a centre outwards or between two points.", {
        "width_mm": "of each strip",
        "angles_deg": "directions in which strips leave the centre, to beyond the rim",
        "ends_mm": "the two ends of one strip",
        "centre_mm": "where the strips at `angles_deg` begin",
    }),
    ("[mirror.asphere]", Asphere, "What the design's parent adds to its conic, along the parent's axis, as a function "
     "of the distance r from it. It belongs to the design: a deviation is measured from the conic with these terms. "
     "The equation and its sources: [geometry.md](geometry.md). A power of 1 is not allowed: a cone has no normal at "
     "its vertex. A power of 2 changes the curvature at the vertex, from 1/R to 1/R + 2 a₂.", {
        "coefficients_mm": "a_n of the sum of a_n rⁿ, by n, for r in mm",
        "q_con_um": "coefficients of Forbes's Qcon terms, by m",
        "q_bfs_um": "coefficients of Forbes's Qbfs terms, by m; the best-fit sphere is `radius_mm` with conic 0",
        "normalisation_radius_mm": "r at which u = 1 in the Q terms",
    }),
    ("[[mirror.zernike]]", ZernikeTerms, "Zernike terms of the deviation. Whatever the numbering, terms are normalised "
     "as by Noll: a coefficient is an rms over the disk.", {
        "radius_mm": "of the disk on which the terms are defined; tables may have different ones",
        "coefficients_um": "coefficients in µm by index; Noll's, fringe (University of Arizona) or OSA/ANSI numbering",
        "obscuration": "radius of the hole over that of the disk: above 0 for Mahajan's annular terms, orthonormal on "
        "the ring, whose coefficients are rms over the ring; within the hole the terms go on and grow, "
        "by about ((1 + e) / (1 - e))^((n - m) / 2) / 2 of the obscuration e",
    }),
    ("[[mirror.polynomial]]", Polynomial, "A height along z: the sum of value B_i(u) B_j(v) over the terms "
     "[i, j, value], with u, v = (x, y - `centre_mm`) / `half_size_mm`. `chebyshev`: B_n = T_n; `legendre`: P_n, 1 at "
     "the edge; `monomial`: powers. Tables add up, whatever their bases and rectangles.", {
        "basis": "what the terms are",
        "half_size_mm": "half of the rectangle's sides, the lengths that x and y are divided by (both the "
        "normalisation radius of other programs' extended polynomials)",
        "centre_mm": "of the rectangle",
        "coefficients_um": "terms [i, j, µm]",
        "coefficients_mm": "terms [i, j, value] of powers of x and y in mm about `centre_mm`, value in mm^(1 - i - j); "
        "only with `basis = \"monomial\"`, in place of `coefficients_um` and `half_size_mm`",
        "part": "`deviation`: what a test has to find; `design`: of the surface as designed, which the measurement "
        "knows",
    }),
    ("[[mirror.map]]", MirrorMap, "A measured map of the mirror's deviation, in its own file. It is read with x to the "
     "right and y up, seen from +Z; then flipped, scaled, turned, and moved. [height-maps.md](height-maps.md) has "
     "examples.", {
        "file": "path, relative to the scene file, of any map that [formats.md](formats.md) names",
        "centre_mm": "where the map's middle lies; default: where the file says, or else the mirror's centre",
        "rotation_deg": "anticlockwise, seen from +Z",
        "flip": "turned over before it is turned: x left and right, y top and bottom, xy both",
        "scale": "lateral: of the map's pitch",
        "factor": "of the heights: -1 turns them over",
        "outside": "where the map has no height: refuse more than a small edge, which is extrapolated; the nearest "
                   "height; or zero",
        "unit": "of the heights, where the file does not say it",
        "pitch_mm": "between pixels, in the place of the file's: one number, or along x and y",
        "wavelength_nm": "of the measurement, where heights are in waves and the file does not say it",
        "holds": "what the file does not say: heights of the surface, or of the wavefront, twice as large",
    }),
    ("[screen]", Screen, "A Lambertian screen, plane without the table [screen.shape].", {
        "position_mm": "centre of the screen",
        "pixels": "number of pixels",
        "pitch_mm": "of the pixels: of square ones, or along the screen's x and y",
        "look_at_mm": "a point that the screen faces",
        "radiance": "of a lit pixel",
        "emission": "angular distribution",
        "centre_offset_mm": "shift of the pixel grid in the screen's own x, y",
        "response": "what a real screen does; without it, all lines are equal and steady",
        "clocking_deg": "turn of the screen's x and y about its z, from x towards y",
        "shape": "where the pixels of a screen that is not flat are",
        "cover_glass": "a plate on the pixels",
        "lines": "which pixels a scan lights; without it, every single column and row",
    }),
    ("[screen.shape]", ScreenShape, "A screen that is not flat: the pixel at (u, v) of the grid lies at (X, Y, Z) of "
     "the screen's frame. Either a sag, or measured points.", {
        "sag_mm": "Z is the sum of mm (u/U)^i (v/V)^j, U and V half the grid's width and height, u and v from its "
        "middle; X = u, Y = v",
        "fractions": "places on the grid, along +u and +v, that the points of `points_mm` are of",
        "points_mm": "where those places are; beyond them the screen goes on straight",
        "interpolation": "between the points; `smooth`: a cubic spline through a rectangular grid of them, a thin "
        "plate through others",
    }),
    ("[screen.cover_glass]", CoverGlass, "A plane-parallel plate on the pixels, towards the mirror; on a bent screen "
     "it follows the shape. It moves rays; `radiance` is that outside of it.", {
        "thickness_mm": "of the plate",
        "index": "refractive index",
    }),
    ("[screen.lines]", ScanLines, "The lines of a scan, of columns (x scan) and of rows (y scan) alike. Lines may "
     "overlap, or leave gaps.", {
        "step_px": "from one line to the next",
        "width_px": "of a line: in frame k the pixels `first_px` + k `step_px` and the next `width_px` - 1 light up",
        "first_px": "first pixel of the first line; only lines that lie wholly on the screen are shown",
    }),
    ("[camera]", Camera, "An aperture with a paraxial lens in it, and a detector.", {
        "position_mm": "centre of the aperture",
        "aperture_diameter_mm": "of the round aperture",
        "focal_length_mm": "of the paraxial lens; with `lens = \"elements\"` that of the elements, for the chief rays",
        "detector": "the detector",
        "look_at_mm": "a point on the optical axis",
        "focus_distance_mm": "distance in focus; without it, the distance to `look_at_mm`",
        "transmittance": "of the lens",
        "lens": "`paraxial`: in the aperture; `elements`: no lens there, the scene's elements are the lens",
        "detector_distance_mm": "from the aperture to the detector; without it, where a paraxial lens images",
        "roll_deg": "turn of the camera's x and y about its z, from x towards y: anti-clockwise, seen from behind the "
        "camera",
        "aperture_offset_mm": "from the lens's axis to the aperture's centre, which is at `position_mm`",
        "intrinsics": "focal lengths, principal point and distortion of a calibrated camera",
    }),
    ("[camera.intrinsics]", Intrinsics, "A calibrated camera, in the numbers that OpenCV's calibration gives. They are "
     "those of the camera's picture: whole numbers at the pixels' centres, (0, 0) the centre of the top left pixel, x "
     "to the right, y down.", {
        "image_size_px": "of the picture that was calibrated; without it, what the region and the binning read out",
        "principal_point_px": "where the lens's axis meets that picture; without it, its middle",
        "fx": "focal length in pixels of that picture; without it, image distance over pitch, times the binning",
        "fy": "as `fx`, along y",
        "distortion": "OpenCV's coefficients",
        "roi_px": "the picture's first pixel that is read out",
        "binning": "pixels of the picture that are joined to one of the detector's",
    }),
    ("[camera.detector]", Detector, "A grid of square pixels, upright: rows along the camera's +y, columns along its "
     "+x.", {
        "pixels": "number of pixels, after region of interest and binning; of the upright grid, also where files are "
        "transposed",
        "pitch_mm": "of the pixels",
        "noise": "what a real detector does; without it, images are the flux in W",
        "orientation": "how images lie in files; an ordinary camera's files are `rows-reversed`",
    }),
    ("[camera.detector.noise]", DetectorNoise, "What a real detector does to the images; without this table, or with "
     "all effects off, they are the flux in W. [detector.md](detector.md) has the order of the effects.", {
        "electrons_at_peak": "states the exposure: mean electrons of the brightest sample of all frames, in one frame",
        "exposure_s": "exposure of one frame; with the next two keys it states the exposure in place of "
        "`electrons_at_peak`",
        "quantum_efficiency": "electrons per photon",
        "wavelength_nm": "of the light, to turn energy into photons",
        "quantum_efficiency_map": "response [rows, columns] of the upright grid's pixels, relative to the nominal one; "
        "a path relative to this file",
        "prnu": "photo-response non-uniformity: relative rms of the pixels' response",
        "dead_pixel_share": "chance of a pixel to respond to no light",
        "shot_noise": "Poisson statistics of the electrons, of light and dark current",
        "dark_current_e_per_s": "mean dark current of a pixel; needs `exposure_s`",
        "hot_pixel_share": "chance of a pixel to be hot",
        "hot_pixel_e": "mean electrons that a hot pixel has in addition in each frame",
        "read_noise_e": "rms, of each pixel in each frame",
        "full_well_e": "most electrons of a pixel",
        "gain_e_per_dn": "electrons for a step of the digital number",
        "offset_dn": "digital number without electrons",
        "bits": "of the digital numbers, rounded and limited in each frame; without it they are not",
        "justification": "`left`: the bits are the upper ones of 16, in steps of 2^(16 - bits)",
        "frames_averaged": "frames whose mean is the image under a line",
        "dark_frames": "frames without light whose mean is subtracted; 0: the dark level stays in",
        "exposures": "independent repeats of all images, kept separately, for error bars",
        "seed": "of the random numbers",
    }),
    ("[screen.response]", ScreenResponse, "How the screen departs from an even and steady one. The first two keys and "
     "dead pixels need a map of transport: `--estimator adjoint` without `--smoothing`, or `forward`.", {
        "brightness_map": "factor [rows, columns] on the radiance of each screen pixel; a path relative to this file",
        "brightness_polynomial": "factor 1 + a x + b y + c x² + d x y + e y²; x and y go from -1 to 1 over the screen",
        "grey_level": "of a lit line; 1: full on",
        "gamma": "a lit line has the share grey_level^gamma of the full radiance: no effect on lines that are full on",
        "dead_pixels": "screen pixels that stay dark",
        "dead_columns": "columns that stay dark, counted from 0",
        "dead_rows": "rows that stay dark, counted from 0",
        "dead_pixel_share": "chance of a screen pixel to stay dark",
        "dead_line_share": "chance of a column, and of a row, to stay dark",
        "drift": "relative change of brightness over each scan, linear: from 1 - drift/2 to 1 + drift/2",
        "jitter": "relative rms of the brightness, of each camera frame",
        "seed": "of the random numbers",
    }),
    ("[calibration]", Calibration, "What is known of the geometry before the images are seen. "
     "[calibrate.md](calibrate.md) has the names.", {
        "known": "standard deviation of each unknown about the scene's value, or a measured distance",
    }),
    ('[calibration.known], "NAME" = { ... }', Knowledge, "One of them, where a number alone does not say enough.", {
        "sigma": "standard deviation, in the unit of the name",
        "mm": "of a distance: the measured one; without it, the scene's own",
        "source": "where it comes from",
    }),
    ("[budget]", Budget, "The errors that the test is expected to have, for `irtscots budget`: "
     "[budget.md](budget.md).", {
        "sources": "distribution of each source's value, by name",
        "periods": "of fringes over the screen, by series; without them, single lines are scanned",
        "steps": "of the fringes of each series",
        "trials": "tests that are tried with all errors at once",
        "seed": "of their random numbers",
        "allow_nm": "rms height error that the test may have",
        "compensators": "numbers of the geometry that are fitted away from the heights",
        "exposures": "measurements of one kind whose mean is taken",
        "mirror_turns": "equal turns of the mirror about its axis, over a full circle, whose mean is taken",
        "calibrated": "has the covariance of further sources of the geometry",
        "stray_light": "has what the light of the sources `stray.ghosts` and `stray.scatter` does to each pixel",
        "air": "turbulent air, of the source `air.turbulence_nm`; without it, that of the defaults",
    }),
    ("[budget.air]", Air, "Turbulent air on the rays' way, of von Karman's spectrum.", {
        "outer_scale_mm": "longest size of its eddies: beyond, the spectrum is flat",
        "wind_mm_per_s": "by which it moves across the way, as it is",
        "frame_s": "time from frame to frame",
    }),
    ('[budget.sources], "NAME" = { ... }', Distribution, "Distribution of a source's value about 0, where a standard "
     "deviation alone does not say enough.", {
        "normal": "standard deviation of a normal distribution",
        "uniform": "half the width of an even one",
        "triangular": "half the width of a triangular one",
        "set_ups": "number of measurements that each have a value of their own, such as of a camera set up anew; their "
                   "mean is taken",
        "cost": "what it costs to calibrate this source away, in any unit of money",
    }),
    ("[[element]]", Element, "A surface with its effect on light: `mirror` reflects in front and is black behind, "
     "`refractor` is an interface of two media, `lens` is paraxial, `absorber` is black, `detector` is black and "
     "counts the light that it absorbs.", {
        "name": "names it in paths; each once",
        "kind": "what it does",
        "position_mm": "its vertex",
        "facing_mm": "a point that its front (+z) faces",
        "radius_mm": "of curvature; above 0: the centre lies on the front; without it, a plane",
        "conic": "conic constant of a curved one",
        "off_axis_mm": "as of the mirror",
        "diameter_mm": "of a round aperture",
        "obscuration_mm": "diameter of a hole",
        "size_mm": "of a rectangular aperture",
        "reflectance": "of a mirror (without it 1), or of a refractor's coating (without it Fresnel's)",
        "index_front": "refractive index in front",
        "index_back": "refractive index behind",
        "focal_length_mm": "of a paraxial lens",
        "transmittance": "of a paraxial lens",
        "coating_index": "of a refractor: one layer of that index, a quarter of a wavelength thick",
        "scatter": "of mirrors and refractors about the outgoing direction, of absorbers about a mirror's",
        "important": "scattered rays are also aimed at this element",
    }),
    ('[mirror.scatter], [element.scatter] with model = "lambertian"', Lambertian, "BSDF = tis / π.", {
        "tis": "total integrated scatter",
    }),
    ('... with model = "harvey"', Harvey, "BSDF = b0 (1 + (d / l)²)^(s / 2), with d the distance in direction cosines "
     "from the specular direction.", {
        "l": "shoulder, in direction cosines",
        "s": "slope",
        "b0": "BSDF in the specular direction",
        "tis": "total integrated scatter at normal incidence",
        "roughness_nm": "rms roughness: incidence and media make it a total, see [stray-light.md](stray-light.md)",
        "wavelength_nm": "wavelength in vacuum, for the roughness",
    }),
    ('... with model = "abg"', ABg, "BSDF = a / (b + d^g).", {
        "a": "scale",
        "b": "knee: at d = b^(1/g)",
        "g": "exponent of the decay",
    }),
)  # fmt: skip
CHECKS = {  # that the table above calls, with its own numbers
    Intrinsics: check_intrinsics,
    ScanLines: check_lines,
    Polynomial: check_polynomials,
    Outline: check_shape,
    OutlinePart: check_polygon,
}
HIDDEN = {ZernikeTerms: {"ordering"}, MirrorMap: {"heights"}}  # in a file the key of the coefficients states it
UNITS = {
    "mm": "mm",
    "um": "µm",
    "nm": "nm",
    "s": "s",
    "e": "e",
    "dn": "DN",
    "px": "pixels",
    "deg": "°",
}  # by the end of a key
UNITS_OF_KEYS = {
    "coefficients_mm": "mm^(1 - n)",
    "radiance": "W/(mm² sr)", "b0": "1/sr", "electrons_at_peak": "e", "dark_current_e_per_s": "e/s",
    "gain_e_per_dn": "e/DN", "wind_mm_per_s": "mm/s",
}  # fmt: skip
FILE_KEYS = {ZernikeTerms: {"coefficients_um": " or ".join(f"`{key}`" for key in ZERNIKE_KEYS)}}


def reference() -> str:
    """The tables of all models."""
    parts = [presets()]
    for heading, model, sentence, meanings in MEANINGS:
        fields = {key: field for key, field in model.__pydantic_fields__.items() if key not in HIDDEN.get(model, ())}
        if wrong := set(fields) ^ set(meanings):
            raise SystemExit(f"MEANINGS of {model.__name__}: wrong or missing keys {sorted(wrong)}")
        lines = [f"## {heading}", "", *([textwrap.fill(sentence, 118), ""] if sentence else [])]
        lines += ["| key | unit | allowed | default | meaning |", "|---|---|---|---|---|"]
        for key, field in fields.items():
            unit = UNITS_OF_KEYS.get(key, UNITS.get(key.rsplit("_", 1)[-1], "") if "_" in key else "")
            cells = (
                FILE_KEYS.get(model, {}).get(key, f"`{key}`"),
                unit,
                field.description,
                default_of(field),
                meanings[key],
            )
            lines.append("| " + " | ".join(cells) + " |")
        lines += ["", kinds()] if model is Element else []
        rules = rules_of(model)
        lines += ["", "Further rules:", "", *(f"- {rule}" for rule in rules)] if rules else []
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def presets() -> str:
    """The preset scenes, each with the first sentence of its file."""
    lines = ["## Presets", "", "| name | scene |", "|---|---|"]
    for name in preset_names():
        comment = itertools.takewhile(lambda line: line.startswith("#"), preset_text(name).splitlines())
        words = " ".join(line.removeprefix("#").strip() for line in comment)
        lines.append(f"| `{name}` | {re.split(r'(?<=[.]) ', words)[0]} |")
    return "\n".join(lines)


def kinds() -> str:
    """Which keys an element of each kind needs and takes."""
    lines = ["| kind | needs | may have |", "|---|---|---|"]
    for kind in KINDS:
        needs = NEEDS.get(kind, ())
        cells = (needs, [key for key in ALLOWS[kind] if key not in needs])
        lines.append(f"| `{kind}` | " + " | ".join(", ".join(f"`{key}`" for key in keys) for keys in cells) + " |")
    return "\n".join(lines)


def default_of(field) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is None or value in ((), {}):
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        return "[" + ", ".join(f"{v:g}" for v in value) + "]"
    return f"{value:g}" if isinstance(value, (int, float)) else f'`"{value}"`'


def rules_of(model) -> list[str]:
    """The refusals of a model that no field's range states, from its source: `key`: must ...; in order, each once."""
    names = vars(importlib.import_module(model.__module__))
    own = ast.parse(textwrap.dedent(inspect.getsource(model)))
    rules = rules_in(own, names)
    for call in (node for node in ast.walk(own) if isinstance(node, ast.Call)):
        helper = names.get(ast.unparse(call.func))
        if inspect.isfunction(helper) and helper.__name__.startswith("_check"):
            bound = dict(zip(inspect.signature(helper).parameters, call.args, strict=True))
            known = {name: value.value for name, value in bound.items() if isinstance(value, ast.Constant)}
            known |= {name: names[v.id] for name, v in bound.items() if isinstance(v, ast.Name) and v.id in names}
            rules += rules_in(ast.parse(textwrap.dedent(inspect.getsource(helper))), names | known)
    if model in CHECKS:
        found = rules_in(ast.parse(textwrap.dedent(inspect.getsource(CHECKS[model]))), names)
        rules += [re.sub(r"`\w+\.", "`", rule) for rule in found]  # from the table above
    for key, shown in FILE_KEYS.get(model, {}).items():
        rules = [rule.replace(f"`{key}`", shown) for rule in rules]
    # What an element's kind needs or takes has a table of its own; a module's name is no key of a file.
    return [r for r in dict.fromkeys(rules) if "for kind" not in r and "for shape" not in r and "irtscots_cl." not in r]


def rules_in(tree: ast.AST, names: dict) -> list[str]:
    """Those of the functions in a source, each read by itself."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return [rule for function in functions for rule in rules_of_function(function, names)]


def rules_of_function(tree: ast.FunctionDef, names: dict) -> list[str]:
    rules, must = [], []  # must: the text that the variable of that name holds at this line
    nodes = (node for node in ast.walk(tree) if isinstance(node, (ast.Assign, ast.AugAssign, ast.Call)))
    for node in sorted(nodes, key=lambda node: node.lineno):
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "must":
            must = [node.value]
        elif isinstance(node, ast.AugAssign) and ast.unparse(node.target) == "must":
            must = [*must, node.value]
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "refuse":
            text = must if ast.unparse(node.args[2]) == "must" else [node.args[2]]
            words = "".join(wording(part, names) for part in text)
            rules.append(f"{keys_of(node.args[0], tree, names)}: must {words}")
    return rules


def keys_of(steps: ast.expr, tree: ast.AST, names: dict) -> str:
    """The keys that `steps` of a refusal may lead to; numbers of tables left out."""
    paths = [()]
    for step in steps.elts:
        if isinstance(step, ast.Constant):
            values = [step.value]
        elif isinstance(step, ast.Subscript):  # one of several keys
            values = [key.value for key in step.value.elts]
        else:
            values = [names[step.id]] if isinstance(names.get(step.id), str) else values_of(step, tree)
        paths = [(*path, *([value] if value else [])) for path in paths for value in values or [""]]
    keys = ["`" + ".".join(path) + "`" for path in paths if path]
    return ", ".join(keys) or "these keys"


def values_of(name: ast.Name, tree: ast.AST) -> list[str]:
    """The strings that a variable may hold where it is used: of the loop over them, or of its last assignment."""
    before = (node for node in ast.walk(tree) if isinstance(node, (ast.For, ast.Assign)) and node.lineno <= name.lineno)
    values = []
    for node in sorted(before, key=lambda node: node.lineno):
        targets = [node.target] if isinstance(node, ast.For) else node.targets
        if name.id in {n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)}:
            source = node.iter if isinstance(node, ast.For) else node.value
            parts = [source.body, source.orelse] if isinstance(source, ast.IfExp) else [source]
            found = [n.value for part in parts for n in ast.walk(part) if isinstance(n, ast.Constant)]
            values = [value for value in found if isinstance(value, str)]
    return values


def wording(text: ast.expr, names: dict) -> str:
    """A refusal's text; values that depend on the scene become `...`."""
    if isinstance(text, ast.Constant):
        return text.value
    if not isinstance(text, ast.JoinedStr):
        raise SystemExit(f"a refusal's text that cannot be read: {ast.unparse(text)}")
    words = ""
    for part in text.values:
        if isinstance(part, ast.Constant):
            words += part.value
        else:
            name = ast.unparse(part.value)
            if isinstance(part.value, ast.Attribute) and ast.unparse(part.value.value) in names:  # of a range
                name = ast.unparse(part.value.value)
                names = {**names, name: getattr(names[name], part.value.attr)}
            value = names.get(name, names.get(name.removeprefix("', '.join(").removesuffix(")")))
            value = ", ".join(map(str, value)) if isinstance(value, tuple) else value
            words += "..." if value is None else str(value)
    return words.replace(" (...)", "")


if __name__ == "__main__":
    sys.exit(main("docs/scene.md", "tools/scene_reference.py", reference(), __doc__.splitlines()[0]))
