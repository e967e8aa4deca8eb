"""Writes the generated part of docs/architecture.md: folders, imports, modules and kernels, read from the source.

The folders and their order are those of the package's docstring. Imports inside functions count too.
Usage: tools/architecture.py [--check]
"""

from __future__ import annotations

import ast
import re
import sys
from functools import cache
from pathlib import Path

from _generated import ROOT, main

PACKAGE, KERNELS = ROOT / "irtscots_cl", ROOT / "kernels"
TABLE = re.compile(r"^    (\w+) {2,}(.+)$", re.MULTILINE)  # of the folders, in the package's docstring


@cache
def docstring(path: Path) -> str:
    return ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")), clean=False) or ""


def first_sentence(text: str) -> str:
    """The first paragraph up to the first full stop that ends a sentence, fit for a table's cell."""
    paragraph = " ".join(text.strip().split("\n\n")[0].split())
    return re.split(r"(?<=[\w)`\]+][\w)`\]][.]) (?=[A-Za-z])", paragraph)[0].replace("|", "\\|")


def folders() -> dict[str, str]:
    """Folder -> its line in the package's docstring, in order."""
    return dict(TABLE.findall(docstring(PACKAGE / "__init__.py")))


def folder_of(name: str) -> str:
    """The folder of a dotted module name of the package; "" for the package itself."""
    return [*name.split("."), "", ""][1]


def imported_folders(path: Path) -> set[str]:
    """The folders that a file imports from; the package uses absolute imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {folder_of(alias.name) for alias in node.names if alias.name.startswith("irtscots_cl.")}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "irtscots_cl":
            module = node.module or ""
            names = [folder_of(f"{module}.{alias.name}") for alias in node.names]
            found |= {folder_of(module)} if folder_of(module) else set(names)
    return found


def imports() -> dict[str, set[str]]:
    """Folder -> the other folders that its files import from."""
    known = folders()
    graph = {}
    for folder in known:
        found = set().union(*(imported_folders(path) for path in (PACKAGE / folder).rglob("*.py")))
        graph[folder] = (found & known.keys()) - {folder}
    return graph


def reachable(graph: dict[str, set[str]], start: str) -> set[str]:
    """The folders that `start` imports, directly or through others."""
    seen, todo = set(), [*graph[start]]
    while todo:
        name = todo.pop()
        if name not in seen:
            seen.add(name)
            todo += graph[name]
    return seen


def levels(graph: dict[str, set[str]]) -> dict[str, int]:
    """Folder -> its level: 1 without imports, else one more than the highest it imports. Fails on a circle."""
    found: dict[str, int] = {}
    while len(found) < len(graph):
        ready = [name for name, needs in graph.items() if name not in found and needs <= found.keys()]
        if not ready:
            raise SystemExit(f"the folders import in a circle: {sorted(graph.keys() - found.keys())}")
        found |= {name: 1 + max((found[need] for need in graph[name]), default=0) for name in ready}
    return found


def drawing(graph: dict[str, set[str]], level: dict[str, int]) -> str:
    """The imports as a Mermaid drawing, without arrows that a chain of others implies."""
    lines = ["```mermaid", "graph BT"]
    for height in sorted(set(level.values())):
        names = [name for name in graph if level[name] == height]
        lines.append(f'    subgraph level{height}["level {height}"]')
        lines += [f"        {name}" for name in names]
        lines.append("    end")
    lines += [f"    {name} --> {need}" for name, need in direct(graph)]
    return "\n".join([*lines, "```"])


def direct(graph: dict[str, set[str]]) -> list[tuple[str, str]]:
    """The imports that no chain of other imports implies."""
    pairs = []
    for name, needs in graph.items():
        implied = set().union(*(reachable(graph, need) for need in needs)) if needs else set()
        pairs += [(name, need) for need in graph if need in needs - implied]
    return pairs


def counts(graph: dict[str, set[str]], level: dict[str, int]) -> str:
    order = list(graph)
    upward = [(a, b) for a, needs in graph.items() for b in needs if order.index(b) > order.index(a)]
    modules = sum(1 for path in PACKAGE.rglob("*.py") if path.name != "__init__.py")
    arrows = sum(map(len, graph.values()))
    if upward:
        raise SystemExit(f"a folder imports from one below it: {upward}")
    return (
        f"{len(graph)} folders, {modules} modules, {max(level.values())} levels, {arrows} arrows between folders.\n"
        f"The drawing has {len(direct(graph))} of the arrows; the others follow from them. Circles: none. Arrows from "
        "a folder to one below\nit in the table: none."
    )


def folder_table(graph: dict[str, set[str]], level: dict[str, int]) -> str:
    lines = ["| folder | level | content | imports from |", "|---|---|---|---|"]
    for name, text in folders().items():
        needs = ", ".join(need for need in graph if need in graph[name]) or "nothing"
        lines.append(f"| `irtscots_cl/{name}` | {level[name]} | {text} | {needs} |")
    return "\n".join(lines)


def module_tables() -> str:
    parts = []
    for folder, text in folders().items():
        base = PACKAGE / folder
        lines = [f"### {folder}", "", text, "", "| module | content |", "|---|---|"]
        files = sorted(base.rglob("*.py"), key=lambda path: (path.parent != base, path.parent, path.name))
        for path in files:
            if path == base / "__init__.py":
                continue
            shown = path.parent if path.name == "__init__.py" else path
            name = shown.relative_to(base).as_posix() + ("/" if path.name == "__init__.py" else "")
            lines.append(f"| `{name}` | {first_sentence(docstring(path))} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def kernel_tables() -> str:
    parts = []
    for folder in sorted(path for path in KERNELS.iterdir() if path.is_dir()):
        lines = [f"### kernels/{folder.name}", "", "| file | content |", "|---|---|"]
        for path in sorted(folder.glob("*.cl")):
            comment = re.match(r"(?://.*\n)*", path.read_text(encoding="ascii"))[0]
            words = first_sentence(re.sub(r"^// ?", "", comment, flags=re.MULTILINE))
            lines.append(f"| `{path.name}` | {words} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def architecture() -> str:
    graph = imports()
    level = levels(graph)
    return "\n\n".join([
        "## Folders", folder_table(graph, level), "## Imports", counts(graph, level), drawing(graph, level),
        "## Modules", module_tables(), "## Kernels", kernel_tables(),
    ])  # fmt: skip


if __name__ == "__main__":
    sys.exit(main("docs/architecture.md", "tools/architecture.py", architecture(), __doc__.splitlines()[0]))
