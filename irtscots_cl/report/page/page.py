"""The page of a run or of a measurement: report.html, and what is drawn in it."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from irtscots_cl.analysis.comparison import Comparison
from irtscots_cl.analysis.error_terms import ErrorTerm
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.measurement.error_bars import ErrorBars
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.page.curves import curve_data
from irtscots_cl.report.page.drawings import Drawing, bar_chart, ledger_flow, spectrum_chart, zernike_chart
from irtscots_cl.report.page.layers import map_data
from irtscots_cl.report.page.rendering import rendered
from irtscots_cl.report.page.setup import setup_data
from irtscots_cl.report.page.words import (
    repeat_command,
    summary_of_measurement,
    summary_of_result,
    summary_of_run,
    term_name,
)
from irtscots_cl.report.table import Table
from irtscots_cl.report.tables import cautions, summary_tables
from irtscots_cl.report.types import MeasuredFacts, Report
from irtscots_cl.system.atomic_files import write_text

MOST_TERMS = 24  # bars of Zernike terms, the largest
ZERNIKE_CAPTION = "Coefficients in µm in Noll's order, the largest, with their standard errors."
SPECTRUM_CAPTION = "How much of the deviation is at which spatial frequency on the mirror; both scales are logarithmic."
CAPTIONS = {
    "quality": "What the images say of each pixel, the worse of both axes, and why pixels of the mirror are not used.",
    "screen": "Places on the screen that pixels see, their standard error, and how well the series of fringes agree.",
    "slopes": "Slopes less the design's, on one scale.",
    "height": "Height of the surface, and its deviation from the design without piston and tilt.",
}


def write_page(
    path: Path,
    report: Report,
    stack: ImageStack,
    result: Reconstruction,
    comparison: Comparison,
    parts: tuple[ErrorTerm, ...] = (),
    bars: ErrorBars | None = None,
) -> None:
    """Write report.html of a simulated run."""
    predicted = report["predicted"]
    split = [
        ("ray noise (simulation)", predicted["height_ray_noise_nm_rms"], math.nan),
        ("line sampling", predicted["height_line_sampling_nm_rms"], math.nan),
        ("all systematic", predicted["height_systematic_nm_rms"], math.nan),
        ("rounding of the trace", predicted["height_rounding_nm_rms"], math.nan),
        ("all, predicted", predicted["height_error_nm_rms_piston_tilt"], math.nan),
        ("actual", report["height_error_nm_rms"]["piston_tilt"],
         report["height_error_nm_rms_standard_error"]["piston_tilt"]),
    ]  # fmt: skip
    terms = [
        (term_name(row["noll"]), row["input_um"], row["output_um"], row["standard_error_um"])
        for row in report["zernike"] if row["noll"] > 3
    ]  # fmt: skip
    drawings = [
        Drawing("Height error by its parts", bar_chart("Height error in nm rms, piston and tilt removed", split, "nm"),
         "Predicted parts of the height error, their sum, and the actual error: nm rms, piston and tilt removed."),
        Drawing("Zernike terms: put in (grey) and measured (blue)", zernike_chart(_largest(terms)), ZERNIKE_CAPTION),
        Drawing("Spectrum", spectrum_chart(result), SPECTRUM_CAPTION),
        Drawing("Rays", ledger_flow(cast("dict[str, int]", report["ledger"])) if report["ledger"]["launched"] else "",
         "Where the launched rays ended; widths are shares."),
    ]  # fmt: skip
    _write(path, {
        "title": f"{report['scene']}: simulated test", "summary": summary_of_run(report),
        "command": repeat_command(report), "cautions": [*report["warnings"], *cautions(report)],
        "checks": report.get("checks", []), "tables": summary_tables(report), "drawings": drawings,
        "facts": [("device", f"{report['device']['name']} ({report['device']['driver']})"),
                  *((f"version of {name}", value) for name, value in report["versions"].items())],
        "toml": result.nominal.to_toml(),
    }, {"maps": map_data(result, bars, comparison, parts), "curves": curve_data(stack),
        "setup": setup_data(result.nominal)})  # fmt: skip


def write_measured_page(
    path: Path,
    facts: MeasuredFacts,
    result: Reconstruction,
    bars: ErrorBars | None,
    stack: ImageStack | None = None,
    pictures: Sequence[Path] = (),
) -> None:
    """Write report.html of a measurement of a laboratory's images. stack: line scans, or None for other patterns.
    pictures: PNG files that the page takes in."""
    from irtscots_cl.report.measurement_tables import measurement_tables  # a run has none of them

    terms = [
        (term_name(row["noll"]), None, row["output_um"], row["standard_error_um"])
        for row in facts["zernike"] if row["noll"] > 3
    ]  # fmt: skip
    drawings = [Drawing("Zernike terms", zernike_chart(_largest(terms)), ZERNIKE_CAPTION),
                Drawing("Spectrum", spectrum_chart(result), SPECTRUM_CAPTION)]  # fmt: skip
    _write(path, {
        "title": f"{facts['scene']}: measured by {facts['measure']}", "summary": summary_of_measurement(facts),
        "command": "", "cautions": cautions(facts), "checks": facts["checks"], "tables": measurement_tables(facts),
        "drawings": drawings, "facts": [], "toml": result.nominal.to_toml(),
        "pictures": [(picture.stem.replace("_", " "), _text_of(picture.read_bytes()),
                      CAPTIONS.get(picture.stem, "")) for picture in pictures],
    }, {"maps": map_data(result, bars, None, ()), "curves": stack and curve_data(stack),
        "setup": setup_data(result.nominal)})  # fmt: skip


def _largest(terms: list[tuple[str, Any, float, float]]) -> list[tuple[str, Any, float, float]]:
    """The terms with the largest coefficients, in their own order."""
    ranked = sorted(terms, key=lambda term: -max(abs(term[1] or 0.0), abs(term[2]) if math.isfinite(term[2]) else 0.0))
    kept = ranked[:MOST_TERMS]
    return [term for term in terms if term in kept]


def page_of(result: Reconstruction, comparison: Comparison | None = None, stack: ImageStack | None = None) -> str:
    """The text of a page of a result in Python: its maps, light curves of line scans, and the set-up."""
    table = Table("Result", ("", ""), tuple(result.summary().items()))
    return _page({
        "title": f"{result.nominal.name}: measured", "summary": summary_of_result(result), "command": "",
        "cautions": [], "checks": [], "tables": [table], "facts": [], "pictures": [],
        "drawings": [Drawing("Spectrum", spectrum_chart(result), SPECTRUM_CAPTION)],
        "toml": result.nominal.to_toml(),
    }, {"maps": map_data(result, None, comparison, ()), "curves": stack and curve_data(stack),
        "setup": setup_data(result.nominal)})  # fmt: skip


def _write(path: Path, words: dict[str, Any], data: dict[str, Any]) -> None:
    write_text(path, _page(words, data))


def _page(words: dict[str, Any], data: dict[str, Any]) -> str:
    failed = [check for check in words["checks"] if check["level"] != "ok"]
    words |= {"failed": failed, "passed": len(words["checks"]) - len(failed)}
    return rendered("report", words, data, ("maps.js", "setup.js"))


def _text_of(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
