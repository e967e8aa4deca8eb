"""What an error of single frames does to places, against measurements made frame by frame."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup

FRINGES = ((3.0, 20.0), 5)


@pytest.fixture(scope="module")
def setup():
    return Setup(small_scene())


def test_light_curves_of_shifted_and_dimmed_frames(setup):
    """Against light curves in closed form, each frame with a shift or a brightness of its own."""
    design, random = MeasuredDesign.of(setup), np.random.default_rng(2)
    row, column = design.seen.pixels
    inside = np.hypot(design.seen.x_mm[design.seen.mask], design.seen.y_mm[design.seen.mask]) < 400
    chosen = np.flatnonzero(inside)[5::97]
    numbers = (row[chosen] * setup.scene.camera.detector.pixels[0] + column[chosen]).astype(int)
    light, screen = PixelLight.of(setup.chief_rays, numbers), setup.scene.screen
    for axis, output in enumerate("uv"):
        shares, pitch = design.light.shares[axis], screen.pitch_xy_mm[axis]
        lines = shares.share.shape[1]
        low = (shares.lines[chosen] - screen.pixels[axis] / 2) * pitch
        place = low + pitch / 2

        def centroid(shift, brightness, output=output, low=low, place=place, pitch=pitch, lines=lines):
            curve = np.stack([
                light.light(output, np.stack([low[:, k] - shift[k], low[:, k] + pitch - shift[k]], -1))[:, 0]
                for k in range(lines)
            ], -1) * brightness  # fmt: skip
            return np.sum(place * curve, -1) / curve.sum(-1)

        own = centroid(np.zeros(lines), 1.0)
        dimmed = 1 + 0.01 * random.standard_normal(lines)
        moved = centroid(np.zeros(lines), dimmed) - own
        told = design.frames.of_brightness[axis][chosen] @ (dimmed - 1)
        assert np.abs(moved - told).max() < 0.1 * np.abs(moved).max()  # shares are good to a few per cent
        shift = 0.02 * pitch * random.standard_normal(lines)
        moved = centroid(shift, 1.0) - own
        told = design.frames.of_shift[axis][chosen] @ shift
        assert np.abs(moved - told).max() < 0.05 * np.abs(moved).max()  # places of lines by shares


def test_fringes_of_shifted_and_dimmed_frames(setup):
    """Phases by least squares of frames that are made one by one; places weighed by the squares of the periods."""
    design, random = MeasuredDesign.of(setup, FRINGES), np.random.default_rng(3)
    periods, steps = FRINGES
    screen, frames = setup.scene.screen, design.frames
    angle = 2 * np.pi * np.arange(steps) / steps
    columns = np.stack([np.ones(steps), np.cos(angle), np.sin(angle)], -1)
    for axis in range(2):
        width = screen.pixels[axis] * screen.pitch_xy_mm[axis]
        u = design.places_mm[axis] / width + 0.5
        for shift, brightness in ((1e-5 * width * random.standard_normal(frames.counts[axis]), 0.0),
                                  (0.0, 1e-3 * random.standard_normal(frames.counts[axis]))):  # fmt: skip
            found = 0.0
            for k, p in enumerate(periods):
                part = slice(k * steps, (k + 1) * steps)
                by = np.broadcast_to(shift, frames.counts[axis])[part]
                factor = 1 + np.broadcast_to(brightness, frames.counts[axis])[part]
                phase = 2 * np.pi * p * (u[:, None] + by / width)
                frame = factor * (1 + np.cos(phase - angle))
                _, cosine, sine = np.linalg.lstsq(columns, frame.T)[0]
                turn = np.angle((cosine + 1j * sine) * np.exp(-2j * np.pi * p * u))
                found = found + p**2 / np.square(periods).sum() * turn * width / (2 * np.pi * p)
            told = frames.of_shift[axis] @ np.broadcast_to(shift, frames.counts[axis])
            told = told + frames.of_brightness[axis] @ np.broadcast_to(brightness, frames.counts[axis])
            assert np.abs(found - told).max() < 3e-3 * np.abs(told).max()


@pytest.mark.parametrize("fringes", [None, FRINGES])
def test_a_shift_of_all_frames_is_the_places_own(setup, fringes):
    design = MeasuredDesign.of(setup, fringes)
    for axis in range(2):
        assert np.abs(design.frames.of_shift[axis].sum(-1) - 1).max() < 1e-12
        assert np.abs(design.frames.of_brightness[axis].sum(-1)).max() < 1e-12
