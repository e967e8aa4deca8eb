"""A number along each of two axes, in facts named as in report.json."""

from typing import TypedDict


class AlongAxes(TypedDict):
    """A number along the screen's x and along its y."""

    x: float
    y: float
