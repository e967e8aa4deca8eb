"""The error budget: as data for programs, and as tables."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from irtscots_cl.budget.assess import ErrorBudget
from irtscots_cl.budget.covariance import map_correlation
from irtscots_cl.budget.measured_design import NOLLS
from irtscots_cl.budget.sensitivity import NM
from irtscots_cl.budget.source import Kind, Source
from irtscots_cl.budget.tolerances import Tolerances
from irtscots_cl.calibration.height_response import LEFT_AFTER, by_terms
from irtscots_cl.report.table import Table
from irtscots_cl.scene.error_sources import Distribution

if TYPE_CHECKING:
    from irtscots_cl.budget.stray_paths import RayNoise

HEAD = ("piston, tilt", "+ power", "+ astigmatism", "+ coma")
SHARES = (0.5, 0.68, 0.95, 0.99)
NOISY = 0.05  # of a source's own nm, that rays of its file may add without a warning


def budget_facts(found: ErrorBudget) -> dict[str, Any]:
    """All of it as plain data, without maps."""
    trials, budget = found.trials, found.trials.budget
    facts: dict[str, Any] = {
        "scene": trials.design.setup.scene.name,
        "pixels": trials.design.count,
        "every_pixel": trials.design.seen.step,
        "trials": budget.trials,
        "seed": budget.seed,
        "compensators": list(trials.procedure.compensators),
        "exposures": trials.procedure.exposures,
        "mirror_turns": trials.procedure.turns,
        "calibrated": list(trials.joint.names),
        "sensitivities": [
            {
                "name": name, "unit": one.source.unit, "nm_per_unit": by_terms(one.left_nm),
                "zernike_nm_per_unit": dict(zip(map(str, NOLLS), one.zernike_nm.tolist(), strict=True)),
                "relative_standard_error": one.error, "linear_to": one.linear_to,
            }
            for name, one in found.sensitivities.items()
        ],
    }  # fmt: skip
    if found.ray_noise:
        facts["stray_light"] = [
            {"name": one.name, "rays_nm": by_terms(one.nm), "pixels_without_value": one.without_value}
            for one in found.ray_noise
        ]
    if found.linear is None or found.monte_carlo is None:
        return facts
    linear, spread = found.linear, found.monte_carlo
    facts["sources"] = [
        {
            "name": name, "distribution": given.kind, "size": given.size, "set_ups": given.values, "sigma": given.sigma,
            "nm": by_terms(linear.nm[name]), "sobol_first": linear.first[name], "sobol_total": linear.total[name],
        }
        for name, given in budget.sources.items()
    ]  # fmt: skip
    names, alike = map_correlation(trials.design, {name: found.sensitivities[name] for name in budget.sources})
    facts["map_correlation"] = {"sources": list(names), "matrix": alike.tolist()}
    facts["predicted_nm"] = by_terms(linear.total_nm)
    facts["predicted_zernike_covariance_nm2"] = linear.zernike_covariance_nm2.tolist()
    facts["trials_rms_nm"] = by_terms(spread.root_mean_square_nm)
    facts["trials_largest_share_out_of_view"] = float(np.nanmax(spread.lost))
    facts["trials_not_measured"] = {str(number): why for number, why in spread.failed.items()}
    facts["trials_percentiles_nm"] = {f"{share:g}": by_terms(spread.percentile_nm(share)) for share in SHARES}
    facts["trials_zernike_covariance_nm2"] = spread.zernike_covariance_nm2.tolist()
    if found.tolerances is not None:
        facts["tolerances"] = dataclasses.asdict(found.tolerances)
    facts["ledger"] = _ledger_facts(found)
    return facts


def _ledger_facts(found: ErrorBudget) -> dict[str, Any]:
    """With nothing but the reason for a trial that cannot be measured."""
    if found.ledger is None:
        return {"trial": found.trial, "not_measured": found.no_ledger}
    left = found.trials.design.response.left
    return {
        "trial": found.trial,
        "rows": [
            {"name": row.name, "value": row.value, "nm": by_terms(left(row.height_mm[None])[0] * NM),
             "second_order_nm": row.second_order_nm,
             "second_order_nm_of_any_pixel": row.second_order_mm * NM}
            for row in found.ledger.rows
        ],
        "total_nm": by_terms(left(found.ledger.total_mm[None])[0] * NM),
    }  # fmt: skip


def budget_tables(found: ErrorBudget) -> list[Table]:
    """The tables of the terminal: what each source costs, largest first."""
    if found.linear is None or found.monte_carlo is None:
        return [_sensitivity_table(found), *_stray_tables(found)]
    allowed = [] if found.tolerances is None else _tolerance_tables(found, found.tolerances)
    return [_source_table(found), *_stray_tables(found), _total_table(found), *allowed, _ledger_table(found)]


def stray_warnings(noise: Sequence[RayNoise]) -> list[str]:
    """What must be known of the file of stray light, a line each."""
    said = []
    for one in noise:
        if not one.nm[0] <= NOISY * one.own_nm[0]:
            by_rays = f"{one.nm[0]:.2g} nm" if np.isfinite(one.nm[0]) else "an unknown part (one replicate)"
            said.append(f"{one.name}: {by_rays} of its {one.own_nm[0]:.3g} nm are noise of its file's rays: trace more")
        if one.without_value:
            of = f"{one.without_value} of {one.pixels} pixels"
            said.append(f"{one.name}: {of} have no value in its file; they get that of the nearest pixel that has one")
    return said


def _stray_tables(found: ErrorBudget) -> list[Table]:
    """How sure what the file of stray light says is."""
    if not found.ray_noise:
        return []
    rows = [(one.name, *(f"{nm:.2g}" for nm in one.nm), str(one.without_value)) for one in found.ray_noise]
    title = _said("Stray light: rms height error in nm by the noise of the rays of its file, with terms removed", found)
    return [Table(title, ("source", *HEAD, "pixels without value"), rows)]


def _sensitivity_table(found: ErrorBudget) -> Table:
    ranked = sorted(found.sensitivities.values(), key=lambda one: -one.left_nm[0] * one.source.usual)
    rows = [
        (one.source.name, f"{one.source.usual:.3g} {one.source.unit}".strip(),
         *(f"{nm:.3g}" for nm in one.left_nm * one.source.usual), f"{one.linear_to:.2g}")
        for one in ranked
    ]  # fmt: skip
    title = _said("Rms height error in nm of each source at a usual value, with terms removed", found)
    return Table(title, ("source", "value", *HEAD, "linear to"), rows)


def _source_table(found: ErrorBudget) -> Table:
    assert found.linear is not None
    linear, given = found.linear, found.trials.budget.sources
    ranked = sorted(given, key=lambda name: -linear.nm[name][0])
    star = {name: " *" if name in found.trials.joint.names else "" for name in given}
    rows = [
        (name + star[name],
         _given(given[name], found.sensitivities[name].source),
         *(f"{nm:.3g}" for nm in linear.nm[name]), f"{100 * linear.total[name]:.1f} %")
        for name in ranked
    ]  # fmt: skip
    title = "What each source costs: rms height error in nm for its standard deviation, with terms removed"
    if joint := found.trials.joint.names:
        title += f"; * {len(joint)} vary together as calibrated, share of the spread of all of them"
    title = _said(title, found)
    return Table(title, ("source", "given", *HEAD, "share of the spread"), rows)


def _given(distribution: Distribution, source: Source) -> str:
    """A source's size in words."""
    kind = distribution.kind if source.kind is Kind.PARAMETER else source.kind.value
    text = f"{kind} {distribution.size:.3g} {source.unit}".strip()
    return text if distribution.values == 1 else f"{text}, mean of {distribution.values}"


