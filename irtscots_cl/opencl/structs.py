"""Shared by host and kernels: the numbers of fates and the layout of every structure, defined once as NumPy dtypes.

The C text for the kernels is generated from the dtypes (c_declarations). Structures are aligned as a C compiler aligns
them. Lengths are in mm. The real type is float32 or float64, by the precision of the run.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

PRECISIONS = {"fp32": np.float32, "fp64": np.float64}
WEIGHT_ONE = 2**24  # fixed-point scale of an adjoint ray's weight: the resolution of single precision
LINE_WEIGHT_ONE = 2**20  # of a smoothed ray's: rounds as often up as down, and leaves room for a block's 32-bit sums


class Fate(IntEnum):
    """How a ray ends. OFF_WINDOW means a window was too small; a finished run has no such rays."""

    DETECTED = 0
    MISSED_MIRROR = 1
    CLIPPED = 2
    OFF_DETECTOR = 3
    OFF_SCREEN = 4
    ABSORBED = 5
    FAILED = 6
    OFF_WINDOW = 7


LAUNCH = np.dtype(
    [
        ("first_ray", np.uint64),
        ("ray_count", np.uint64),
        ("rays_per_item", np.uint64),  # of each source
        ("first_source", np.uint32),
        ("replicate", np.uint32),
        ("seed_low", np.uint32),
        ("seed_high", np.uint32),
        ("screen_columns", np.int32),
        ("screen_rows", np.int32),
        ("detector_pixels", np.int32),
        ("window_columns", np.int32),
        ("window_rows", np.int32),
    ],
    align=True,
)


def facet_dtype(real) -> np.dtype:
    """The plane of a pixel of a bent screen, in the world: its centre, its edges along u and v, and axes of its plane.

    axis_z is the normal away from the mirror. Edges are as seen through a cover glass. Lengths in mm.
    """
    names = ("point", "pixel_x", "pixel_y", "axis_x", "axis_y", "axis_z")
    return np.dtype([(name, real, 3) for name in names], align=True)


def emitter_dtype(real, bent: bool = False) -> np.dtype:
    """A screen pixel as the forward estimator's source.

    x, y: its centre in the screen's frame [mm], of a bent screen a facet. The aim is the ellipse in direction cosines,
    centre + lower triangular matrix times the unit disk, that covers the mirror from every point of the pixel.
    """
    place = [("facet", facet_dtype(real))] if bent else [("x", real), ("y", real)]
    return np.dtype(
        place + [(name, real) for name in ("centre_l", "centre_m", "aim_ll", "aim_ml", "aim_mm")], align=True
    )


def cone_dtype(real) -> np.dtype:
    """An ellipse of directions of a screen pixel, as in Emitter; density: share of the rays over aim_ll aim_mm."""
    names = ("centre_l", "centre_m", "aim_ll", "aim_ml", "aim_mm", "density")
    return np.dtype([(name, real) for name in names], align=True)


def cones_emitter_dtype(real, cones: int) -> np.dtype:
    """An Emitter whose rays go into several cones (optics/elements/emission.py); its own aim is the first of them."""
    emitter = emitter_dtype(real)
    fields = [(name, emitter[name]) for name in emitter.names]
    return np.dtype([*fields, ("cones", cone_dtype(real), cones)], align=True)


def image_dtype(real) -> np.dtype:
    """A pixel's image by the lens without distortion, as a quadratic in (s, t), pixels from its centre [mm]."""
    names = [f"{axis}_{powers}" for axis in "xy" for powers in ("s", "t", "ss", "st", "tt")]
    return np.dtype([(name, real) for name in names], align=True)


def patch_dtype(real) -> np.dtype:
    """The part of a bent screen that a detector pixel sees, about the place (u, v) of the grid [mm].

    x, y, z: cubics of the pixels' moves from the grid, in the order 1, u, v, uu, uv, vv, uuu, uuv, uvv, vvv. steps:
    that a ray takes from the tangent plane to them.
    """
    fields = [("u", real), ("v", real), *((name, real, 10) for name in "xyz"), ("steps", np.int32)]
    return np.dtype(fields, align=True)


