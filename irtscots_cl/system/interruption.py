"""Ctrl-C and SIGTERM: the signals' handler sets a flag, and long steps read it.

An exception from a signal handler appears wherever Python happens to be. In a finaliser or the callback of a weak
reference Python prints it and drops it, and the signal is lost. So the handler raises nothing. A long step calls
`check` between its parts, at most about a second apart, which raises KeyboardInterrupt at a place where it can be
raised; a wait ends early by `waking` or `wait_for`. Outside `handled` nothing is ever requested, and `check` does
nothing.

A second signal ends the process at once, as it would have without a handler.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from queue import SimpleQueue
from typing import Any, TypeVar

SIGNALS = (signal.SIGINT, signal.SIGTERM)
# Programs such as timeout(1) signal a process and then its group: what comes so soon after the first is the same wish.
SAME_WISH_SECONDS = 0.5

_Result = TypeVar("_Result")
_first_signal: float | None = None  # when it came
_wakes: list[Callable[[], object]] = []
_last_acts: list[Callable[[], object]] = []


def requested() -> bool:
    """Whether Ctrl-C or SIGTERM came since `handled` began."""
    return _first_signal is not None


def check() -> None:
    """Raise KeyboardInterrupt if Ctrl-C or SIGTERM came."""
    if _first_signal is not None:
        raise KeyboardInterrupt


@contextmanager
def handled() -> Iterator[None]:
    """Handle the signals by a flag in this block; outside the main thread, where Python allows no handlers, do nothing.

    A flag that nobody has read by the end is dropped: what was to be interrupted is complete. A block inside another
    one changes nothing.
    """
    global _first_signal
    if threading.current_thread() is not threading.main_thread() or is_handled():
        yield
        return
    before = handle()
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        _first_signal = None


def handle() -> dict[signal.Signals, Any]:
    """Handle the signals by a flag from now on. Returns the handlers before."""
    return {number: signal.signal(number, _handle) for number in SIGNALS}


def is_handled() -> bool:
    return signal.getsignal(SIGNALS[0]) is _handle


@contextmanager
def waking(wake: Callable[[], object]) -> Iterator[None]:
    """Call `wake` when a signal comes during the block, from the handler: it must be safe there, as SimpleQueue.put.

    Begin a wait by `check`, for a signal that came before.
    """
    _wakes.append(wake)
    try:
        yield
    finally:
        _wakes.remove(wake)


@contextmanager
def before_the_end(act: Callable[[], object]) -> Iterator[None]:
    """Call `act` if a second signal ends the process during the block: what a `finally` would otherwise have done."""
    _last_acts.append(act)
    try:
        yield
    finally:
        _last_acts.remove(act)


def wait_for(call: Callable[[], _Result]) -> _Result:
    """The result of a call that may block for long, such as on a network; KeyboardInterrupt as soon as a signal comes.

    The call runs in a thread, which is left to itself after a signal. Without `handled` it is an ordinary call.
    """
    if not is_handled() or threading.current_thread() is not threading.main_thread():
        return call()
    outcome: SimpleQueue[tuple[Any, BaseException | None] | None] = SimpleQueue()

    def work() -> None:
        try:
            outcome.put((call(), None))
        except BaseException as error:  # the waiting thread raises it
            outcome.put((None, error))

    with waking(lambda: outcome.put(None)):
        check()
        threading.Thread(target=work, daemon=True).start()
        found = outcome.get()
    if found is None:
        raise KeyboardInterrupt
    result, error = found
    if error is not None:
        raise error
    return result  # type: ignore[no-any-return]


def _handle(number: int, _frame: object) -> None:
    """The handler: it raises nothing."""
    global _first_signal
    now = time.monotonic()
    if _first_signal is None:
        _first_signal = now
        for wake in tuple(_wakes):
            wake()
    elif now - _first_signal > SAME_WISH_SECONDS:
        for act in tuple(_last_acts):
            with suppress(Exception):
                act()
        signal.signal(number, signal.SIG_DFL)  # so that who waits for the process sees what ended it
        os.kill(os.getpid(), number)
