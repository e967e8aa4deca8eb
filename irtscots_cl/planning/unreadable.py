"""A scene file that is refused because of a number in the wrong unit: the number with which it is a test that works."""

from __future__ import annotations

import tomllib
from pathlib import Path

from irtscots_cl.planning.finding import Finding
from irtscots_cl.planning.mistakes import RADII, looks_like, works
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError


def explain(path: Path, error: SceneError) -> list[Finding]:
    """Findings about a TOML file that `load_scene` refuses with this error. Raises the error if nothing explains it."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        radius = float(data["mirror"]["radius_mm"])
    except (OSError, ValueError, KeyError, TypeError):
        raise error from None
    found = []
    for code, factor, what in RADII:
        try:
            scene = Scene.from_dict({**data, "mirror": {**data["mirror"], "radius_mm": radius * factor}}, str(path))
        except ValueError:
            continue
        if works(scene):
            found.append(Finding(code, "error", looks_like("mirror.radius_mm", radius, what, radius * factor)))
    if not found:
        raise error
    return [*found, Finding("scene-refused", "error", str(error))]