def receiver_dtype(real, distorted: bool = False, bent: bool = False) -> np.dtype:
    """A detector pixel that can see the mirror, as the adjoint estimator's source.

    x, y: its centre on the upright image [mm]; weight_scale: turns cos^4 into a fixed-point weight, WEIGHT_ONE at the
    pixel's centre; column, row: its window's first screen pixel; pixel: its number row * columns + column, the source
    number of its random words. image: of a lens with distortion; patch: of a bent screen.
    """
    fields = [(name, real) for name in ("x", "y", "weight_scale")]
    fields += [("column", np.int32), ("row", np.int32), ("pixel", np.uint32)]
    fields += [("image", image_dtype(real))] * distorted + [("patch", patch_dtype(real))] * bent
    return np.dtype(fields, align=True)


def chord_dtype(real) -> np.dtype:
    """How a detector pixel's light moves along one axis of the screen as it moves over the camera's aperture.

    normal_a, normal_b: unit direction on the aperture along which the landing point moves along that axis alone; slope,
    bend: lines per mm and per mm^2 along it; growth: relative growth of cos^4 per mm; mirror_x, mirror_y: move of the
    mirror point per mm.
    """
    names = ("normal_a", "normal_b", "slope", "bend", "growth", "mirror_x", "mirror_y")
    return np.dtype([(name, real) for name in names], align=True)


def line_receiver_dtype(real, distorted: bool = False, bent: bool = False) -> np.dtype:
    """A Receiver and its chords along the screen's x and y, as the smoothed adjoint estimator's source.

    start: its weight_scale gives LINE_WEIGHT_ONE at the pixel's centre. cut: whether the mirror's edges may cut chords.
    """
    fields = [("start", receiver_dtype(real, distorted, bent)), ("chords", chord_dtype(real), 2), ("cut", np.int32)]
    return np.dtype(fields, align=True)


def lens_dtype(real) -> np.dtype:
    """A lens's distortion (maths.lens_distortion, y upwards): above: the numerator's powers of r^2 less the
    denominator's; below: the denominator's. focal_x, focal_y: in pixels. shift_x, shift_y: of normalised image points,
    from the aperture's centre to the axis. most2: square of the largest normalised radius in the image.
    """
    names = ("p1", "p2", "focal_x", "focal_y", "shift_x", "shift_y", "most2", "inverse_pixel_area")
    return np.dtype([("above", real, 3), ("below", real, 3), *((name, real) for name in names)], align=True)


def frame_dtype(real) -> np.dtype:
    """A device's frame: position and axes in world coordinates; offset = -axes . position, computed in float64."""
    return np.dtype(
        [("position", real, 3), ("axis_x", real, 3), ("axis_y", real, 3), ("axis_z", real, 3), ("offset", real, 3)],
        align=True,
    )


def mirror_dtype(real, deviated: bool, annular: bool) -> np.dtype:
    """The mirror's quadric (quadric.Quadric) and aperture, with only the fields that the scene's kernels read."""
    names = ["q_xx", "q_yy", "q_zz", "q_xz", "aperture_radius2"] + ["obscuration_radius2"] * annular
    names += ["departure_radius2"] * deviated  # beyond which no line meets the mirror
    return np.dtype([(name, real) for name in names], align=True)


def zernike_term_dtype(real) -> np.dtype:
    """One radial term: coefficients [mm] and the recurrence P_{k+1} = (alpha t + beta) P_k + gamma P_{k-1}.

    gamma_next is the next term's gamma, which Clenshaw's recurrence needs.
    """
    return np.dtype([(name, real) for name in ("cosine", "sine", "alpha", "beta", "gamma_next")], align=True)


