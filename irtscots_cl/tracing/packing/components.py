"""A scene's parts as the structures of the non-sequential kernels."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from irtscots_cl.opencl.structs import TIS_NODES, element_dtype, path_job_dtype, scatter_structs
from irtscots_cl.optics.elements.components import Component, groups_of, on_screen, targets_of
from irtscots_cl.optics.elements.first_hits import ALL, may_meet
from irtscots_cl.optics.elements.stop_sieve import stop_sieve
from irtscots_cl.optics.screen_model import screen_frame
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.scatter.models import ABg, Harvey, Lambertian

SCATTER_CHANCE = 0.125  # of a ray to part from where light scatters
LOBE_SHARE = 0.25  # of rays that scatter: drawn from a lobe, not towards a target
MAX_WEIGHT = 2.0**10  # of a ray that starts: sums of weights of 2^33 such rays fit 64 bits
MIN_WEIGHT = 1e-3  # of the weaker branch of a ray, where both are followed
LOBE_WIDTHS = (1e-9, 3.0)  # wider ones look alike within the horizon
MIN_POWER = 0.02  # of a lobe that directions are drawn from: nearer to 0, single precision fails


def pack_elements(scene: Scene, components: tuple[Component, ...], real, least_chance: float) -> np.ndarray:
    """The parts as Element structures [parts]. Rays at surfaces that scatter never take both branches."""
    origins, group = groups_of(scene, components)
    out = np.zeros(len(components), element_dtype(real, len(origins)))
    for entry, component, of in zip(out, components, group, strict=True):
        frame = component.frame
        entry["axis_x"], entry["axis_y"], entry["axis_z"] = frame.axes
        to = (origins - frame.position_mm) @ frame.axes.T
        entry["offset"] = np.column_stack([to, np.abs(to).sum(1)])
        entry["origin"] = frame.position_mm - origins[of]
        for name in ("q_xx", "q_yy", "q_zz", "q_xz"):
            entry[name] = getattr(component.quadric, name)
        entry["outer2"], entry["inner2"] = min(component.outer_mm**2, 1e30), component.inner_mm**2
        entry["half_u"], entry["half_v"] = (min(half, 1e30) for half in component.half_mm)
        entry["reflectance"] = -1.0 if np.isnan(component.reflectance) else component.reflectance
        entry["index_front"], entry["index_back"] = component.index_front, component.index_back
        entry["coating_index"], entry["transmittance"] = component.coating_index, component.transmittance
        entry["least_chance"], entry["min_weight"] = least_chance, MIN_WEIGHT if component.scatter is None else 1e30
        entry["inverse_focal_length"], entry["group"] = 1 / component.focal_length_mm, of
    return out


def pack_scatter(
    scene: Scene, components: tuple[Component, ...], real, aimed: bool
) -> tuple[np.ndarray, dict[str, np.dtype]]:
    """The Scatter structure [()] and its types. aimed: whether scattered rays are also aimed at targets."""
    origins, _ = groups_of(scene, components)
    scatters = any(component.scatter is not None for component in components)
    targets = targets_of(scene) if aimed and scatters else ()
    structs = scatter_structs(real, len(origins), len(components) if scatters else 0, len(targets))
    out = np.zeros((), structs["Scatter"])
    for entry, target in zip(out["targets"], targets, strict=False):
        entry["centre"] = target.frame.position_mm - origins
        entry["axis_x"], entry["axis_y"], entry["axis_z"] = target.frame.axes
        entry["radius"] = target.radius_mm
    for entry, component in zip(out["lobes"], components, strict=False):
        if component.scatter is not None:
            _pack_lobe(entry, component.scatter)
            others = [k for k, target in enumerate(targets) if target.name != component.name]
            entry["share"], entry["target_count"] = LOBE_SHARE if others else 1.0, len(others)
            entry["target"][: len(others)] = others
    return out, structs


def is_rough(model: object) -> bool:
    """Whether a scatter model tells its total by the surface's roughness: it then depends on incidence and media."""
    return isinstance(model, Harvey) and model.roughness_phase is not None


def _pack_lobe(entry: np.ndarray, model: Lambertian | Harvey | ABg) -> None:
    """A model's numbers and table, and the shape of the lobe that directions are drawn from: its own, or near it.

    The lobe of a given roughness has a total of 1 at normal incidence: kernels/scatter/scatter_rough.cl scales it.
    """
    width, slope, centre = 1.0, 0.0, 0.0
    entry["numbers"] = float(model.bsdf(0.0)), 0.0, 0.0
    if isinstance(model, Harvey):
        width, slope, centre = model.l, model.s, 1.0
        entry["numbers"] = float(model.bsdf(0.0)), 1 / model.l**2, model.s / 2
    elif isinstance(model, ABg):
        width, slope, centre = model.b ** (1 / max(model.g, 1e-3)), -model.g, 1.0
        entry["numbers"] = model.a, model.b, model.g / 2
    power = slope / 2 + 1
    entry["power"] = power if abs(power) >= MIN_POWER else MIN_POWER
    entry["inverse_l2"], entry["centre"] = 1 / np.clip(width, *LOBE_WIDTHS) ** 2, centre
    cosine = np.linspace(0, 1, TIS_NODES) ** 2
    entry["tis"] = model.above_horizon(np.sqrt(1 - cosine**2))
    if is_rough(model):
        total = float(model.lobe(1.0))
        entry["numbers"][0] /= total
        entry["tis"] /= total
        entry["phase"] = model.roughness_phase
    entry["probability"] = SCATTER_CHANCE


def unit_area(sources: np.ndarray) -> np.floating | float:
    """aim_ll aim_mm of the emitters [n] whose rays have weight 1: the largest of those aimed at the mirror.

    Larger where rays of other cones would else weigh more than MAX_WEIGHT.
    """
    largest = np.max(sources["aim_ll"] * sources["aim_mm"])
    if "cones" not in sources.dtype.names:
        return largest
    return max(float(largest), 1 / (MAX_WEIGHT * float(sources["cones"]["density"][:, -1].min())))


def path_job(
    scene: Scene,
    components: tuple[Component, ...],
    real,
    bounce_limit: int,
    sources: np.ndarray,
    cone_from: np.ndarray | None = None,
) -> np.ndarray:
    """The PathJob structure [()], but for what changes from launch to launch. cone_from: of several cones.

    It has a field `sieve` where rays that end at the stop need not be followed.
    """
    several = cone_from is not None and len(cone_from) > 0
    may, sieve = (ALL, ALL), None
    if not several:
        screen = screen_frame(scene.screen)
        may = may_meet(components, screen, sources, scene.screen.pitch_xy_mm)
        if bounce_limit > 1:  # a ray that is given up at the mirror does not end at the stop
            sieve = stop_sieve(Surface.of(scene.mirror), components, screen, sources, scene.screen.pitch_xy_mm, may,
                               float(np.finfo(real).eps))  # fmt: skip
    job = np.zeros((), path_job_dtype(real, len(cone_from) + 1 if several else 1, sieve is not None))
    job["element_count"], job["bounce_limit"] = len(components), bounce_limit
    job["screen_group"], job["screen_element"] = 1, on_screen(scene, components)
    job["inverse_unit_area"] = 1 / unit_area(sources)
    job["may"] = may
    if several:
        job["cone_from"] = cone_from
    if sieve is not None:
        for name, value in asdict(sieve).items():
            job["sieve"][name] = value
    return job
