"""The generated part of a document: between two comment lines, replaced or compared."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def with_generated(text: str, tool: str, generated: str) -> str:
    """The document's text with its generated part replaced."""
    begin, end = f"<!-- begin: made by {tool} -->\n", "<!-- end -->\n"
    head, _, rest = text.partition(begin)
    _, _, tail = rest.partition(end)
    if not rest or end not in rest:
        raise SystemExit(f"{tool}: the lines {begin!r} and {end!r} are missing")
    return f"{head}{begin}\n{generated.strip()}\n\n{end}{tail}"


def main(document: str, tool: str, generated: str, description: str) -> int:
    """Write the document's generated part; with --check only compare: 1 where it is out of date."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--check", action="store_true", help=f"exit code 1 where {document} is out of date")
    check = parser.parse_args().check
    path = ROOT / document
    old = path.read_text(encoding="utf-8")
    new = with_generated(old, tool, generated)
    if new == old:
        return 0
    if check:
        print(f"{document} is out of date: run {tool}", file=sys.stderr)
        return 1
    path.write_text(new, encoding="utf-8")
    print(f"{document} written")
    return 0
