"""Grids of nodes, masks and surfaces with known slopes for the tests of integration."""

from __future__ import annotations

import numpy as np


def lines(*text: str) -> np.ndarray:
    """A mask drawn with # for its nodes."""
    return np.array([list(line) for line in text]) == "#"


def disk(rows: int, columns: int) -> np.ndarray:
    v, u = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    return u * u + v * v <= 1


def ring(size: int) -> np.ndarray:
    v, u = np.meshgrid(np.linspace(-1, 1, size), np.linspace(-1, 1, size), indexing="ij")
    return (u * u + v * v <= 1) & (u * u + v * v > 0.2)


ISLANDS = lines("##.#.", "##...", "..##.", "..##.", ".....", "#####")  # a lone node; two that touch by a corner
BRIDGE = np.ones((9, 21), bool)
BRIDGE[:, 10] = False
BRIDGE[4, 10] = True


def sheared_grid(rows: int, columns: int, size_mm: float = 100.0) -> tuple[np.ndarray, np.ndarray]:
    """Smoothly distorted quadrilaterals: every neighbour vector has both components, no two pitches agree."""
    v, u = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    x = u + 0.10 * v + 0.08 * u * u - 0.05 * u * v
    y = v - 0.15 * u + 0.06 * v * v + 0.07 * u * v
    return size_mm / 2 * x, size_mm / 2 * y


def straight_grid(rows: int, columns: int, size_mm: float = 100.0) -> tuple[np.ndarray, np.ndarray]:
    """Straight rows and columns, turned by 0.4 rad, their pitches different and uneven."""
    u, v = (np.linspace(-1, 1, count) + 0.1 * np.sin(3 * np.arange(count)) / count for count in (columns, rows))
    v, u = np.meshgrid(0.7 * v, u, indexing="ij")
    return size_mm / 2 * (np.cos(0.4) * u - np.sin(0.4) * v), size_mm / 2 * (np.sin(0.4) * u + np.cos(0.4) * v)


def polynomial(degree: int, x: np.ndarray, y: np.ndarray, scale_mm: float = 50.0, seed: int = 7):
    """Height [mm] and slopes of a polynomial with all terms up to a total degree, coefficients of about 1."""
    c = np.random.default_rng(seed).normal(size=(degree + 1, degree + 1))
    c[np.add.outer(np.arange(degree + 1), np.arange(degree + 1)) > degree] = 0.0
    u, v = x / scale_mm, y / scale_mm
    of = np.polynomial.polynomial.polyval2d
    slopes = (of(u, v, np.polynomial.polynomial.polyder(c, axis=k)) / scale_mm for k in (0, 1))
    return of(u, v, c), *slopes


def islands_of(mask: np.ndarray) -> set[frozenset[int]]:
    """The nodes of each island, numbered row by row; found by flooding, not by the code under test."""
    number = {tuple(node): k for k, node in enumerate(np.argwhere(mask).tolist())}
    left, found = set(number), set()
    while left:
        front = [left.pop()]
        members = list(front)
        while front:
            r, c = front.pop()
            for node in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
                if node in left:
                    left.remove(node)
                    front.append(node)
                    members.append(node)
        found.add(frozenset(number[node] for node in members))
    return found


def levelled(z: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """z [rows, columns] with zero mean over each island, NaN outside the mask."""
    nodes = z[mask].copy()
    for island in islands_of(mask):
        nodes[list(island)] -= nodes[list(island)].mean()
    result = np.full(mask.shape, np.nan)
    result[mask] = nodes
    return result
