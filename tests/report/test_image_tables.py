"""The table of how images were read and what was known about the camera."""

import math

from irtscots_cl.report.image_tables import image_tables


def test_what_is_known_is_told_and_nothing_else():
    facts = {
        "images": {"frames": 18, "files": 1, "bits": 12, "saturation": 4095.0, "notes": ["a.ser: byte order big"]},
        "camera": {
            "images_per_frame": 2, "exposures_s": [0.25, 2.0], "averaged": {"dark": 16, "flat": 1},
            "counts": {"dark": 120.51, "flat": 2500.0}, "standard_error": {"dark": 0.25, "flat": math.nan},
            "bad_pixels": 7, "dead_pixels": 2,
        },
    }  # fmt: skip
    (table,) = image_tables(facts)
    assert table.rows == [
        ("images, files", "18, 1"),
        ("bits of a sample", "12"),
        ("saturated from", "4095 counts"),
        ("reading", "a.ser: byte order big"),
        ("dark frames", "16, 120.51 +- 0.25 counts"),
        ("flat frames", "1, 2500 counts"),
        ("images of each frame", "2 of 0.25, 2 s"),
        ("bad pixels", "7, 2 of them by the flat frames"),
    ]
    facts["images"] |= {"bits": 0, "saturation": None, "notes": []}
    del facts["camera"]
    assert image_tables(facts)[0].rows[1:] == [("bits of a sample", "floating point"), ("saturated from", "not known")]
    assert image_tables({}) == []
