"""Codes of paths: their events, the class that they give a path, and its name."""

from __future__ import annotations

import pytest

from irtscots_cl.opencl.structs import MAX_EVENTS, PATH_WORDS, SHORT_EVENTS
from irtscots_cl.scene.model import MAX_ELEMENTS
from irtscots_cl.tracing.estimators.path_sums import TrackedPaths
from irtscots_cl.tracing.results.paths import KINDS, PATH_BITS, events_of, kind_of, name_of

NOMINAL, GHOST, SCATTER = range(3)
NAMES = ("mirror", "stop", "lens", "detector", "front", "back")
HIGHEST = MAX_ELEMENTS + 3  # number of the last element: mirror, stop, lens and detector come before a scene's own


def code_of(*events):
    """Six bits per event, the first one highest, written out apart from the package."""
    code = 0
    for element, event in events:
        code = code * 64 + 3 * element + event + 1
    return code


def test_the_code_is_what_the_kernels_write():
    """Numbers worked out by hand: a change of both code_of and events_of would not be seen otherwise."""
    assert code_of((0, NOMINAL), (3, NOMINAL)) == 0b000001_001010
    assert events_of(0b000001_001010) == [(0, NOMINAL), (3, NOMINAL)]
    assert events_of(0b001110_000011_001010) == [(4, GHOST), (0, SCATTER), (3, NOMINAL)]


def test_no_event_at_all():
    assert events_of(0) == []
    assert kind_of(0) == NOMINAL
    assert name_of(0, NAMES) == "screen"


@pytest.mark.parametrize("element", range(HIGHEST + 1))
@pytest.mark.parametrize("event", [NOMINAL, GHOST, SCATTER])
def test_every_event_of_every_element_is_a_digit_of_its_own(element, event):
    code = code_of((element, event))
    assert 0 < code < 2**PATH_BITS  # never 0: a first event would be lost
    assert events_of(code) == [(element, event)]
    assert kind_of(code) == event
    assert events_of(code_of((1, NOMINAL), (element, event), (2, GHOST))) == [
        (1, NOMINAL), (element, event), (2, GHOST)
    ]  # fmt: skip


def test_ten_events_fill_sixty_bits():
    """The longest path of the largest digits: two words of the kernels' Path structure hold it, and none is lost."""
    assert SHORT_EVENTS == 10
    events = [(HIGHEST, SCATTER)] * SHORT_EVENTS
    code = code_of(*events)
    assert 2**59 <= code < 2**60
    assert events_of(code) == events
    mixed = [(k, k % 3) for k in range(SHORT_EVENTS)]
    assert events_of(code_of(*mixed)) == mixed
    low, high = code & 0xFFFFFFFF, code >> 32
    assert high < 2**28
    assert events_of(high << 32 | low) == events


def test_longer_paths_take_eight_words():
    """42 events, more than 16 elements that are met twice; the table of tracked paths holds their codes."""
    assert MAX_EVENTS == 42
    events = [(k % (HIGHEST + 1), k % 3) for k in range(MAX_EVENTS)]
    code = code_of(*events)
    assert 2**246 < code < 2**252
    assert events_of(code) == events
    (entry, _) = TrackedPaths((code,), (1.0,)).table("long")
    assert len(entry["word"]) == PATH_WORDS["long"] == 8
    assert sum(int(word) << 32 * k for k, word in enumerate(entry["word"])) == code


@pytest.mark.parametrize(
    ("events", "kind"),
    [
        ([(0, NOMINAL), (2, NOMINAL), (3, NOMINAL)], "direct"),
        ([(0, NOMINAL), (4, GHOST), (5, GHOST), (3, NOMINAL)], "ghost"),
        ([(4, NOMINAL), (0, NOMINAL), (4, NOMINAL), (3, NOMINAL)], "direct"),  # a window before the mirror
        ([(0, NOMINAL), (4, NOMINAL), (0, NOMINAL), (3, NOMINAL)], "direct"),  # a double pass
        ([(4, NOMINAL), (0, NOMINAL), (4, GHOST), (0, NOMINAL), (4, NOMINAL), (3, NOMINAL)], "ghost"),
        ([(0, SCATTER), (2, NOMINAL), (3, NOMINAL)], "scatter"),
        ([(0, SCATTER), (4, GHOST), (5, GHOST), (3, NOMINAL)], "scatter"),
        ([(4, GHOST), (0, SCATTER), (3, NOMINAL)], "scatter"),
        ([(0, SCATTER), (4, NOMINAL), (0, NOMINAL), (3, NOMINAL)], "scatter"),  # twice, and scattered
        ([(0, NOMINAL), (4, GHOST), (0, SCATTER), (3, NOMINAL)], "scatter"),
    ],
)
def test_the_strangest_event_makes_the_kind(events, kind):
    assert KINDS[kind_of(code_of(*events))] == kind


def test_a_name_tells_elements_in_order_with_what_happened():
    events = [(0, SCATTER), (4, NOMINAL), (5, GHOST), (4, GHOST), (5, NOMINAL), (3, NOMINAL)]
    assert name_of(code_of(*events), NAMES) == ("screen > mirror (s) > front > back (r) > front (r) > back > detector")
