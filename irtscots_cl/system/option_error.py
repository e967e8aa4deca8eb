"""Arguments that are refused: an error names the parameter in Python, and the option on the command line."""

from __future__ import annotations

import re

OPTION = re.compile(r"--(no-)?([a-z][a-z0-9-]*)")


class OptionError(ValueError):
    """An argument that is refused. Its text is written with the command line's options, as in --rays-per-pixel = 3;
    str() names the parameters, rays_per_pixel = 3, and the command line prints `on_command_line`."""

    @property
    def on_command_line(self) -> str:
        return str(self.args[0])

    def __str__(self) -> str:
        return OPTION.sub(lambda found: found[2].replace("-", "_") + (" = False" if found[1] else ""), self.args[0])


def on_command_line(error: object) -> str:
    """What an error says to a user of the command line."""
    return error.on_command_line if isinstance(error, OptionError) else str(error)
