"""What averaging leaves of an error: more exposures, and the mirror turned about its axis between measurements.

Errors that stay with the instrument turn against the mirror. Their mean over N equal turns keeps, of each angular order
m (cos m t, sin m t), all where m is a multiple of N, and nothing of the others (R. E. Parks, Appl. Opt. 17 (1978) 3241;
C. J. Evans, R. N. Kestner, Appl. Opt. 35 (1996) 1015).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.zernike.indices import noll_to_nm


def left_by_turns(nolls: Sequence[int], turns: int) -> FloatArray:
    """Share [terms] of each Noll term of an instrument's error that is left in the mean over equal turns.

    Raises ValueError for less than one turn.
    """
    if turns < 1:
        raise ValueError(f"turns = {turns}: must be at least 1")
    return np.array([float(noll_to_nm(noll)[1] % turns == 0) for noll in nolls])


def left_by_exposures(exposures: int) -> float:
    """Share of a process's rms that is left in the mean of so many independent exposures."""
    if exposures < 1:
        raise ValueError(f"exposures = {exposures}: must be at least 1")
    return float(exposures**-0.5)