def zernike_clenshaw_dtype(real, series: int, terms: int) -> np.dtype:
    """The deviation as a series.RadialSeries with `series` azimuthal orders and `terms` radial terms in total."""
    return np.dtype(
        [
            ("inverse_radius", real),
            ("term", zernike_term_dtype(real), terms),
            ("order", np.int32, series),
            ("count", np.int32, series),
            ("series_count", np.int32),
        ],
        align=True,
    )


def zernike_power_dtype(real, coefficients: int) -> np.dtype:
    """The deviation's series.PowerRows: coefficients in mm. Constant tables describe its rows."""
    return np.dtype([("inverse_radius", real), ("coefficient", real, coefficients)], align=True)


def polynomial_dtype(real, rows: int, columns: int) -> np.dtype:
    """Chebyshev coefficients [mm] of a height over the rectangle of that centre and those halves of its sides [mm]."""
    names = ("centre_x", "centre_y", "inverse_half_x", "inverse_half_y")
    return np.dtype([(name, real) for name in names] + [("coefficient", real, (rows, columns))], align=True)


ABOUT = 6


def asphere_dtype(real, pairs: int) -> np.dtype:
    """Aspheric terms for kernels/mirror/profile.cl: coefficients [mm] of a polynomial in t, of an even power and of the
    next one in each pair, highest first; about: those of s, s^2, ... that nearly give the height, highest first."""
    return np.dtype([("inverse_radius", real), ("about", real, ABOUT), ("coefficient", real, (pairs, 2))], align=True)


def outline_polygon_dtypes(real, sides: int) -> dict[str, np.dtype]:
    """A mirror's outline that is a convex polygon, for kernels/mirror/outline_polygon.cl.

    OutlinePlane: half plane n . p <= distance, n the side's unit normal outwards.
    """
    plane = np.dtype([("normal_x", real), ("normal_y", real), ("distance", real)], align=True)
    return {"OutlinePlane": plane, "Outline": np.dtype([("planes", plane, sides)], align=True)}


def outline_parts_dtypes(real, parts: int, sides: int) -> dict[str, np.dtype]:
    """A mirror's outline of parts and strips (optics/outline.py), for kernels/mirror/outline_parts.cl.

    OutlinePart: a polygon of side_count sides from first_side on, or with none a ring about (x, y), by squared radii.
    OutlineSide: its lower end, the height of its upper end, and dx / dy.
    """
    part = np.dtype([(name, real) for name in ("x", "y", "outer2", "inner2")]
                    + [("first_side", np.int32), ("side_count", np.int32)], align=True)  # fmt: skip
    side = np.dtype([(name, real) for name in ("low_x", "low_y", "high_y", "slope")], align=True)
    fields = [("parts", part, parts), ("sides", side, sides), ("part_count", np.int32), ("strip_count", np.int32)]
    return {"OutlinePart": part, "OutlineSide": side, "Outline": np.dtype(fields, align=True)}


def outline_grid_dtype(real) -> dict[str, np.dtype]:
    """A mirror's outline that is a picture, for kernels/mirror/outline_mask.cl. low_x, low_y: the corner of its first
    pixel; first: the first real of its bits in the tables."""
    names = ("low_x", "low_y", "inverse_pitch_x", "inverse_pitch_y")
    counts = [(name, np.int32) for name in ("columns", "rows", "first")]
    return {"Outline": np.dtype([*((name, real) for name in names), *counts], align=True)}


def map_grid_dtype(real) -> np.dtype:
    """A height map: the place (column, row) of (x, y) [mm] on its grid is linear in them; the grid's nodes; and where
    its coefficients are in the tables: from offset on, stride from row to row."""
    reals = ("column_x", "column_y", "column", "row_x", "row_y", "row")
    counts = ("columns", "rows", "stride", "offset")
    return np.dtype([(name, real) for name in reals] + [(name, np.int32) for name in counts], align=True)