def _total_table(found: ErrorBudget) -> Table:
    assert found.linear is not None and found.monte_carlo is not None
    spread = found.monte_carlo
    constants = [source for source in found.trials.sources if source.kind is Kind.CONSTANT]
    alike = bool(found.trials.joint.names) or len(constants) > 1  # what acts together has signs
    first = "predicted, with what is correlated" if alike else "root of the sum of squares"
    rows = [(first, *(f"{nm:.3g}" for nm in found.linear.total_nm)),
            ("rms of the trials", *(f"{nm:.3g}" for nm in spread.root_mean_square_nm)),
            *((f"{100 * share:g} % of the trials below", *(f"{nm:.3g}" for nm in spread.percentile_nm(share)))
              for share in SHARES)]  # fmt: skip
    if np.nanmax(spread.lost) > 0:
        trial = int(np.nanargmax(spread.lost))
        share = f"{100 * spread.lost[trial]:.2g} %"
        rows.append((f"trial {trial}: {share} of the pixels out of view, the most; they count as if seen", *[""] * 4))
    if spread.failed:
        number, why = next(iter(spread.failed.items()))
        rows.append(
            (f"{len(spread.failed)} cannot be measured and count as the worst; trial {number}: {why}", *[""] * 4)
        )
    title = _said(f"All together, {found.trials.budget.trials} trials: rms height error in nm", found)
    return Table(title, ("", *HEAD), rows)


def _said(title: str, found: ErrorBudget) -> str:
    """A title with what is made of the heights."""
    done = found.trials.procedure.text
    return f"{title}; {done}" if done else title


