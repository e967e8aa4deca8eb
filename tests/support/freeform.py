"""Mirrors with polynomials in x and y and annular Zernike terms, and their heights written from the definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from lopsided import lopsided
from scipy.special import eval_legendre

from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.polynomial import Polynomial
from irtscots_cl.scene.presets import load_scene

RIM_MM = 532.0
DESIGN = Polynomial("legendre", (560.0, 540.0), (-8.0, 3.0), part="design",
                    coefficients_um=((2, 0, 900.0), (1, 1, -700.0), (0, 3, 400.0), (3, 2, 150.0)))  # fmt: skip
CHEBYSHEV = Polynomial("chebyshev", (540.0, 532.0), coefficients_um=((2, 0, 0.4), (5, 3, -0.3), (0, 7, 0.2)))
MONOMIAL = Polynomial("monomial", centre_mm=(20.0, -10.0), coefficients_mm=((3, 0, 3e-12), (1, 2, -4e-12)))
ANNULAR = (
    ZernikeTerms(RIM_MM, "noll", {6: 0.3, 8: -0.2, 11: 0.15, 22: 0.1, 33: -0.05}, obscuration=0.25),
    ZernikeTerms(600.0, "fringe", {4: 0.1, 12: 0.1, 10: -0.1}),
)


def freeform() -> Scene:
    """The paper's sphere with a hole, a design of 1 mm of sag, and deviations of every kind in several tables."""
    scene = load_scene("sphere")
    mirror = replace(scene.mirror, obscuration_mm=266.0, zernike=ANNULAR, polynomial=(DESIGN, CHEBYSHEV, MONOMIAL))
    return replace(scene, name="freeform", mirror=mirror)


def lopsided_freeform() -> Scene:
    """The lop-sided scene, its mirror with a design and deviations of polynomials and annular terms on two disks."""
    scene = lopsided()
    polynomial = (
        Polynomial("legendre", (170.0, 200.0), coefficients_um=((2, 1, 3.0), (0, 4, -1.5), (7, 0, 0.2)), part="design"),
        Polynomial("chebyshev", (190.0, 180.0), (5.0, -4.0), coefficients_um=((1, 3, 1.0), (4, 4, 0.1))),
    )
    zernike = (
        *scene.mirror.zernike[1:],
        ZernikeTerms(165.0, "noll", {5: -2.0, 12: 0.3, 231: 0.01}, obscuration=0.2),
    )
    return replace(
        scene, name="lopsided-freeform", mirror=replace(scene.mirror, polynomial=polynomial, zernike=zernike)
    )


def basis(kind: str, n: int, t):
    """B_n(t) and its derivative, |t| < 1, by closed forms that the package does not use."""
    if kind == "chebyshev":
        angle = np.arccos(t)
        return np.cos(n * angle), n * np.sin(n * angle) / np.sin(angle)
    if kind == "legendre":
        slope = n * (t * eval_legendre(n, t) - eval_legendre(n - 1, t)) / (t * t - 1) if n else 0 * t
        return eval_legendre(n, t), slope
    return t**n, n * t ** (n - 1) if n else 0 * t


def polynomial_height(table: Polynomial, x, y):
    """Height [mm] and slopes of one table at (x, y) [mm], term by term."""
    (cx, cy), (hx, hy) = table.centre_mm, table.half_size_mm or (1.0, 1.0)
    terms, unit = (table.coefficients_um, 1e-3) if table.coefficients_um else (table.coefficients_mm, 1.0)
    total = np.zeros((3, *np.shape(x)))
    for i, j, value in terms:
        (a, da), (b, db) = basis(table.basis, i, (x - cx) / hx), basis(table.basis, j, (y - cy) / hy)
        total += value * unit * np.array([a * b, da * b / hx, a * db / hy])
    return total
