"""One frame of a measurement as its manifest tells it: what the screen shows, in words, as a table and back.

| shows | keys, beside picture and image |
|---|---|
| dark, white | none |
| fringes | axis, periods, step_deg |
| line | axis, first_px, width_px: the lit pixels from first_px on, in fractions of them too |
| gray | axis, cells, bit, inverted: a plane of a Gray code (imaging.gray_code) |
| dots | pitch_px, diameter_px, first_px = [x, y]: a grid of dots (imaging.dots) |
| picture | none: the picture's file says all |
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from irtscots_cl.scene.validation import nearest, shown_word

DARK, WHITE, FRINGES, LINE, GRAY, DOTS, PICTURE = "dark", "white", "fringes", "line", "gray", "dots", "picture"
KEYS: dict[str, tuple[str, ...]] = {
    DARK: (),
    WHITE: (),
    FRINGES: ("axis", "periods", "step_deg"),
    LINE: ("axis", "first_px", "width_px"),
    GRAY: ("axis", "cells", "bit", "inverted"),
    DOTS: ("pitch_px", "diameter_px", "first_px"),
    PICTURE: (),
}
SHOWS = tuple(KEYS)
_FILES = ("picture", "image")
_ALL = ("shows", *_FILES, *dict.fromkeys(key for keys in KEYS.values() for key in keys))
MAX_BIT = 31


@dataclass(frozen=True)
class ShownFrame:
    """One frame. shows: of SHOWS; the other values: of the kinds that KEYS names them for. picture: file for the
    screen. image: the camera's file, "" where the manifest's `images` tells.

    first_px: (x, y) for dots, the centre of the first one; (first lit pixel, 0) for a line. Pixels are counted from the
    outer edge of the screen's first column or row: the first pixel is from 0 to 1. bit: 0 the coarsest.
    """

    shows: str
    axis: str = ""
    periods: float = 0.0
    step_deg: float = 0.0
    picture: str = ""
    image: str = ""
    first_px: tuple[float, float] = (0.0, 0.0)
    width_px: float = 0.0
    cells: float = 0.0
    bit: int = 0
    inverted: bool = False
    pitch_px: float = 0.0
    diameter_px: float = 0.0

    @property
    def text(self) -> str:
        """What the frame shows, in words."""
        if self.shows == FRINGES:
            return f"{self.axis} fringes of {self.periods:g} periods at {self.step_deg:g} degrees"
        if self.shows == LINE:
            return f"a line of the {self.axis} scan from pixel {self.first_px[0]:g} on"
        if self.shows == GRAY:
            return f"plane {self.bit}{', inverted,' if self.inverted else ''} of the {self.axis} Gray code"
        if self.shows == DOTS:
            return "dots from pixel ({:g}, {:g}) on".format(*self.first_px)
        return self.shows if self.shows != PICTURE else f"picture {self.picture}"

    @property
    def file_stem(self) -> str:
        """What the frame shows as a part of a file's name."""
        if self.shows == FRINGES:
            return f"{self.axis}-{self.periods:g}-{self.step_deg:.6g}"
        if self.shows == LINE:
            return f"{self.axis}-line-{self.first_px[0]:.6g}"
        if self.shows == GRAY:
            return f"{self.axis}-gray-{self.bit}{'-inverted' if self.inverted else ''}"
        if self.shows == DOTS:
            return "dots-{:.6g}-{:.6g}".format(*self.first_px)
        return self.shows


def quoted(text: str) -> str:
    """A string of TOML, which is one of JSON but for characters that JSON cannot hold."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def told(value: Any) -> str:
    """A value of a file for a message."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def check_known(table: dict[str, Any], keys: tuple[str, ...], where: str) -> None:
    """Raise ValueError for a key that is none of the keys."""
    for key in table:
        if key not in keys:
            raise ValueError(f"{where}{shown_word(key)}: unknown key; {nearest(key, keys)}")


def frame_line(frame: ShownFrame) -> str:
    """A frame as an inline table of TOML."""
    parts = [f"picture = {quoted(frame.picture)}", f"shows = {quoted(frame.shows)}"]
    for key in KEYS[frame.shows]:
        value = getattr(frame, key)
        if isinstance(value, bool):
            text = str(value).lower()
        elif isinstance(value, str):
            text = f'"{value}"'
        elif key == "first_px":
            text = repr(list(value)) if frame.shows == DOTS else repr(value[0])
        else:
            text = repr(value)
        parts.append(f"{key} = {text}")
    if frame.image:
        parts.append(f"image = {quoted(frame.image)}")
    return "{ " + ", ".join(parts) + " }"


def frame_of(where: str, table: Any) -> ShownFrame:
    """The frame of a table. where: its name in messages. Raises ValueError for what is missing or not allowed."""
    if not isinstance(table, dict):
        raise ValueError(f"{where} = {told(table)}: must be a table")
    check_known(table, _ALL, f"{where}.")
    shows = table.get("shows")
    if not isinstance(shows, str) or shows not in SHOWS:
        raise ValueError(f"{where}.shows = {told(shows)}: must be one of {', '.join(SHOWS)}")
    for key in _FILES:
        if not isinstance(table.get(key, ""), str):
            raise ValueError(f"{where}.{key} = {told(table[key])}: must be the name of a file")
    wrong = next((key for key in table if key not in ("shows", *_FILES, *KEYS[shows])), None)
    if wrong:
        raise ValueError(f"{where}.{wrong}: must be left out of a frame that shows {shows}")
    found: dict[str, Any] = {key: table.get(key, "") for key in _FILES}
    for key in KEYS[shows]:
        found[key] = _value(f"{where}.{key}", key, table.get(key), shows)
    return ShownFrame(shows, **found)


def _value(where: str, key: str, value: Any, shows: str) -> Any:
    if key == "axis":
        if value not in ("x", "y"):
            raise ValueError(f'{where} = {told(value)}: must be "x" or "y"')
        return str(value)
    if key == "inverted":
        if value is not None and type(value) is not bool:
            raise ValueError(f"{where} = {told(value)}: must be true or false")
        return bool(value)
    if key == "bit":
        if type(value) is not int or not 0 <= value <= MAX_BIT:
            raise ValueError(f"{where} = {told(value)}: must be a whole number from 0 to {MAX_BIT}")
        return value
    if key == "first_px" and shows == DOTS:
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError(f"{where} = {told(value)}: must be [x, y]")
        return tuple(_number(where, one) for one in value)
    number = _number(where, value)
    if key in ("width_px", "cells", "pitch_px", "diameter_px") and not number > 0:
        raise ValueError(f"{where} = {told(value)}: must be above 0")
    return (number, 0.0) if key == "first_px" else number


def _number(where: str, value: Any) -> float:
    if type(value) not in (int, float) or not abs(value) < 1e9:
        raise ValueError(f"{where} = {told(value)}: must be a number below 1e9")
    return float(value)
