"""Refused arguments: the same error names a parameter in Python and an option on the command line."""

import inspect
import pickle

import pytest

import irtscots_cl as irt
from irtscots_cl.cli import main
from irtscots_cl.cli.run import RAYS
from irtscots_cl.planning.check import check_scene
from irtscots_cl.system.option_error import OptionError, on_command_line
from irtscots_cl.tracing.options import TraceOptions


def test_python_and_the_command_line_each_name_what_they_know(capsys):
    with pytest.raises(ValueError, match=r"^bounce_limit = 99: must be 1 to \d+$"):
        TraceOptions(estimator="nonsequential", bounce_limit=99)
    with pytest.raises(ValueError, match="^rays_per_pixel = 3: must be at least the 8 replicates"):
        irt.trace(irt.load_scene("sphere"), rays_per_pixel=3)
    assert main(["run", "sphere", "--estimator", "nonsequential", "--bounce-limit", "99"]) == 2
    assert capsys.readouterr().err.startswith("irtscots: --bounce-limit = 99: must be 1 to ")


def test_a_negated_option_is_a_parameter_that_is_false():
    with pytest.raises(OptionError, match="^aimed_scatter = False: must go with estimator nonsequential, not adjoint$"):
        TraceOptions(aimed_scatter=False)


def test_it_survives_a_journey_between_processes():
    error = pickle.loads(pickle.dumps(OptionError("--least-chance = 2: must be 0 to 0.5")))
    assert str(error) == "least_chance = 2: must be 0 to 0.5"
    assert on_command_line(error) == "--least-chance = 2: must be 0 to 0.5"
    assert on_command_line(ValueError("--as it is")) == "--as it is"


def test_python_and_the_command_line_trace_as_many_rays():
    for function in (irt.trace, check_scene):
        assert inspect.signature(function).parameters["rays_per_pixel"].default == RAYS["rays_per_pixel"]
