"""Numbers in names of files: gaps, names that do not belong, and numbers that tell nothing."""

import pytest

from irtscots_cl.formats.frame_names import name_gaps


def numbered(form, numbers):
    return [form.format(k) for k in numbers]


@pytest.mark.parametrize(
    "names, missing",
    [
        (numbered("IMG_{}.tif", range(1, 19)), ()),
        (numbered("IMG_{}.tif", [1, 2, 3, 4, 5, 6, 8, 9, 10, 11]), ((6, "IMG_7.tif"),)),
        (numbered("IMG_{:04d}.tif", [3, 4, 7, 8, 9]), ((2, "IMG_0005.tif"), (3, "IMG_0006.tif"))),
        (numbered("scan 2026 x{}.fits", [10, 20, 40, 50, 60]), ((2, "scan 2026 x30.fits"),)),
        (
            [f"img_{a}_{b}.tif" for a in (1, 2, 10) for b in range(4) if (a, b) != (2, 3)],
            ((7, "img_2_3.tif"),),
        ),
        ([f"p{p}_step{s:03d}.png" for p in (9, 24) for s in (0, 90, 180, 270) if (p, s) != (24, 0)],
         ((4, "p24_step000.png"),)),
        (numbered("2026-11-29T{}.tif", [101502, 101507, 101513, 101520]), ()),
        ([f"{a}_{b}.tif" for a, b in enumerate((913, 17, 555, 8))], ()),
        (["a.tif", "b.tif", "c.tif"], ()),
        (["1.tif", "5.tif"], ()),
        (["a1.tif", "a01.tif", "a2.tif", "a3.tif"], ()),
        ([], ()),
    ],
)  # fmt: skip
def test_numbers_that_are_missing_are_named_with_their_place(names, missing):
    assert name_gaps(names).missing == missing


def test_names_of_another_form_are_odd():
    found = name_gaps([*numbered("IMG_{}.tif", [1, 2, 4]), "IMG_2 (copy).tif", "reference.tif"])
    assert found.odd == ("IMG_2 (copy).tif", "reference.tif") and found.missing == ((2, "IMG_3.tif"),)
    assert name_gaps(["a1.tif", "a2.tif", "b.tif", "c.tif"]).odd == ()  # no form is that of most


def test_the_first_number_is_known_where_names_are_counted():
    assert name_gaps(numbered("IMG_{}.tif", range(2, 9))).first == 2
    assert name_gaps([f"img_{a}_{b}.tif" for a in (1, 2) for b in range(4)]).first is None
