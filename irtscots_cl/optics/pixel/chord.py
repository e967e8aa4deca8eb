"""Chords of a disk: the light of an aperture along one direction, integrated over a line."""

from __future__ import annotations

import numpy as np

MIN_HALF_BOX = 1e-3  # in radii: narrower boxes would lose digits in a difference


def chord_cdf(t: np.ndarray) -> np.ndarray:
    """Share of a unit disk's area at x < t: paper Eq. 2, (t sqrt(1 - t^2) + asin t) / pi + 1/2, t cut to [-1, 1]."""
    t = np.clip(t, -1.0, 1.0)
    return 0.5 + (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) / np.pi


def chord_integrals(tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Second antiderivatives in tau, up to a constant, of three quantities of the chord at tau of the unit disk:

    the share of the disk's area below it (paper Eq. 2), and the integrals over the chord of tau^2 and of the square of
    the position along it, times 3/2 (that is (1 - tau^2)^(3/2)). Continued past the disk, where the share is 0 or 1.
    """
    inside = np.clip(tau, -1.0, 1.0)
    beyond = np.abs(tau) - np.abs(inside)
    half2 = 1.0 - inside * inside
    half = np.sqrt(half2)
    arc, cubed = np.arcsin(inside), half * half2
    both, fifth = inside * arc + half, 0.4 * cubed * half2
    along = inside * half
    share = (inside * inside / 2 - 0.25) * arc + along / 4 + (along + arc) / 2
    share = inside * inside / 4 + (share - (along * (2 * half2 + 3) + 3 * arc) / 24) / np.pi
    share += np.where(tau > 0, beyond * (1 + beyond / 2), 0.0)
    square = (both + fifth - cubed / 3) / 4 + np.pi / 8 * beyond
    return share, square, (3 * both - cubed - fifth) / 8 + 3 * np.pi / 16 * beyond