def scene_dtype(real, mirror: np.dtype, parts: dict[str, np.dtype], glass: bool = False) -> np.dtype:
    """The values of the scene that are the same for all rays.

    Pitches (x, y) of the detector are those at the image distance. detector_left, detector_top: what turns image points
    over the pitch into pixels from the detector's first edges; screen_left, screen_top: the same for the screen. parts:
    fields that few scenes have, and their structures. glass: whether the screen has a cover glass.
    """
    names = (
        *("screen_pitch_x", "screen_pitch_y", "inverse_screen_pitch_x", "inverse_screen_pitch_y"),
        *("screen_left", "screen_top", "aperture_radius", "aperture_radius2"),
        *("inverse_focal_length", "inverse_focus", "image_distance", "inverse_image_distance"),
        *("detector_pitch_x", "detector_pitch_y", "inverse_detector_pitch_x", "inverse_detector_pitch_y"),
        *("detector_left", "detector_top"),
        *("glass_thickness", "glass_index2") * glass,
    )
    return np.dtype(
        [("mirror", mirror), ("screen", frame_dtype(real)), ("camera", frame_dtype(real))]
        + [(name, real) for name in names]
        + [("detector_columns", np.int32), ("detector_rows", np.int32)]
        + list(parts.items()),
        align=True,
    )


def element_dtype(real, groups: int) -> np.dtype:
    """An element of a non-sequential trace (components.Component), as the kernels read it.

    axis_*: its axes in the world; offset: shift from positions relative to each group's origin to its frame, and the
    sum of the shift's magnitudes; origin: its position from its own group's origin, in the world [mm]. q_*:
    quadric.Quadric. outer2, inner2: squares of the aperture's radii; half_u, half_v: half width and height.
    reflectance: negative means Fresnel's. least_chance: smallest probability of either branch at a refractor;
    min_weight: smallest weight of the weaker branch if both are followed.
    """
    fields = [(name, real, 3) for name in ("axis_x", "axis_y", "axis_z", "origin")]
    fields += [("offset", real, (groups, 4))]
    names = ("q_xx", "q_yy", "q_zz", "q_xz", "outer2", "inner2", "half_u", "half_v", "reflectance", "index_front",
             "index_back", "coating_index", "least_chance", "min_weight", "inverse_focal_length",
             "transmittance")  # fmt: skip
    fields += [(name, real) for name in names] + [("group", np.int32)]
    return np.dtype(fields, align=True)


TIS_NODES = 129


def scatter_structs(real, groups: int, elements: int, targets: int) -> dict[str, np.dtype]:
    """Structures of all that scatters in a non-sequential trace, as kernels/scatter/scattered.cl reads them.

    Target: a disk, its centre from each group's origin and its axes in the world [mm]. Lobe, one per element: numbers:
    parameters of its kernels/scatter/scatter_*.cl; probability: of a ray to split; share: the share of split rays drawn
    from the lobe; its shape is the density (1 + d^2 inverse_l2)^(power - 1) about centre times the specular direction;
    phase: of a rough surface, per unit of n cos(theta), else 0; tis: the BSDF's integral over the hemisphere by the
    root of the specular direction's cosine, at equal steps from 0 to 1; target: indices of the targets that rays are
    aimed at.
    """
    target = np.dtype([("centre", real, (groups, 3)), ("axis_x", real, 3), ("axis_y", real, 3), ("axis_z", real, 3),
                       ("radius", real)], align=True)  # fmt: skip
    names = ("probability", "share", "inverse_l2", "power", "centre", "phase")
    fields = [("numbers", real, 3), *((name, real) for name in names), ("tis", real, TIS_NODES)]
    lobe = np.dtype([*fields, ("target_count", np.int32), ("target", np.int32, max(targets, 1))], align=True)
    whole = [("targets", target, max(targets, 1)), ("lobes", lobe, max(elements, 1))]
    return {"Target": target, "Lobe": lobe, "Scatter": np.dtype(whole, align=True)}


