"""A lens's distortion: Brown's polynomial with the rational term, as OpenCV orders and defines it.

Points are normalised: image coordinates over the image distance. The functions use plain arithmetic only, so that they
take numbers (a scene is checked without NumPy) and arrays alike. Source: OpenCV, "Camera Calibration and 3D
Reconstruction", the detailed description of the pinhole model; D. C. Brown, Photogramm. Eng. 37 (1971) 855.
"""

from __future__ import annotations

from typing import Any

COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
Coefficients = tuple[float, ...]


def full(coefficients: Coefficients) -> Coefficients:
    """The eight coefficients, with zeros for those that are not given."""
    return (*coefficients, *(0.0,) * (len(COEFFICIENTS) - len(coefficients)))


def flipped(coefficients: Coefficients) -> Coefficients:
    """The eight coefficients for an image whose y axis points the other way: p1 changes its sign."""
    k1, k2, p1, p2, *others = full(coefficients)
    return (k1, k2, -p1, p2, *others)


def distort(x: Any, y: Any, coefficients: Coefficients) -> tuple[Any, Any]:
    """Where the lens puts the normalised points (x, y) of a perfect one."""
    p1, p2 = coefficients[2], coefficients[3]
    r2 = x * x + y * y
    radial = _radial(r2, coefficients)[0]
    return (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )


def distortion_matrix(x: Any, y: Any, coefficients: Coefficients) -> tuple[Any, Any, Any]:
    """Derivatives (xx, xy, yy) of the distorted point at (x, y): d x'/dx, d x'/dy = d y'/dx, d y'/dy."""
    p1, p2 = coefficients[2], coefficients[3]
    radial, by_r2 = _radial(x * x + y * y, coefficients)
    xx = radial + 2 * x * x * by_r2 + 2 * p1 * y + 6 * p2 * x
    xy = 2 * x * y * by_r2 + 2 * p1 * x + 2 * p2 * y
    yy = radial + 2 * y * y * by_r2 + 6 * p1 * y + 2 * p2 * x
    return xx, xy, yy


def towards(x: Any, y: Any, goal_x: Any, goal_y: Any, coefficients: Coefficients) -> tuple[Any, Any, Any]:
    """One Newton step from (x, y) to the point that distortion moves to the goal: the new x, y and the determinant."""
    at_x, at_y = distort(x, y, coefficients)
    xx, xy, yy = distortion_matrix(x, y, coefficients)
    determinant = xx * yy - xy * xy
    left_x, left_y = goal_x - at_x, goal_y - at_y
    return (
        x + (yy * left_x - xy * left_y) / determinant,
        y + (xx * left_y - xy * left_x) / determinant,
        determinant,
    )


def _radial(r2: Any, coefficients: Coefficients) -> tuple[Any, Any]:
    """The radial factor and its derivative by r^2."""
    k1, k2, _, _, k3, k4, k5, k6 = coefficients
    above, below = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    rise_above, rise_below = k1 + r2 * (2 * k2 + 3 * r2 * k3), k4 + r2 * (2 * k5 + 3 * r2 * k6)
    return above / below, (rise_above * below - above * rise_below) / (below * below)
