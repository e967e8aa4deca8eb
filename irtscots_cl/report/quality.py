"""What a result says of its islands, its misfit of integration and its Zernike fit, in numbers and in warnings."""

from __future__ import annotations

from dataclasses import asdict
from typing import cast

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.integration import Islands, Misfit, separate_islands
from irtscots_cl.maths.integration.islands import JOIN_LIMIT
from irtscots_cl.maths.low_order import rms
from irtscots_cl.measurement.coefficients import Coefficients
from irtscots_cl.measurement.quality import OK, WARNING, Check
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.types import CheckFacts, IslandFacts, IslandReport, MisfitFacts, ZernikeFitFacts

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


def check_facts(checks: list[Check]) -> list[CheckFacts]:
    return [cast("CheckFacts", asdict(check)) for check in checks]


def misfit_facts(misfit: Misfit) -> MisfitFacts:
    return {
        "urad_rms": misfit.slope * 1e6,
        "noise_urad_rms": misfit.expected * 1e6,
        "systematic_urad_rms": misfit.systematic * 1e6,
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


def quality_checks(islands: IslandReport, misfit: MisfitFacts, fit: ZernikeFitFacts, mirror_hole: bool) -> list[Check]:
    """What a user must know before the heights are used, as checks.

    mirror_hole: whether the mirror has a central hole, so that annular terms may help.
    """
    return [_island_check(islands), _misfit_check(misfit), _fit_check(fit, mirror_hole)]


def quality_warnings(islands: IslandReport, misfit: MisfitFacts, fit: ZernikeFitFacts, mirror_hole: bool) -> list[str]:
    """The texts of those quality_checks that do not pass."""
    return [check.text for check in quality_checks(islands, misfit, fit, mirror_hole) if check.level != OK]


def _island_check(islands: IslandReport) -> Check:
    groups = islands["groups"]
    if groups == 1:
        return Check("islands", OK, 1.0, 1.0, 1e-3, f"{islands['count']} islands of pixels, all joined")
    alone = islands["pixels_alone"]
    text = (
        f"the mask has {islands['count']} islands in {groups} groups whose pistons against each other are unknown "
        f"(gaps too wide for the deviation); heights and their predicted error are of the largest group, "
        f"{islands['pixels_in_heights']} pixels" + (f"; {alone} single pixels have no height" if alone else "")
    )
    return Check("islands", WARNING, float(groups), 1.0, 1e-3, text)


def _misfit_check(misfit: MisfitFacts) -> Check:
    value, limit, noise = misfit["urad_rms"], misfit["limit_urad_rms"], misfit["noise_urad_rms"]
    text = f"{value:.3g} urad rms of the slopes belong to no surface (limit {limit:.3g}"
    text += f", noise {noise:.3g})" if np.isfinite(noise) else ")"
    if not misfit["suspicious"]:
        return Check("integration misfit", OK, value, limit, 1e-6, text)
    text += ": check the images' orientation, the order of the lines and the line positions"
    return Check("integration misfit", WARNING, value, limit, 1e-6, text)


def _fit_check(fit: ZernikeFitFacts, mirror_hole: bool) -> Check:
    dropped, condition = fit["dropped"], fit["condition"]
    if not dropped:
        text = f"the pixels separate all Zernike terms (condition {condition:.2g})"
        return Check("zernike terms", OK, 0.0, 0.0, 0.0, text)
    way = " (--zernike annular can)" if mirror_hole and fit["kind"] == "circular" else ""
    text = (
        f"the pixels cannot separate {len(dropped)} Zernike terms, from Noll {dropped[0]} on{way}: left out (condition "
        f"{fit['condition_of_all']:.2g}, {condition:.2g} without them)"
    )
    return Check("zernike terms", WARNING, float(len(dropped)), 0.0, 0.0, text)
