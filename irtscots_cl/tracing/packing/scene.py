"""A scene's numbers as the kernels' structures: which files they need and what goes into every field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.frame import Frame
from irtscots_cl.opencl.structs import (
    LAUNCH,
    PRECISIONS,
    chord_dtype,
    emitter_dtype,
    facet_dtype,
    frame_dtype,
    image_dtype,
    lens_dtype,
    line_receiver_dtype,
    mirror_dtype,
    patch_dtype,
    receiver_dtype,
    scene_dtype,
)
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.surface import Surface

EDGE_POINTS = 65  # along each side of the image, where its largest radius is looked for
BEYOND_EDGE = 1e-3  # of the square of that radius: room for the points between


@dataclass(frozen=True)
class Packed:
    """A scene ready for the kernels: file choices, C structures and constants, the scene's structure and tables."""

    choices: dict[str, str]
    structs: dict[str, np.dtype]
    constants: dict[str, tuple[int, ...]]
    scene: np.ndarray  # [1]
    tables: np.ndarray  # [n] reals of the mirror, too many for a structure


def pack(chief: ChiefRays, precision: str) -> Packed:
    """Everything about a scene that does not depend on the estimator."""
    real, surface = PRECISIONS[precision], chief.surface
    deviated, annular = bool(surface.departures), surface.obscuration_radius_mm > 0
    mirror = mirror_dtype(real, deviated, annular)
    distorted, bent = chief.camera_model.is_distorted, chief.screen_model.surface is not None
    structs = {**_device_structs(real, distorted, bent), "Mirror": mirror}
    choices, constants, values, of_mirror = {"outline": "none", "arrival": "plain"}, {}, {}, {}
    tables = np.zeros(1, real)  # a buffer is never empty
    if deviated:
        from irtscots_cl.tracing.packing import departures  # imported late: many mirrors are their conics

        packed = departures.pack_departures(surface, real)
        structs |= packed.structs
        choices |= packed.choices
        constants = packed.constants | departures.mirror_constants(chief, precision)
        values, tables = packed.values, np.asarray(packed.tables, real)
        if departures.is_slight(surface, precision):
            choices["arrival"] = "compensated"
        of_mirror = departures.mirror_values(chief)
    if surface.outline is not None:
        from irtscots_cl.tracing.packing.outline import pack_outline  # imported late: few mirrors are no disks

        outline = pack_outline(surface.outline, real, len(tables))
        structs |= outline.structs
        choices["outline"], values["outline"] = outline.choice, outline.value
        tables = np.concatenate([tables, np.asarray(outline.tables, real)])
    glass = chief.screen_model.glass
    parts = {name: value.dtype for name, value in values.items()}
    parts |= {"lens": structs["Lens"]} if distorted else {}
    structs["Scene"] = scene_dtype(real, mirror, parts, glass is not None)
    scene = np.zeros(1, structs["Scene"])
    _fill_mirror(scene["mirror"][0:1], surface)
    for name, value in of_mirror.items():
        scene["mirror"][name] = value
    _fill_frame(scene["screen"], chief.screen_frame)
    _fill_frame(scene["camera"], chief.camera_frame)
    _fill_devices(scene, chief)
    for name, value in values.items():
        scene[name] = value
    if distorted:
        _fill_lens(scene["lens"], chief)
        choices["lens"] = "rational" if any(chief.camera_model.distortion[5:]) else "polynomial"
    if glass is not None:
        scene["glass_thickness"], scene["glass_index2"] = glass.thickness_mm, glass.index**2
    choices |= {
        "surface": _surface_file(chief.scene.mirror),
        "mirror": "deviated" if deviated else "nominal",
        "aperture": "annulus" if annular else "disk",
        "frame": _frame_file(chief.screen_frame, chief.camera_frame),
        "camera": "distorted" if distorted else "plain",
        "screen": "bent" if bent else "flat",
        "glass": "none" if glass is None else "plate",
    }
    return Packed(choices, structs, constants, scene, tables)


def _device_structs(real, distorted: bool, bent: bool) -> dict[str, np.dtype]:
    """Structures of the launch, the screen and the camera."""
    return {
        "Launch": LAUNCH,
        **({"Facet": facet_dtype(real), "Patch": patch_dtype(real)} if bent else {}),
        **({"Image": image_dtype(real), "Lens": lens_dtype(real)} if distorted else {}),
        "Emitter": emitter_dtype(real, bent),
        "Receiver": receiver_dtype(real, distorted, bent),
        "Chord": chord_dtype(real),
        "LineReceiver": line_receiver_dtype(real, distorted, bent),
        "Frame": frame_dtype(real),
    }


