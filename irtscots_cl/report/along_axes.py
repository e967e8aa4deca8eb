"""A number along each of two axes, in facts named as in report.json."""

from typing import TypedDict


class AlongAxes(TypedDict):
    """A number along x and along y, of the screen or of the mirror as the key says."""

    x: float
    y: float
