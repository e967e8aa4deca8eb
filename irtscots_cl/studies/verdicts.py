"""Results of a study: rows with the paper's number, theory and our number, each with a verdict and its test."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from scipy import stats

from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.report.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FAILURE_CHANCE = 1e-5  # probability that a verdict's test fails although theory and program are right
Z_LIMIT = float(stats.norm.isf(FAILURE_CHANCE / 2))
AGREES, BETTER, INCONSISTENT = "agrees", "better", "paper inconsistent"
DIFFERS, ALONE = "differs", "ours alone"
ROUNDING = 1e-9  # relative, for numbers without any other error
TEST = f"tested against theory to {Z_LIMIT:.1f} standard errors, failure chance {FAILURE_CHANCE:g} each"
HEAD = ("quantity", "paper", "expected", "ours", "verdict", "because")


@dataclass(frozen=True)
class VerdictRow:
    """One line of a study's table. quantity: name with unit; paper, expected: NaN if there is none."""

    quantity: str
    paper: float
    expected: float
    ours: Estimate
    verdict: str
    reason: str

    def cells(self) -> tuple[str, ...]:
        ours = str(self.ours) if math.isfinite(self.ours.value) else "-"
        return (self.quantity, _shown(self.paper), _shown(self.expected), ours, self.verdict, self.reason)


@dataclass(frozen=True)
class StudyResult:
    """Result of a study. notes: definitions, seeds, ray numbers, one line each. figures: by file name."""

    rows: tuple[VerdictRow, ...]
    notes: tuple[str, ...] = ()
    figures: dict[str, Figure] = field(default_factory=dict)

    def table(self, title: str) -> Table:
        return Table(title, HEAD, [row.cells() for row in self.rows])


def _shown(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else ""


def row(
    quantity: str,
    ours: Estimate,
    *,
    paper: float = math.nan,
    expected: float = math.nan,
    allowed: float = 0.0,
    closeness: float = 0.1,
    better: str = "",
    inconsistent: str = "",
) -> VerdictRow:
    """A row with its verdict.

    First, ours is compared with theory: they may differ by `allowed` (effects that theory neglects; see the study's
    notes) plus Z_LIMIT standard errors, else the verdict is "differs". Then ours is compared with the paper's number:
    they agree if ours is within `closeness` (relative) or Z_LIMIT standard errors of it. If they do not, the verdict is
    "paper inconsistent" if `inconsistent` says why the paper's inputs do not give its number; "better" if ours is
    better in the sense of `better` ("lower" or "higher"); else "differs". Without theory and paper there is no test.
    """
    error = ours.standard_error if math.isfinite(ours.standard_error) else 0.0
    with_theory = ""
    if math.isfinite(expected):
        off = abs(ours.value - expected)
        with_theory = _test_text(off, allowed, error)
        if not off <= allowed + Z_LIMIT * error + ROUNDING * abs(expected):
            return VerdictRow(quantity, paper, expected, ours, DIFFERS, with_theory)
    if not math.isfinite(paper):
        return VerdictRow(quantity, paper, expected, ours, AGREES if with_theory else ALONE, with_theory)
    verdict, reason = _beside_paper(ours.value, error, paper, closeness, better, inconsistent)
    return VerdictRow(quantity, paper, expected, ours, verdict, f"{reason}; {with_theory}" if with_theory else reason)


def _beside_paper(ours: float, error: float, paper: float, closeness: float, better: str, inconsistent: str):
    """Verdict and reason from comparing our number with the paper's only."""
    away = abs(ours - paper)
    if away <= closeness * abs(paper):
        return AGREES, f"{ours / paper - 1:+.0%} from the paper"
    if away <= Z_LIMIT * error:
        return AGREES, f"|z| = {away / error:.1f} from the paper, limit {Z_LIMIT:.1f}"
    if inconsistent:
        return INCONSISTENT, inconsistent
    is_better = (better == "lower" and ours < paper) or (better == "higher" and ours > paper)
    return BETTER if is_better else DIFFERS, f"{ours / paper:.2g} of the paper's"


def _test_text(off: float, allowed: float, error: float) -> str:
    """How the difference from theory was tested."""
    if off <= allowed or not error:
        return f"{off:.2g} off theory, {allowed:.2g} allowed"
    beyond = f" beyond {allowed:.2g}" if allowed else ""
    return f"|z| = {(off - allowed) / error:.1f}{beyond} from theory, limit {Z_LIMIT:.1f}"


def exact(value: float) -> Estimate:
    """A number without statistical error."""
    return Estimate(value, math.nan)
