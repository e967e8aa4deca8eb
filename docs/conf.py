"""Sphinx: the documents of this folder as pages, the reference from docstrings. `tools/docs FOLDER` builds them."""

import re

from docutils import nodes
from latex2mathml.converter import convert
from pygments.lexers.special import TextLexer

import irtscots_cl as irt

project = "irtscots-cl"
author = "the authors of irtscots-cl"
version = release = irt.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc"]
exclude_patterns = ["_build"]
html_theme = "alabaster"
html_theme_options = {"description": "SCOTS deflectometry on OpenCL devices", "page_width": "1200px"}
html_sidebars = {"**": ["about.html", "searchfield.html", "navigation.html"]}
html_show_copyright = False
myst_enable_extensions = ["dollarmath"]
html_math_renderer = "mathml"
myst_heading_anchors = 4  # links to headings, as GitHub has them
autodoc_typehints = "none"  # docstrings have units and shapes, which say more
autodoc_member_order = "bysource"
autodoc_class_signature = "separated"
nitpicky = False

CODE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
MARKUP = re.compile(r"([\\*|]|_(?!\w))")  # what reStructuredText would take for its own


def as_restructured(app, what, name, obj, options, lines):
    """Docstrings are plain sentences with `code`, and indented lines of code: rewritten as Sphinx reads them."""
    found, code = [], False
    for line in lines:
        indented = line.startswith("    ")
        if indented and not code:
            found += ["", "::", ""]
        code = indented or (code and not line.strip())
        found.append(line if indented else _plain(line.strip()))
    lines[:] = found


def _plain(line: str) -> str:
    parts = CODE.split(line)  # text, code, text, ...
    return "".join(f"``{part}``" if k % 2 else MARKUP.sub(r"\\\1", part) for k, part in enumerate(parts))


def mathml(display):
    """A visitor that writes an equation as MathML, which browsers show without a script and so without the network."""

    def visit(writer, node):
        writer.body.append(convert(node.astext(), display=display))
        raise nodes.SkipNode

    return visit, None


def setup(app):
    app.add_html_math_renderer("mathml", mathml("inline"), mathml("block"))
    app.add_lexer("mermaid", TextLexer)  # shown as it is written
    app.connect("autodoc-process-docstring", as_restructured)
