"""A page from its template, its script, and the arrays that it shows."""

from __future__ import annotations

import json
import re
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from irtscots_cl.system.atomic_files import plain

if TYPE_CHECKING:
    from jinja2 import Template


def template(name: str, escape: bool = True) -> Template:
    """A file of templates/, with the ones that it takes in. escape: whether texts are put in as HTML."""
    import jinja2

    folder = files("irtscots_cl.report") / "templates"
    loader = jinja2.FunctionLoader(lambda part: (folder / part).read_text(encoding="utf-8"))
    environment = jinja2.Environment(loader=loader, autoescape=escape, trim_blocks=True, lstrip_blocks=True)
    environment.filters["signs"] = with_signs
    return environment.get_template(name)


def with_signs(text: str) -> str:
    """A text of the terminal, which is ASCII, with the signs of print: µm, µrad, ± (one code point each)."""
    return re.sub(r"\bu(?=(m|rad)\b)", "µ", text).replace("+- ", "± ")


def rendered(name: str, words: dict[str, Any], data: dict[str, Any], scripts: tuple[str, ...] = ("maps.js",)) -> str:
    """The text of templates/NAME.html with report.css, scripts, NAME.js, and data as JSON in it.

    words: what the template names, `title` among them.
    """
    folder = files("irtscots_cl.report") / "templates"
    css, *js = ((folder / part).read_text(encoding="utf-8") for part in ("report.css", *scripts, f"{name}.js"))
    # "</" would end the script element
    text = json.dumps(plain(data), allow_nan=False, separators=(",", ":")).replace("</", "<\\/")
    return template(f"{name}.html").render(**words, data=text, css=css, js="\n".join(js))
