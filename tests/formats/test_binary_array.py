"""Numbers in binary files."""

import numpy as np
import pytest

from irtscots_cl.formats.binary_array import binary_array


def test_numbers_begin_at_their_byte_and_are_all_there(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"head" + np.arange(6, dtype=">u2").tobytes() + b"more")
    np.testing.assert_array_equal(binary_array(path, np.dtype(">u2"), 4, 2, 3), [[0, 1, 2], [3, 4, 5]])
    with pytest.raises(ValueError, match="12 of 14 bytes at 8: cut off or broken"):
        binary_array(path, np.dtype(">u2"), 8, 1, 7)