def _ledger_table(found: ErrorBudget) -> Table:
    if found.ledger is None:
        return Table(f"Ledger of trial {found.trial}: cannot be measured", ("why",), [(found.no_ledger,)])
    left = found.trials.design.response.left
    ranked = sorted(((left(row.height_mm[None])[0] * NM, row) for row in found.ledger.rows), key=lambda one: -one[0][0])
    rows = [
        (row.name, f"{row.value:.4g}", *(f"{value:.3g}" for value in nm), f"{row.second_order_nm:.2g}")
        for nm, row in ranked
    ]
    rows.append(("sum of the maps", "", *(f"{nm:.3g}" for nm in left(found.ledger.total_mm[None])[0] * NM), ""))
    title = f"Ledger of trial {found.trial}: rms in nm of each source's map; the maps add up to the whole error"
    title = _said(title, found)
    return Table(title, ("source", "value", *HEAD, "second order, at most"), rows)


def _tolerance_tables(found: ErrorBudget, told: Tolerances) -> list[Table]:
    """The largest size of each source alone, and what to calibrate where the test costs more than it may."""
    unit = {name: one.source.unit for name, one in found.sensitivities.items()}
    rows = [(one.name, f"{one.given:.3g} {unit[one.name]}".strip(), _size(one.largest, unit[one.name]),
             "as given" if one.together == one.given else f"{one.together:.3g} {unit[one.name]}".strip())
            for one in told.each]  # fmt: skip
    rows.append(("all by one factor", "1 x", f"{told.common_factor:.3g} x", ""))
    share = f"{100 * told.coverage:g} % of tests"
    title = f"{told.allow_nm:g} nm allowed, {told.now_nm:.3g} nm now for {share}: largest sizes"
    if told.cap_nm < np.inf:
        title += f"; together, with none that costs more than {told.cap_nm:.3g} nm alone"
    tables = [Table(title, ("source", "given", "alone, all others as given", "all together"), rows)]
    if told.now_nm > told.allow_nm:
        steps = [(step.name, "" if step.cost is None else f"{step.cost:g}", f"{step.after_nm:.3g}")
                 for step in told.plan]  # fmt: skip
        reached = bool(told.plan) and told.plan[-1].after_nm <= told.allow_nm
        title = "What to calibrate, one after the other" + ("" if reached else "; even all of it does not suffice")
        tables.append(Table(title, ("source", "cost", f"nm left for {share}"), steps))
    return tables


def _size(value: float, unit: str) -> str:
    if value == 0:
        return "none: the others cost too much"
    return "any" if value == float("inf") else f"{value:.3g} {unit}".strip()


def simulated_table(facts: dict[str, Any]) -> Table:
    """A trial's simulated test beside the trial: facts of pipeline/simulated_trial.py."""
    rows = [
        ("the trial's height, of the sources that a scene holds", f"{facts['predicted_nm']:.4g}"),
        ("simulated: traced, measured, less the design's", f"{facts['simulated_nm']:.4g}"),
        ("difference of the two", f"{facts['difference_nm']:.3g}"),
        ("standard error of the simulated one by rays", f"{facts['rays_nm']:.3g}"),
        ("the design's own error, by measure and rays", f"{facts['design_nm']:.3g}"),
        ("simulated with the pixels that the rim cuts", f"{facts['with_rim_nm']:.4g}"),
        ("left out", ", ".join(facts["left_out"]) or "nothing"),
    ]
    title = f"Trial {facts['trial']} as a test: rms height error in nm of {facts['pixels']} pixels off the rim"
    return Table(f"{title}, piston and tilt removed", ("", ""), rows)


def budget_rows(found: ErrorBudget) -> list[list[str]]:
    """The sources as rows of a CSV file, the head first; of a budget without sources, all that there are at their usual
    values."""
    head = ["source", "unit", "distribution", "size", "sigma", *(f"nm_{terms}" for terms in LEFT_AFTER), "sobol_total"]
    rows = [head]
    if found.linear is None:
        for name, one in found.sensitivities.items():
            size = f"{one.source.usual:.9g}"
            nm = [f"{value:.9g}" for value in one.left_nm * one.source.usual]
            rows.append([name, one.source.unit, "usual", size, size, *nm, ""])
        return rows
    for name, given in found.trials.budget.sources.items():
        unit = found.sensitivities[name].source.unit
        nm = [f"{value:.9g}" for value in found.linear.nm[name]]
        rows.append([name, unit, given.kind, f"{given.size:.9g}", f"{given.sigma:.9g}", *nm,
                     f"{found.linear.total[name]:.9g}"])  # fmt: skip
    return rows
