"""Options of a trace: each that is out of range is refused in one line that names it as the command line does."""

from __future__ import annotations

import dataclasses

import pytest
from scenes import coarse, with_part

from irtscots_cl.scene.camera_intrinsics import Intrinsics
from irtscots_cl.scene.screen_shape import CoverGlass, ScreenShape
from irtscots_cl.tracing.options import AIMS, ANALYTIC, ESTIMATORS, NONSEQUENTIAL, TraceOptions
from irtscots_cl.tracing.samplers import SAMPLERS
from irtscots_cl.tracing.trace import trace, trace_paths

ALL = (*ESTIMATORS, ANALYTIC, NONSEQUENTIAL)


def test_the_defaults_are_allowed_and_cannot_be_changed_afterwards():
    options = TraceOptions()
    assert (options.estimator, options.sampler, options.precision) == ("adjoint", "philox", "fp32")
    assert (options.seed, options.overfill, options.smoothing) == (1, 1.0, False)
    with pytest.raises(dataclasses.FrozenInstanceError):
        options.seed = 2


@pytest.mark.parametrize(
    "given",
    [
        *({"estimator": name} for name in (*ESTIMATORS, ANALYTIC)),
        *({"sampler": name} for name in SAMPLERS),
        *({"precision": name} for name in ("fp32", "fp64")),
        *({"seed": seed} for seed in (0, 2**64 - 1)),
        *({"estimator": "forward", "overfill": overfill} for overfill in (1.0, 1, 1e4)),
        {"overfill": 1.0},
        *({"estimator": "forward", "aim": aim} for aim in AIMS),
        {"smoothing": True},
        {"smoothing": True, "sampler": "sobol", "precision": "fp64", "seed": 7},
    ],
    ids=str,
)
def test_every_value_in_range_is_kept(given):
    options = TraceOptions(**given)
    assert {name: getattr(options, name) for name in given} == given


@pytest.mark.parametrize(
    ("given", "message"),
    [
        *(({"estimator": name}, f"estimator = '{name}': must be one of {', '.join(ALL)}") for name in ("backward", "")),
        ({"sampler": "halton"}, f"sampler = 'halton': must be one of {', '.join(SAMPLERS)}"),
        ({"precision": "fp16"}, "precision = 'fp16': must be one of fp32, fp64"),
        ({"seed": -1}, "seed = -1: must be 0 to 2^64 - 1"),
        ({"seed": 2**64}, "seed = 18446744073709551616: must be 0 to 2^64 - 1"),
        ({"overfill": 0.99}, "overfill = 0.99: must be 1 to 10000"),
        ({"overfill": 10001}, "overfill = 10001: must be 1 to 10000"),
        ({"overfill": float("nan")}, "overfill = nan: must be 1 to 10000"),
        ({"overfill": float("inf")}, "overfill = inf: must be 1 to 10000"),
        ({"overfill": -1.0}, "overfill = -1.0: must be 1 to 10000"),
        ({"overfill": 2.0}, "overfill = 2.0: must go with estimator forward, not adjoint"),
        ({"overfill": 2.0, "estimator": ANALYTIC}, "overfill = 2.0: must go with estimator forward, not analytic"),
        ({"aim": "screen"}, "aim = 'screen': must be one of mirror, camera"),
        *(
            ({"aim": "camera", "estimator": name}, f"aim camera: must go with estimator forward, not {name}")
            for name in ("adjoint", ANALYTIC)
        ),
        *(
            (
                {"smoothing": True, "estimator": name},
                f"smoothing: must go with estimator adjoint, not {name}",
            )
            for name in ("forward", ANALYTIC)
        ),
        *(
            ({option: value}, f"{words}: must go with estimator nonsequential, not adjoint")
            for option, value, words in (
                ("bounce_limit", 3, "bounce_limit = 3"),
                ("least_chance", 0.2, "least_chance = 0.2"),
                ("branches", "split", "branches = split"),
                ("aimed_scatter", False, "aimed_scatter = False"),
            )
        ),
        *(
            ({"estimator": NONSEQUENTIAL} | given, message)
            for given, message in (
                ({"bounce_limit": 0}, "bounce_limit = 0: must be 1 to 42"),
                ({"least_chance": 0.6}, "least_chance = 0.6: must be 0 to 0.5"),
                ({"branches": "some"}, "branches = 'some': must be one of random, split"),
            )
        ),
    ],
    ids=str,
)
def test_a_value_out_of_range_is_refused_in_one_line(given, message):
    with pytest.raises(ValueError, match="must") as caught:
        TraceOptions(**given)
    assert str(caught.value) == message and message.isprintable()


@pytest.mark.parametrize(("earlier", "name"), [("roulette", "random"), ("both", "split")])
def test_earlier_names_of_the_branches_go_on_working(earlier, name):
    assert TraceOptions(NONSEQUENTIAL, branches=earlier) == TraceOptions(NONSEQUENTIAL, branches=name)


@pytest.mark.parametrize(
    ("part", "changes", "message"),
    [
        ("camera", {"intrinsics": Intrinsics(distortion=(0.1, 0.0, 0.0, 0.0))},
         "camera.intrinsics.distortion = [0.1, 0.0, 0.0, 0.0]"),
        ("camera", {"aperture_offset_mm": (0.1, 0.0)}, "camera.aperture_offset_mm = [0.1, 0.0]"),
        ("screen", {"shape": ScreenShape(sag_mm=((2, 0, 0.1),))}, "screen.shape = a bent screen"),
        ("screen", {"cover_glass": CoverGlass(1.0)}, "screen.cover_glass = a plate on the pixels"),
    ],
)  # fmt: skip
def test_what_the_non_sequential_estimator_does_not_see_is_refused(device, part, changes, message):
    scene = with_part(coarse("sphere", 9), part, **changes)
    with pytest.raises(ValueError, match="must be left out") as caught:
        trace_paths(scene, device=device, rays_per_pixel=64)
    must = "must be left out with estimator nonsequential, or estimator be forward, adjoint, analytic"
    assert str(caught.value) == f"scene sphere: {message}: {must}"
    assert trace(scene, device=device, rays_per_pixel=64).ledger["detected"] > 0  # as the message says
