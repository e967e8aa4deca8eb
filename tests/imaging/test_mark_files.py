"""Tables of marks: TOML and CSV, and what is refused in one line."""

from __future__ import annotations

import pytest

from irtscots_cl.imaging.mark_files import read_marks

HEAD = 'kind = "dot"\nsize_mm = 8\n'
PLACES = {"A": (1, 100), "B": (100, 2), "C": (-100, 3), "D": (4, -110)}
ROWS = "".join(f'[[mark]]\nname = "{name}"\nx_mm = {x}\ny_mm = {y}\n' for name, (x, y) in PLACES.items())
LINES = "".join(f"{name},{x},{y},8\n" for name, (x, y) in PLACES.items())


def written(tmp_path, text, name="marks.toml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_toml_and_csv_say_the_same(tmp_path):
    toml = read_marks(written(tmp_path, HEAD + ROWS), 500.0)
    table = read_marks(written(tmp_path, "name,x_mm,y_mm,size_mm\n" + LINES, "marks.csv"), 500.0)
    assert toml.marks == table.marks and len(toml.marks) == 4
    assert toml.points_mm.tolist() == [list(map(float, place)) for place in PLACES.values()]


def test_a_mark_may_differ_from_the_others(tmp_path):
    own = ROWS + 'kind = "cross"\nwidth_mm = 2.0\nbright = true\n'
    last = read_marks(written(tmp_path, HEAD + own), 500.0).marks[-1]
    assert (last.kind, last.arm_mm, last.bright, last.size_mm) == ("cross", 2.0, True, 8.0)
    assert read_marks(written(tmp_path, HEAD + ROWS), 500.0).marks[0].arm_mm == 8 / 5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a =", "Invalid value"),
        ("", r"no tables \[\[mark\]\]"),
        ("size = 3\n" + ROWS, "size: unknown key; did you mean size_mm"),
        (HEAD + ROWS.replace("x_mm = 1\n", "x = 1\n"), r"mark\.1\.x: unknown key"),
        (HEAD + ROWS.replace("x_mm = 1\n", ""), r"mark\.1\.x_mm: missing"),
        (HEAD + ROWS.replace("x_mm = 1\n", 'x_mm = "1"\n'), r"mark\.1\.x_mm = '1': must be"),
        (HEAD.replace("dot", "blob") + ROWS, r"mark\.1\.kind = 'blob': must be dot or cross"),
        (HEAD + ROWS.replace("x_mm = 100", "x_mm = 900"), "mark B: x_mm, y_mm = 900, 2: must lie on the mirror"),
        (HEAD + ROWS.replace('"B"', '"A"'), "name = 'A': is that of two marks"),
        (HEAD + ROWS[: ROWS.index('[[mark]]\nname = "D"')], "has 3 marks; must have 4 to 1000"),
        (HEAD.replace("8", "150") + ROWS, "marks A and B overlap; must be apart"),
        (
            HEAD + "".join(f'[[mark]]\nname = "{k}"\nx_mm = {50 * k}\ny_mm = {20 * k}\n' for k in range(5)),
            "all marks lie on one line; must spread over the mirror",
        ),
    ],
)
def test_what_is_no_table_of_marks_is_refused(tmp_path, text, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_marks(written(tmp_path, text), 500.0)
    assert str(caught.value).startswith("--fiducials = ") and str(caught.value).isprintable()


def test_broken_csv_and_missing_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match="mark 1: another number of values"):
        read_marks(written(tmp_path, "name,x_mm,y_mm,size_mm\nA,1,1\n", "m.csv"), 500.0)
    with pytest.raises(ValueError, match=r"mark\.3\.x_mm = 'q': must be"):
        read_marks(written(tmp_path, "name,x_mm,y_mm,size_mm\n" + LINES.replace("-100", "q"), "m.csv"), 500.0)
    with pytest.raises(ValueError, match="there is no file of that name"):
        read_marks(tmp_path / "none.toml", 500.0)
    with pytest.raises(ValueError, match="it is a folder"):
        read_marks(tmp_path, 500.0)
