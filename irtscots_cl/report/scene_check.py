"""A check of a scene as data for programs and lines for people."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from irtscots_cl.planning.check import SceneCheck
from irtscots_cl.planning.finding import Finding


def finding_data(findings: Iterable[Finding]) -> list[dict[str, str]]:
    """Findings as plain data."""
    return [{"code": one.code, "level": one.level, "text": one.text} for one in findings]


def finding_lines(findings: Iterable[Finding]) -> list[str]:
    """A line for each finding."""
    return [f"{one.level}: {one.code}: {one.text}" for one in findings]


def check_data(found: SceneCheck) -> dict[str, Any]:
    """All of it as plain data."""
    sight = found.sight
    return {
        "scene": sight.scene.name,
        "measured_share": found.measured,
        "mirror_image_px": list(sight.image_px),
        "light_on_screen_px": list(sight.spot_px),
        "findings": finding_data(found.findings),
    }


def check_lines(found: SceneCheck) -> list[str]:
    """A line for each finding, the worst first, and what the whole comes to."""
    sight = found.sight
    detector, screen = sight.scene.camera.detector.pixels, sight.scene.screen.pixels
    image, light = ("{:.0f} x {:.0f}".format(*size) for size in (sight.image_px, sight.spot_px))
    lines = [
        f"{sight.scene.name}: {found.measured:.0%} of the mirror is seen and lit; its image is {image} of "
        f"{detector[0]} x {detector[1]} detector pixels, its light {light} of {screen[0]} x {screen[1]} screen pixels"
    ]
    lines += finding_lines(found.findings)
    bad = [one for one in found.findings if one.level != "info"]
    return [*lines, "nothing wrong found" if not bad else "docs/checks.md explains each code"]
