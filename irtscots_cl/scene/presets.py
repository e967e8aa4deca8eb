"""The scenes that ship with the package; loads a scene by preset name or from a TOML file."""

from __future__ import annotations

import dataclasses
import os
from importlib import resources
from typing import TYPE_CHECKING, Any

from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import nearest, problem

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

MAX_FILE_BYTES = 2**20
UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")


def _folder() -> Traversable:
    return resources.files(__package__).joinpath("preset_scenes")


PATH_TOO = ", or a path that ends in .toml"  # of load_scene


def preset_names() -> list[str]:
    """The names that `load_scene` knows, in alphabetical order."""
    names = (file.name for file in _folder().iterdir())
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def sequential_presets() -> list[str]:
    """The names of the presets that every estimator can trace completely."""
    return [name for name in preset_names() if load_scene(name).is_sequential]


def preset_text(name: str, otherwise: str = "") -> str:
    """TOML text of a preset, comments included. Raises SceneError for a name that is not in `preset_names()`.

    otherwise: what may be given in its place, for the message.
    """
    names = preset_names()
    if name not in names:  # so that no name can leave the folder
        hint = nearest(str(name), names)
        known = f"allowed: {', '.join(names)}"
        hint = known if hint == known else f"{hint} {known}"
        raise problem(str(name)[:100] or "''", (), f"unknown scene; {hint}{otherwise}")
    return _folder().joinpath(f"{name}.toml").read_text(encoding="utf-8")


def load_scene(name_or_path: str | os.PathLike[str]) -> Scene:
    """The scene of a preset or a TOML file. A string with a path separator or ending in .toml is a path.

    Raises SceneError for an unknown name, an unreadable file, or an invalid value in it.
    """
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise problem("scene", (), "must be a preset name or the path of a TOML file", name_or_path)
    source = os.fsdecode(name_or_path)
    is_name = isinstance(name_or_path, str) and not _is_path(source)
    data = preset_text(source, PATH_TOO + _taken_for_a_name(source)).encode("utf-8") if is_name else _read(source)
    return Scene.from_dict(_parse(data, source), source)


def _taken_for_a_name(source: str) -> str:
    """Why what is there was not read: a text without .toml and / is the name of a preset."""
    if source in ("", ".", "..") or "\0" in source or not os.path.exists(source):
        return ""
    return f"; {source} is a folder" if os.path.isdir(source) else f"; write ./{source} for the file of that name"


def with_noise_file(scene: Scene, path: str | os.PathLike[str]) -> Scene:
    """The scene with the tables [camera.detector.noise] and [screen.response] of a TOML file that has nothing else.

    A table of the file takes the place of the scene's own; one that the file lacks stays as it is in the scene. Raises
    SceneError for an unreadable file, one with neither table, or an invalid value.
    """
    from irtscots_cl.scene.optional_tables import noise_from_file  # imported late: few runs need it

    source = os.fsdecode(path)
    noise, response = noise_from_file(_parse(_read(source), source), source)
    if noise is not None:
        detector = dataclasses.replace(scene.camera.detector, noise=noise)
        scene = dataclasses.replace(scene, camera=dataclasses.replace(scene.camera, detector=detector))
    if response is not None:
        scene = dataclasses.replace(scene, screen=dataclasses.replace(scene.screen, response=response))
    return scene


def parse_scene(text: str, source: str = "scene") -> Scene:
    """The scene of TOML text. Raises SceneError; its message names `source` as the origin of the text."""
    return Scene.from_dict(_parse(text.encode("utf-8"), source), source)


def _is_path(text: str) -> bool:
    separators = [os.sep, *([os.altsep] if os.altsep else [])]
    return text.lower().endswith(".toml") or any(separator in text for separator in separators)


def _read(path: str) -> bytes:
    """The file's content. Its size is limited, so that a wrong argument cannot fill the memory."""
    try:
        with open(path, "rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise problem(path, (), f"cannot be read: {error.strerror or type(error).__name__}") from None
    except ValueError:  # a null character or a lone surrogate in the name
        raise problem(path, (), "cannot be read: no file can have this name") from None
    if len(data) > MAX_FILE_BYTES:
        raise problem(path, (), f"is too large; a scene file has at most {MAX_FILE_BYTES} bytes")
    return data


def _parse(data: bytes, source: str) -> dict[str, Any]:
    import tomllib  # imported late: listing the presets does not need it

    try:
        return tomllib.loads(data.decode("utf-8-sig"))  # without the byte-order mark that some editors write
    except UnicodeDecodeError as error:
        if data.startswith(UTF16_MARKS):
            raise problem(source, (), "is UTF-16 text; a scene is a TOML file, which must be UTF-8") from None
        raise problem(source, (), f"is not UTF-8 text (byte {error.start}); a scene is a TOML file") from None
    except RecursionError:
        raise problem(source, (), "is not valid TOML: nested too deep") from None
    except ValueError as error:  # TOMLDecodeError, and int() for thousands of digits
        reason = "".join(c if c.isprintable() else " " for c in str(error))[:200]
        raise problem(source, (), f"is not valid TOML: {reason}") from None
