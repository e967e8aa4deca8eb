"""What a result says of its islands, its misfit of integration and its Zernike fit, in numbers and in warnings."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.integration import Islands, Misfit, separate_islands
from irtscots_cl.maths.integration.islands import JOIN_LIMIT
from irtscots_cl.maths.low_order import rms
from irtscots_cl.measurement.coefficients import Coefficients
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.types import IslandFacts, IslandReport, MisfitFacts, ZernikeFitFacts

LISTED_ISLANDS = 20  # the largest


def island_facts(result: Reconstruction, height_mm: FloatArray) -> IslandReport:
    """The islands of a result. height_mm: [rows, columns], whose rms is told for each and with own pistons."""
    islands = result.islands or separate_islands(result.mask)
    level = result.levelled(height_mm)
    counted = np.bincount(islands.group_map[islands.mask])
    counted[0] = 0
    connected = counted[islands.group_map] > 1
    shown = range(min(islands.count, LISTED_ISLANDS))
    return {
        "count": islands.count,
        "groups": islands.groups,
        "pixels_in_heights": int(islands.main.sum()),
        "pixels_alone": islands.alone,
        "join_limit": JOIN_LIMIT,
        "own_pistons_nm_rms": rms(level, connected) * 1e6 if connected.any() else float("nan"),
        "largest": [_island(islands, k, level) for k in shown],
    }


def _island(islands: Islands, k: int, level: FloatArray) -> IslandFacts:
    known = bool(islands.group[k] == 1)
    return {
        "pixels": int(islands.sizes[k]),
        "group": int(islands.group[k]),
        "piston_known": known,
        "piston_standard_error_nm": float(islands.error_mm[k] * 1e6) if known else float("nan"),
        "nm_rms": rms(level, islands.label == k + 1) * 1e6,
    }


def misfit_facts(misfit: Misfit) -> MisfitFacts:
    return {
        "urad_rms": misfit.slope * 1e6,
        "noise_urad_rms": misfit.expected * 1e6,
        "limit_urad_rms": misfit.limit * 1e6,
        "suspicious": misfit.suspicious,
    }


def fit_facts(found: Coefficients) -> ZernikeFitFacts:
    return {
        "kind": found.kind,
        "radius_mm": found.radius_mm,
        "obscuration_ratio": found.fit.ratio,
        "condition": found.fit.condition,
        "condition_of_all": found.fit.condition_all,
        "dropped": list(found.fit.dropped),
        "residual_nm_rms": found.residual_nm,
        "standard_errors_from": found.error_source,
    }


def quality_warnings(islands: IslandReport, misfit: MisfitFacts, fit: ZernikeFitFacts, mirror_hole: bool) -> list[str]:
    """One line for each thing that a user must know before the heights are used.

    mirror_hole: whether the mirror has a central hole, so that annular terms may help.
    """
    lines = []
    if islands["groups"] > 1:
        lines.append(
            f"the mask has {islands['count']} islands in {islands['groups']} groups whose pistons against each other "
            f"are unknown (gaps too wide for the deviation); heights are of the largest group, "
            f"{islands['pixels_in_heights']} pixels"
            + (f"; {islands['pixels_alone']} single pixels have no height" if islands["pixels_alone"] else "")
        )
    if misfit["suspicious"]:
        noise = misfit["noise_urad_rms"]
        lines.append(
            f"{misfit['urad_rms']:.3g} urad rms of the slopes belong to no surface (limit "
            f"{misfit['limit_urad_rms']:.3g}"
            + (f", noise {noise:.3g}" if np.isfinite(noise) else "")
            + "): check the images' orientation, the order of the lines and the line positions"
        )
    if fit["dropped"]:
        way = " (--zernike annular can)" if mirror_hole and fit["kind"] == "circular" else ""
        lines.append(
            f"the pixels cannot separate {len(fit['dropped'])} Zernike terms, from Noll {fit['dropped'][0]} on{way}: "
            f"left out (condition {fit['condition_of_all']:.2g}, {fit['condition']:.2g} without them)"
        )
    return lines
