"""Draws docs/pictures/report-phone.png, -laptop.png and -print.png: report.html of a real run in Debian's chromium.

Checks the page's accessibility with axe in all three sizes. Prints when the page was ready and how large it is. Exit
code 1 for serious or critical findings, for a page wider than its window, or for a picture of more than 150 kB.

Usage: tools/screenshots.py [--scene SCENE] [--report FILE] [--out DIR]
"""

from __future__ import annotations

import argparse
import io
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

from irtscots_cl.cli import main as irtscots

ROOT = Path(__file__).resolve().parents[1]
MOST_BYTES = 150_000
COLOURS = 256  # of a picture's palette
# name: width, height in CSS pixels, medium; print: A4 at 96 dots per inch within margins of 1 cm
SIZES = {"phone": (390, 844, "screen"), "laptop": (1440, 900, "screen"), "print": (718, 1047, "print")}
ARGUMENTS = ("--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
GRAVE = ("serious", "critical")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default="sphere-deviated", help="preset or TOML file; default sphere-deviated")
    parser.add_argument("--report", type=Path, metavar="FILE", help="of a finished run, in place of a new one")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "pictures", metavar="DIR")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        report = options.report
        if report is None:
            if irtscots(["run", options.scene, "--parts", "--no-figures", "--out", folder]) != 0:
                return 1
            report = Path(folder) / "report.html"
        print(f"{report.name}: {report.stat().st_size / 1e6:.2f} MB")
        faults = [fault for name in SIZES for fault in shown(report, name, options.out / f"report-{name}.png")]
    for fault in faults:
        print(fault, file=sys.stderr)
    return 1 if faults else 0


def shown(report: Path, name: str, picture: Path) -> list[str]:
    """Write the picture of a size; what is wrong with the page or with the picture."""
    from axe_playwright_python.sync_playwright import Axe
    from playwright.sync_api import sync_playwright

    width, height, medium = SIZES[name]
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=list(ARGUMENTS))
        page = browser.new_page(viewport={"width": width, "height": height})
        page.emulate_media(media=medium)
        page.goto(report.resolve().as_uri())
        page.wait_for_selector("html[data-ready=yes]")
        ready = page.evaluate("performance.now()") / 1000
        wide = page.evaluate("document.documentElement.scrollWidth")
        size = store(page.screenshot(), picture)
        found = Axe().run(page).response["violations"]
        browser.close()
    print(f"{picture.name}: {size / 1e3:.0f} kB; ready after {ready:.2f} s; {len(found)} findings of axe, all impacts")
    faults = [f"{name}: {text}" for text in grave(found)]
    faults += [f"{name}: {wide} pixels wide; must be at most {width}"] * (wide > width)
    faults += [f"{picture}: {size} bytes; must be at most {MOST_BYTES}"] * (size > MOST_BYTES)
    return faults


def grave(found: list[dict[str, Any]]) -> list[str]:
    """Axe's serious and critical findings, a line each."""
    return [f"{one['impact']}: {one['id']}: {one['help']}" for one in found if one["impact"] in GRAVE]


def store(png: bytes, picture: Path) -> int:
    """Write a PNG file of few colours; its bytes."""
    with Image.open(io.BytesIO(png)) as image:
        few = image.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
        few.save(picture, optimize=True)
    return picture.stat().st_size


if __name__ == "__main__":
    raise SystemExit(main())