def _surface_file(mirror) -> str:
    if mirror.is_flat:
        return "flat"
    if mirror.conic == 0:
        return "sphere"  # also off axis: every point of a sphere is a vertex
    return "off_axis" if mirror.off_axis_mm != 0 else "conic"


def _frame_file(*frames: Frame) -> str:
    """The cheapest file that holds for all of the devices' frames."""
    axes = np.stack([frame.axes for frame in frames])  # [devices, axis, component]
    if axes[:, 0, 1].any():
        return "turned"
    return "upright" if axes[:, 2, 1].any() else "level"


def _fill_mirror(out: np.ndarray, surface: Surface) -> None:
    for name in ("q_xx", "q_yy", "q_zz", "q_xz"):
        out[name] = getattr(surface.quadric, name)
    out["aperture_radius2"] = surface.aperture_radius_mm**2
    if surface.obscuration_radius_mm > 0:
        out["obscuration_radius2"] = surface.obscuration_radius_mm**2


def _fill_frame(out: np.ndarray, frame: Frame) -> None:
    out["position"] = frame.position_mm
    for name, axis in zip(("axis_x", "axis_y", "axis_z"), frame.axes, strict=True):
        out[name] = axis
    out["offset"] = -frame.axes @ frame.position_mm


def _fill_devices(out: np.ndarray, chief: ChiefRays) -> None:
    screen, camera, model = chief.scene.screen, chief.scene.camera, chief.camera_model
    pitch, of_pixels = np.array(screen.pitch_xy_mm), np.array(model.pitch_mm)
    shift = np.array(model.shift) * model.image_distance_mm  # from an image point seen from the aperture's centre
    centre = np.array(model.centre[::-1]) if model.is_distorted else model.centre[::-1] + shift / of_pixels
    values = {
        "screen_pitch": pitch,
        "inverse_screen_pitch": 1 / pitch,
        "detector_pitch": of_pixels,
        "inverse_detector_pitch": 1 / of_pixels,
    }
    pairs = {f"{name}_{axis}": value for name, both in values.items() for axis, value in zip("xy", both, strict=True)}
    pairs["screen_left"], pairs["screen_top"] = np.array(screen.pixels) / 2 - np.array(screen.centre_offset_mm) / pitch
    pairs["detector_left"], pairs["detector_top"] = centre + 0.5
    for name, value in {
        "aperture_radius": camera.aperture_diameter_mm / 2,
        "aperture_radius2": (camera.aperture_diameter_mm / 2) ** 2,
        "inverse_focal_length": 1 / camera.focal_length_mm,
        "inverse_focus": 1 / camera.focus_mm,
        "image_distance": camera.image_distance_mm,
        "inverse_image_distance": 1 / camera.image_distance_mm,
        "detector_columns": camera.detector.pixels[0],
        "detector_rows": camera.detector.pixels[1],
        **pairs,
    }.items():
        out[name] = value


def _fill_lens(out: np.ndarray, chief: ChiefRays) -> None:
    model, (rows, columns) = chief.camera_model, chief.shape
    k1, k2, p1, p2, k3, k4, k5, k6 = model.distortion
    edge = np.linspace(-0.5, 0.5, EDGE_POINTS)
    across, down = (columns - 1) / 2 + edge * columns, (rows - 1) / 2 + edge * rows
    on_edge = [(down, -0.5), (down, columns - 0.5), (-0.5, across), (rows - 0.5, across)]
    points = [np.array(model.image_point(*at)) / model.image_distance_mm for at in on_edge]
    radius2 = [np.sum((point + np.array(model.shift)[:, None]) ** 2, 0) for point in points]
    focal = model.image_distance_mm / np.array(model.pitch_mm)
    for name, value in {
        "above": (k1 - k4, k2 - k5, k3 - k6),
        "below": (k4, k5, k6),
        "p1": p1,
        "p2": p2,
        "focal_x": focal[0],
        "focal_y": focal[1],
        "shift_x": model.shift[0],
        "shift_y": model.shift[1],
        "most2": np.nanmax(radius2) * (1 + BEYOND_EDGE),
        "inverse_pixel_area": 1 / model.pixel_area_mm2,
    }.items():
        out[name] = value