EVENT_BITS = 6  # of an event in a path's code: kernels/elements/path_code.cl
PATH_WORDS = {"short": 2, "long": 8}  # of a path's code: kernels/elements/path_code_*.cl
SHORT_EVENTS, MAX_EVENTS = (32 * words // EVENT_BITS for words in PATH_WORDS.values())  # of a path, by its code


def path_dtype(code: str) -> np.dtype:
    """A path that is tracked. code: of PATH_WORDS. word: its code, the lowest word first; scale: factor that turns its
    weights into whole numbers; class_scale: the same for the images of its event class, whose number is kind."""
    return np.dtype([("word", np.uint32, PATH_WORDS[code]), ("scale", np.float32), ("class_scale", np.float32),
                     ("kind", np.int32)], align=True)  # fmt: skip


PATH = path_dtype("short")


KNOWN_STEPS = 2


def stop_sieve_dtype(real) -> np.dtype:
    """Limits of the rays that need not be followed, as optics/elements/stop_sieve.py has them."""
    names = ("mirror_least2", "mirror_most2", "hole2", "rim2", "stop_least2", "stop_most2", "beside2", "slope2")
    return np.dtype([(name, real) for name in names] + [("stop", np.int32)], align=True)


def path_job_dtype(real, cones: int = 1, sieve: bool = False) -> np.dtype:
    """Parameters of a non-sequential launch: sizes of its tables, and the start of its rays, which go into `cones`.

    found_size: number of entries for found paths, 0 in a run that stores images. screen_group, screen_element: the
    group and the element where rays start. inverse_unit_area: 1 / (aim_ll aim_mm) of the emitter whose rays have weight
    1. may: bits of the elements that a ray may meet in its first steps. cone_from: if there are several cones, the
    least number, of 32 bits, of the rays of each but the first. sieve: if rays that end at the stop are not followed.
    """
    names = ("path_count", "element_count", "found_size", "bounce_limit", "screen_group", "screen_element")
    fields = [(name, np.int32) for name in names]
    fields += [("inverse_unit_area", real), ("may", np.uint32, KNOWN_STEPS)]
    fields += [("cone_from", np.uint32, (cones - 1,))] * (cones > 1)
    return np.dtype(fields + [("sieve", stop_sieve_dtype(real))] * sieve, align=True)


_C_NAMES = {
    np.dtype(np.float32): "float",
    np.dtype(np.float64): "double",
    np.dtype(np.int32): "int",
    np.dtype(np.uint32): "uint",
    np.dtype(np.uint64): "ulong",
}


def c_declarations(structs: dict[str, np.dtype], constants: dict[str, tuple[int, ...]] | None = None) -> str:
    """OpenCL C text of the fates, the structures (each after those that it contains), and the constant tables.

    structs: C name -> dtype; the entry of a nested dtype must come first. constants: C name -> whole numbers; they
    describe the scene's structure, never its values.
    """
    fates = ", ".join(f"FATE_{fate.name} = {fate.value}" for fate in Fate)
    lines = [f"enum {{ {fates}, FATE_COUNT = {len(Fate)} }};"]
    names = dict(_C_NAMES)
    for name, dtype in structs.items():
        fields = "".join(f" {_c_field(field, dtype.fields[field][0], names)};" for field in dtype.names)
        lines.append(f"typedef struct {{{fields} }} {name};")
        names[dtype] = name
    for name, values in (constants or {}).items():
        lines.append(f"__constant int {name}[{len(values)}] = {{{', '.join(str(int(v)) for v in values)}}};")
    return "\n".join(lines) + "\n"


def _c_field(name: str, dtype: np.dtype, c_names: dict) -> str:
    if dtype.subdtype is None:
        return f"{c_names[dtype]} {name}"
    base, shape = dtype.subdtype
    return f"{c_names[base]} {name}" + "".join(f"[{n}]" for n in shape)
