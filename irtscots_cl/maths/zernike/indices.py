"""Numbering of Zernike polynomials: Noll, Fringe and OSA indices to radial order n and azimuthal order m, and back."""

from __future__ import annotations

import math
import operator

ORDERINGS = ("noll", "fringe", "osa")
_FIRST_INDEX = {"noll": 1, "fringe": 1, "osa": 0}


def index_to_nm(j: int, ordering: str) -> tuple[int, int]:
    """Radial order n and azimuthal order m (m > 0 cosine, m < 0 sine) of term ``j``.

    ``ordering`` is "noll" (from 1), "fringe" (University of Arizona, from 1) or "osa" (OSA/ANSI, from 0).
    The fringe numbering is the regular one: the term (12, 0), printed last in many 37-term lists, is 49 here.

    Raises ValueError if the ordering is unknown or ``j`` is not an integer at or above the ordering's first.
    """
    _check_ordering(ordering)
    j = _integer(j, "Zernike index")
    if j < _FIRST_INDEX[ordering]:
        raise ValueError(f"Zernike index {j} is below the first {ordering} index, {_FIRST_INDEX[ordering]}")
    if ordering == "fringe":
        return _fringe_to_nm(j)
    position = j - _FIRST_INDEX[ordering]
    n = (math.isqrt(8 * position + 1) - 1) // 2
    within = position - n * (n + 1) // 2
    if ordering == "osa":
        return n, 2 * within - n
    m = n % 2 + 2 * ((within + 1 - n % 2) // 2)
    return n, m if j % 2 == 0 else -m


def nm_to_index(n: int, m: int, ordering: str) -> int:
    """Index of the term of radial order ``n`` and azimuthal order ``m``; the inverse of `index_to_nm`.

    Raises ValueError if the ordering is unknown or there is no polynomial (n, m).
    """
    _check_ordering(ordering)
    n, m = checked_nm(n, m)
    if ordering == "osa":
        return (n * (n + 2) + m) // 2
    if ordering == "fringe":
        return (1 + (n + abs(m)) // 2) ** 2 - 2 * abs(m) + (m < 0)
    lower = n * (n + 1) // 2 + abs(m)
    if m == 0:
        return lower + 1
    # Noll gives the even one of the pair's two indices to the cosine.
    return lower + ((lower % 2 == 0) == (m < 0))


def noll_to_nm(j: int) -> tuple[int, int]:
    """`index_to_nm` for the Noll numbering, ``j`` from 1."""
    return index_to_nm(j, "noll")


def nm_to_noll(n: int, m: int) -> int:
    """`nm_to_index` for the Noll numbering."""
    return nm_to_index(n, m, "noll")


def fringe_to_nm(j: int) -> tuple[int, int]:
    """`index_to_nm` for the University of Arizona fringe numbering, ``j`` from 1."""
    return index_to_nm(j, "fringe")


def nm_to_fringe(n: int, m: int) -> int:
    """`nm_to_index` for the University of Arizona fringe numbering."""
    return nm_to_index(n, m, "fringe")


def osa_to_nm(j: int) -> tuple[int, int]:
    """`index_to_nm` for the OSA/ANSI numbering, ``j`` from 0."""
    return index_to_nm(j, "osa")


def nm_to_osa(n: int, m: int) -> int:
    """`nm_to_index` for the OSA/ANSI numbering."""
    return nm_to_index(n, m, "osa")


def _check_ordering(ordering: str) -> None:
    if ordering not in ORDERINGS:
        raise ValueError(f"unknown Zernike ordering {ordering!r}; allowed: {', '.join(ORDERINGS)}")


def _integer(value: int, name: str) -> int:
    try:
        return operator.index(value)
    except TypeError:
        raise ValueError(f"{name} must be an integer, got {value!r}") from None


def checked_nm(n: int, m: int) -> tuple[int, int]:
    n, m = _integer(n, "Zernike order n"), _integer(m, "Zernike order m")
    if abs(m) > n or (n - m) % 2:
        raise ValueError(f"no Zernike term (n, m) = ({n}, {m}): |m| <= n and n - m even are needed")
    return n, m


def _fringe_to_nm(j: int) -> tuple[int, int]:
    # Fringe groups share half = (n + |m|)/2, end at the square (half + 1)^2 and step |m| down to 0.
    half = math.isqrt(j - 1)
    behind = (half + 1) ** 2 - j
    m = (behind + 1) // 2
    return 2 * half - m, m if behind % 2 == 0 else -m
