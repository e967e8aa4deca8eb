"""How objects show themselves: one line in a console, a table in a notebook. Both say what `summary()` says."""

from __future__ import annotations

from html import escape
from typing import Protocol


class Summarised(Protocol):
    """An object that can say in few words what it is."""

    def summary(self) -> dict[str, str]:
        """Names and values, for people."""
        ...


def one_line(self: Summarised) -> str:
    """For __repr__: the class and its summary, in brackets."""
    return f"<{type(self).__name__}: {'; '.join(f'{name} {text}' for name, text in self.summary().items())}>"


def html_table(self: Summarised) -> str:
    """For _repr_html_, which notebooks show."""
    rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in self.summary().items())
    return f"<table><caption>{escape(type(self).__name__)}</caption><tbody>{rows}</tbody></table>"
