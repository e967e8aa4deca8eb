"""Seeded random scenes of every kind of test: near and far, fast and slow, on and off axis, sharp and out of focus."""

from __future__ import annotations

import dataclasses
import math
import random

import numpy as np

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene

# What is out of the ordinary in a scene, by its number modulo the length.
KINDS = (
    "off-axis", "oblate", "hyperbolic", "f/1", "tilted", "wide aperture", "10 m", "near", "high order", "large",
    "defocus", "annulus", "fast off-axis", "foci",
)  # fmt: skip
LOW, HIGH = range(4, 29), (46, 57, 79, 106, 137, 172)  # Noll


def varied_scene(number: int) -> Scene:
    """The number-th scene: of the kind number % len(KINDS), all else by chance."""
    chance = random.Random(f"scene {number}")
    kind = KINDS[number % len(KINDS)]
    radius = chance.choice((600.0, 1500.0, 3000.0, 4200.0))
    if kind in ("10 m", "near"):
        radius = {"10 m": 10000.0, "near": 300.0}[kind]
    ratio = chance.uniform(2.0, 6.0)  # radius over diameter; f/1 has 2
    conic, off_axis = chance.choice((0.0, 0.0, -0.5, -1.0)), 0.0
    if kind == "f/1":
        ratio = chance.uniform(1.9, 2.1)
    elif kind == "oblate":
        conic = chance.uniform(0.3, 1.5)
    elif kind == "hyperbolic":
        conic = chance.uniform(-4.0, -1.5)
    diameter = radius / ratio
    if kind in ("off-axis", "fast off-axis"):
        conic, diameter = chance.uniform(-1.0, -0.4), diameter * (0.6 if kind == "off-axis" else 0.9)
        off_axis = diameter * chance.uniform(0.7, 1.2)
    if kind == "foci":
        conic = -chance.uniform(0.05, 0.3)
    mirror = Mirror(radius_mm=radius, diameter_mm=diameter, conic=conic, off_axis_mm=off_axis,
                    obscuration_mm=0.25 * diameter if kind == "annulus" else 0.0,
                    zernike=(_deviation(kind, diameter, chance),))  # fmt: skip
    return _with_screen(_instrument(mirror, kind, number, chance), chance)


def _deviation(kind: str, diameter: float, chance: random.Random) -> ZernikeTerms:
    """Low orders of a tenth of a micrometre; more or finer for those kinds. A smaller mirror deviates less."""
    size = min(diameter / 1000, 1.0) * (3.0 if kind == "large" else 0.2)
    noll = {n: size * chance.gauss(0, 1) / n**0.5 for n in chance.sample(LOW, 6)}
    if kind == "high order":
        noll |= {n: 0.1 * size * chance.gauss(0, 1) for n in HIGH}
    return ZernikeTerms(radius_mm=diameter / 2, ordering="noll", coefficients_um=noll)


def _instrument(mirror: Mirror, kind: str, number: int, chance: random.Random) -> Scene:
    """Camera and screen beside each other near the centre of curvature, or at the foci of the ellipsoid."""
    radius, along = mirror.radius_mm, chance.uniform(0.97, 1.03)
    apart = radius * math.tan(math.radians(chance.uniform(0.5, 4.0)))
    height = radius * along
    if mirror.off_axis_mm:  # mean of the two principal radii of the segment at its centre
        slope2 = mirror.off_axis_mm**2 / (radius**2 - (1 + mirror.conic) * mirror.off_axis_mm**2)
        height = radius * math.sqrt(1 + slope2) ** 2
        apart *= 0.5
    places = [(-apart, apart * chance.uniform(-0.5, 0.5), height), (apart, 0.0, height * chance.uniform(0.99, 1.01))]
    if kind == "foci":  # of the conic: all light of a point of the aperture comes to one point of the screen
        excentricity = math.sqrt(-mirror.conic)
        places = [(0.0, 0.0, radius / (1 + sign * excentricity)) for sign in (1, -1)]
        places = [(sign * 0.02 * radius, 0.0, z) for sign, (_, _, z) in zip((-1, 1), places, strict=True)]
    columns, rows = chance.choice(((41, 41), (48, 48), (64, 48), (72, 72), (96, 72)))
    distance = math.dist(places[0], (0, 0, 0))
    focal = distance / chance.uniform(80.0, 250.0)
    image = mirror.diameter_mm * focal / distance * chance.uniform(1.02, 1.15)
    apertures = (10.0, 20.0) if kind == "wide aperture" else (1.0, 1.0, 2.0, 5.0)
    aperture = 10.0 if kind == "f/1" and number % 2 else chance.choice(apertures)
    aperture = min(aperture, distance / 100)
    look = (0.0, 0.0, 0.0)
    if kind == "tilted":
        look = (*(0.03 * mirror.diameter_mm * chance.uniform(-1, 1) for _ in range(2)), 0.0)
    camera = Camera(
        position_mm=places[0], look_at_mm=look, aperture_diameter_mm=aperture, focal_length_mm=focal,
        focus_distance_mm=distance * chance.uniform(0.7, 0.8) if kind == "defocus" else None,
        detector=Detector(pixels=(columns, rows), pitch_mm=image / min(columns, rows)),
    )  # fmt: skip
    aside = (0.4 * radius * chance.uniform(0.5, 1), -0.3 * radius, 0.0) if kind == "tilted" else (0.0, 0.0, 0.0)
    screen = Screen(position_mm=places[1], look_at_mm=aside, pixels=(3, 3), pitch_mm=1.0)
    return Scene(name=f"varied-{number}", mirror=mirror, screen=screen, camera=camera)


def _with_screen(scene: Scene, chance: random.Random) -> Scene:
    """The scene with a screen that all of the mirror's light falls on. A pixel's light covers two to eight lines."""
    chief = ChiefRays(scene)
    inside = np.hypot(*np.moveaxis(chief.corners[0][..., :2], -1, 0)) <= scene.mirror.diameter_mm / 2
    spans, middles, spots = [], [], []
    for k, corner in enumerate(chief.corners[1:]):
        lit = corner[inside]
        whole = inside[1:, 1:] & inside[:-1, :-1]
        blur = 2 * chief.rims.half_range(k)[whole]
        spots.append(np.nanmedian(blur + np.abs(corner[1:, 1:] - corner[:-1, :-1])[whole]))
        spans.append(np.ptp(lit) + 2.5 * np.nanmax(blur))  # NaN in a hole
        middles.append(float(np.round((lit.max() + lit.min()) / 2, 3)))
    pitch = round(max(min(spots) / chance.uniform(2, 8), max(spans) / 2000, 0.02), 3)
    pixels = tuple(int(span / pitch) + 7 for span in spans)
    screen = dataclasses.replace(scene.screen, pixels=pixels, pitch_mm=pitch, centre_offset_mm=tuple(middles))
    return dataclasses.replace(scene, screen=screen)
