"""Whether there are as many images as a manifest has frames; where not, which are missing, by their names."""

from __future__ import annotations

from pathlib import PurePath

from irtscots_cl.formats.frame_names import NameGaps, name_gaps
from irtscots_cl.formats.images import FrameSource
from irtscots_cl.imaging.fringe_manifest import FringeManifest

SHOWN = 4  # names in a message


def check_count(frames: FrameSource, manifest: FringeManifest, images_of_frame: int, where: str) -> None:
    """Raise ValueError, with one line, for too few or too many images. where: they are, for the message."""
    wanted, found = len(manifest.frames) * images_of_frame, len(frames)
    if found == wanted:
        return
    asked = f"{manifest.path} has {len(manifest.frames)} frames"
    asked += f" of {images_of_frame} images each, {wanted} in all" if images_of_frame > 1 else ""
    names = [file.path.name for file in frames.files]
    one_each = len(names) == found
    gaps = name_gaps(names) if one_each else NameGaps()
    if found < wanted:
        what = _missing(names if one_each else [], gaps, manifest, wanted, images_of_frame)
    else:
        what = _too_many(gaps, manifest, found)
    raise ValueError(f"{where}: {found} images; {asked}: {what}")


def _missing(names: list[str], gaps: NameGaps, manifest: FringeManifest, wanted: int, each: int) -> str:
    shown = manifest.frames
    pictures = [PurePath(frame.picture).stem for frame in shown if frame.picture]
    lost = [k for k, stem in enumerate(pictures) if not any(stem in name for name in names)]
    if names and each == 1 and len(pictures) == len(shown) and len(lost) == wanted - len(names):
        told = [f"{shown[k].picture} ({shown[k].text})" for k in lost]  # images have the names of what they show
        return f"no image for {_some(told)}"
    if gaps.missing:
        exact = len(gaps.missing) + len(names) == wanted
        told = [f"{name} ({shown[k // each].text})" if exact and each == 1 else name for k, name in gaps.missing]
        rest = wanted - len(names) - len(gaps.missing)
        more = f", and {rest} more that no number tells" if rest > 0 else ""
        return f"by the numbers in the names {_some(told)} {'are' if len(told) > 1 else 'is'} missing{more}"
    text = "images are missing, or lines of frames that were not recorded are left"
    if gaps.first is not None:
        text += f"; no number is missing from {names[0]} to {names[-1]}, so those before or after"
        text += f", such as the last ones ({shown[-1].text})" if gaps.first in (0, 1) else ""
    return f"{text}; the first is {shown[0].text}, the last {shown[-1].text}"


def _too_many(gaps: NameGaps, manifest: FringeManifest, found: int) -> str:
    shown = manifest.frames
    text = "too many"
    if gaps.odd:
        text += f"; {_some(list(gaps.odd))} {'have names' if len(gaps.odd) > 1 else 'has a name'} of another form"
    repeats, rest = divmod(found, len(shown))
    if not rest:
        text += f"; are there {repeats} images of each frame? Then say repeats = {repeats} (or exposures_s)"
    return f"{text}; the first is {shown[0].text}, the last {shown[-1].text}"


def _some(names: list[str]) -> str:
    shown = ", ".join(names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown} and {len(names) - SHOWN} more"
