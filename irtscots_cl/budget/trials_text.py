"""The trials of a budget as text, for other processes, which need no file that the scene or the budget names.

The scene is the design, which has no height maps; the sources and the covariance of `calibrated` are in the text. From
it come the same trials, bit by bit. The one file that is read for them is the picture of a mirror's outline.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np

from irtscots_cl.budget.joint import NONE, Joint
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.sources import STRAY
from irtscots_cl.budget.trial_blocks import TrialBlock, block_of
from irtscots_cl.budget.trials import Trials
from irtscots_cl.calibration.seen_pixels import SeenPixels, seen_pixels
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Air, Budget
from irtscots_cl.scene.presets import parse_scene
from irtscots_cl.scene.validation import problem

OF_FILES = ("map.", *STRAY)  # sources, or how their names begin


def trials_text(trials: Trials) -> str:
    """The text of trials, with the design's pixels, frames and air.

    Raises SceneError for sources of a file that only this process can read.
    """
    design, joint = trials.design, trials.joint
    for source in trials.sources:
        if source.name.startswith(OF_FILES):
            key = ("budget", "sources", source.name)
            raise problem(design.setup.scene.name, key, "must be left out on a cluster: its file is read here alone")
    periods, steps = design.fringes or ((), trials.budget.steps)
    budget = replace(trials.budget, calibrated=None, stray_light=None, periods=periods, steps=steps, air=design.air)
    return json.dumps({
        "scene": replace(design.setup.scene, budget=budget).to_toml(),
        "names": joint.names,
        "root": joint.root.tolist(),
        "step": design.seen.step,
        "mask": np.packbits(design.seen.mask).tobytes().hex(),
    })  # fmt: skip


def trials_of_text(text: str) -> Trials:
    """The trials of a text of trials_text. Raises SceneError where the outline's picture cannot be read."""
    told = json.loads(text)
    scene = parse_scene(told["scene"])
    setup, budget = Setup(scene).nominal, scene.budget or Budget()
    design = MeasuredDesign(setup, _seen(setup, told["step"], told["mask"]), budget.fringes, budget.air or Air())
    names = tuple(told["names"])
    return replace(Trials.of(design, budget), joint=Joint(names, np.array(told["root"])) if names else NONE)


_kept: dict[str, Trials] = {}  # those of the last text, with all that was derived from them


def block_of_text(text: str, block: int) -> TrialBlock:
    """A block of the trials of a text, which are made once in a process."""
    if text not in _kept:
        _kept.clear()  # first: there is never memory for two
        _kept[text] = trials_of_text(text)
    return block_of(_kept[text], block)


def _seen(setup: Setup, step: int, mask: str) -> SeenPixels:
    seen = seen_pixels(setup, -(-max(setup.chief_rays.shape) // step))
    bits = np.unpackbits(np.frombuffer(bytes.fromhex(mask), np.uint8), count=seen.mask.size)
    return replace(seen, mask=bits.reshape(seen.mask.shape).astype(bool))
